# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""Watches every bubble for what control cannot mend, and for how long it has been under pressure.

`check` runs in every tick after `control.step`, on the same rows, and sets the fault bits that make control isolate a
bubble from the next tick on. What it goes by, with thresholds and measured times, is in docs/safety.md:

- the *book of air*: control adds what the valves have brought and then moves the sum to what the sensor says. What
  is taken away in this way is air that is missing, what is added is surplus. Two leaky buckets collect them.
- a *closed* line must keep its pressure, an open valve must show the tube's loss of pressure, a bubble that is *fed*
  must get some, and a *vented* one must lose it.
- a sensor has noise: one that always says the same is not read.

State that is watched but not controlled stands in rows of its own. It allocates nothing.
"""

from array import array

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# From `control`; a test compares them.
OPENS_US = const(1)
CLOSES_US = const(2)
CALM = const(6)
COAST = const(34)
PRESSURE = const(4)
AIR = const(10)
DOSE = const(11)
NEXT = const(12)
BUSY = const(9)
FLOW = const(14)
INTEGRAL = const(15)
FILL_US = const(18)
VENT_US = const(19)
LOST = const(40)
FAULTS = const(21)
STATUS = const(22)
ROW = const(41)
N = const(0)
TICK_US = const(1)
TUBE = const(9)
RAMP_DONE = const(18)
RAMP_TICKS = const(19)
RESTING = const(0)
MOVING = const(1)
FAULT = const(4)
# From the schema; the same test.
LEAK = const(8)
NO_AIR = const(16)
VALVE_STUCK = const(32)
SENSOR_STUCK = const(64)
BUDGET = const(128)

# A row of the guard's.
WAS_AIR = const(0)  # µJ, at the start of the last period; -1: not begun
WAS_PA = const(1)
MISSING = const(2)  # µJ that were brought and are not there
SURPLUS = const(3)  # µJ that are there and were not brought
SAME = const(4)  # ticks for which the sensor has said the same
SINCE_PA = const(5)  # pressure of the closed line, when that was first compared
SINCE = const(6)  # ticks since; from SETTLE to 0 it settles
WRONG = const(7)  # ticks in a row in which it was out of bounds
FELL_PA = const(8)  # where the pressure of the vented line last fell to
FELL = const(9)  # ticks since
FED = const(10)  # µJ that have come in for sure, and still no pressure
LOW_PA = const(11)  # before a valve opened
HIGH_PA = const(12)
RUN = const(13)  # ticks in a row with a valve open
DRY = const(14)  # ticks in a row of these without a sign of flow
INFLOW = const(15)  # whether air has come in that was not asked for
LOAD = const(16)  # of the budget, Pa ticks
SPENT = const(17)  # whether it was used up and has not recovered
SEEN = const(18)  # faults that are in the log
GIVEN = const(19)  # µJ that have come in for sure since the last measurement
TAKEN = const(20)  # µJ let out while there is surplus
EMPTIED = const(21)  # whether the pressure has dropped as no valve makes it drop
# What control had decided before this tick, which is what the pressure of this tick tells of.
WAS_STATUS = const(22)
WAS_DOSE = const(23)
WAS_BUSY = const(24)
WAS_FLOW = const(25)
WAS_FILL = const(26)
WAS_VENT = const(27)
GUARD = const(28)

# The board's numbers for it.
ALLOWED = const(0)  # µJ in a tick that may get lost
FROZEN = const(1)  # ticks
WINDOW = const(2)  # ticks for which a closed line is compared with its beginning
STALL = const(3)  # ticks in which a vented line must fall
FLOWS = const(4)  # ticks after which an open valve must show flow
DRY_MAX = const(5)
FREE_PA = const(6)  # pressure that costs no budget
LOAD_MAX = const(7)  # Pa ticks
NUMBERS = const(8)

MISSING_MAX = const(80000)  # µJ
SURPLUS_MAX = const(90000)
CLOSED_PA = const(700)  # a closed line keeps its pressure within, and within 1/64 of it: its neighbours move
SETTLE = const(-2)  # quiet ticks before that is begun
READINGS = const(2)  # in a row: one alone is noise
FED_PA = const(8000)  # which 4 mJ bring about
FED_MAX = const(12000)  # µJ
DROP_PA = const(10000)
UNSURE_US = const(600)  # that a valve may be open less than is known
NO_PA = const(1500)  # as good as nothing
FLAT_PA = const(1000)  # below it a vented bubble is flat
VENTED_PA = const(3000)  # below it a vented line need not fall
FALL_PA = const(1000)  # by which it must fall otherwise
OVERFILLED_PA = const(12000)  # 5.8 mm: more in a vented bubble, and the supply is shut down for all

# What `check` says.
NEW_FAULT, MOVING_BUBBLE, PRESSED_BUBBLE, OVERFILLED_BUBBLE = 1, 2, 4, 8
_NEW = const(1)
_MOVES = const(2)
_PRESSED = const(4)
_OVERFILLED = const(8)

_ALLOWED_UJ_S = const(50000)
_WINDOW_US = const(300000)
_STALL_US = const(300000)
_FLOWS_US = const(15000)
_DRY_US = const(30000)


@micropython.viper
def _check(s: ptr32, g: ptr32, k: ptr32, w: ptr32) -> int:
    n = k[N]
    tick = k[TICK_US]
    said = 2 if k[RAMP_DONE] < k[RAMP_TICKS] else 0
    while n > 0:
        p = s[PRESSURE]
        air = s[AIR]
        faults = s[FAULTS]
        if g[WAS_AIR] < 0:
            g[FELL_PA] = p
            g[WAS_AIR] = air

        # A sensor has noise.
        fell = g[WAS_PA] - p
        if fell or s[LOST]:
            g[SAME] = 0
            g[WAS_PA] = p
        else:
            g[SAME] = g[SAME] + 1
            if g[SAME] >= w[FROZEN]:
                faults |= SENSOR_STUCK

        # The budget: what is above the threshold adds up, what is below recovers.
        load = g[LOAD] + p - w[FREE_PA]
        if load < 0:
            load = 0
        if load > w[LOAD_MAX]:
            load = w[LOAD_MAX] + 1
            g[SPENT] = 1
        g[LOAD] = load
        if g[SPENT]:
            if load < w[LOAD_MAX] >> 1:
                g[SPENT] = 0
            else:
                faults |= BUDGET

        if g[WAS_STATUS] == RESTING or g[WAS_STATUS] == FAULT:
            # Vented: the pressure falls, or is gone.
            g[LOW_PA] = p
            g[HIGH_PA] = p
            if p > FLAT_PA:
                said |= _PRESSED
            if p < VENTED_PA or p < g[FELL_PA] - FALL_PA:
                g[FELL_PA] = p
                g[FELL] = 0
                if p < VENTED_PA and faults == 0:
                    g[INFLOW] = 0
            elif s[LOST] == 0:
                g[FELL] = g[FELL] + 1
                if p > g[FELL_PA] + FALL_PA:
                    g[INFLOW] = 1
                if g[FELL] >= w[STALL]:
                    faults |= VALVE_STUCK
                    if g[INFLOW] and p > OVERFILLED_PA:
                        said |= _OVERFILLED
        else:
            said |= _PRESSED
            if g[WAS_STATUS] == MOVING:
                said |= _MOVES
            g[FELL_PA] = p
            g[FELL] = 0
            if s[LOST] == 0:
                quiet = 1 if g[WAS_BUSY] <= 0 else 0
                found = air - g[WAS_AIR] - g[WAS_DOSE]
                fed = 0
                # Where nothing has come and nothing is counted, the book stays as it is.
                if found | g[WAS_FILL] | g[MISSING] | g[SURPLUS] | g[GIVEN] >> 4:
                    # For sure: dead times differ, so a valve may be open for less than is known.
                    on = g[WAS_FILL]
                    if on and (on < tick or g[RUN] == 0):
                        on -= s[OPENS_US] - s[CLOSES_US] + UNSURE_US
                    fed = g[WAS_FLOW] * on // 16000 if on > 0 else 0

                    # The book of air. Missing is at most what has come in for sure: the rest is bad metering.
                    lost = 0 - found
                    if lost > 0:
                        if lost > g[GIVEN]:
                            lost = g[GIVEN]
                        g[GIVEN] = g[GIVEN] - lost
                    lost += g[MISSING] - w[ALLOWED]
                    g[MISSING] = lost if lost > 0 else 0
                    if quiet:  # control moves its estimate over many readings, and so do we
                        g[GIVEN] = g[GIVEN] - (g[GIVEN] >> 4)
                    g[GIVEN] = g[GIVEN] + fed
                    more = g[SURPLUS] + found - w[ALLOWED]
                    if more <= 0:
                        more = 0
                        g[TAKEN] = 0
                    elif g[WAS_DOSE] < 0:
                        g[TAKEN] = g[TAKEN] - g[WAS_DOSE]
                    g[SURPLUS] = more
                    if lost > MISSING_MAX:
                        faults |= LEAK
                    if more > SURPLUS_MAX:
                        faults |= VALVE_STUCK
                        if more > g[TAKEN] + SURPLUS_MAX // 4:  # else it may be that nothing was let out
                            g[INFLOW] = 1

                if p >= FED_PA:
                    g[EMPTIED] = 0
                    g[FED] = 0
                else:
                    # No valve empties a bubble in a tick.
                    if g[EMPTIED]:
                        faults |= LEAK
                    elif fell > DROP_PA:
                        g[EMPTIED] = 1
                    # Fed, nothing let out, and still without pressure? What now begins to flow counts from the next
                    # tick on.
                    if g[WAS_VENT]:
                        g[FED] = 0
                    else:
                        if g[FED] > FED_MAX:
                            faults |= LEAK if p > NO_PA else NO_AIR
                        g[FED] = g[FED] + fed

                # Open: the tube's loss of pressure shows, this way or the other.
                if quiet or p < g[LOW_PA]:
                    g[LOW_PA] = p
                if quiet or p > g[HIGH_PA]:
                    g[HIGH_PA] = p
                if g[WAS_FILL] == tick or g[WAS_VENT] == tick:
                    g[RUN] = g[RUN] + 1
                    if g[RUN] > w[FLOWS]:
                        sign = p - g[LOW_PA] if g[WAS_FILL] else g[HIGH_PA] - p
                        if sign < (k[TUBE] * g[WAS_FLOW] >> 4) // 3:
                            g[DRY] = g[DRY] + 1
                            if g[DRY] >= w[DRY_MAX]:
                                faults |= NO_AIR if g[WAS_FILL] else VALVE_STUCK
                        else:
                            g[DRY] = 0
                else:
                    g[RUN] = 0
                    g[DRY] = 0

                # Closed: the pressure stays.
                if quiet == 0 or g[WAS_DOSE] != 0:
                    g[SINCE] = SETTLE
                else:
                    if g[SINCE] <= 0 or g[SINCE] >= w[WINDOW]:
                        g[SINCE_PA] = p
                        g[WRONG] = 0
                        if g[SINCE] > 0:
                            g[SINCE] = 0
                    g[SINCE] = g[SINCE] + 1
                    change = p - g[SINCE_PA]
                    within = CLOSED_PA + (g[SINCE_PA] >> 6)
                    if change > within or change < 0 - within:
                        g[WRONG] = g[WRONG] + 1
                        if g[WRONG] >= READINGS:
                            if change < 0:
                                faults |= LEAK
                            else:
                                faults |= VALVE_STUCK
                                g[INFLOW] = 1
                    else:
                        g[WRONG] = 0
        g[WAS_AIR] = air
        if g[WAS_STATUS] != s[STATUS]:
            g[WAS_STATUS] = s[STATUS]
            if s[STATUS] == RESTING or s[STATUS] == FAULT:  # what only matters to a bubble under control begins anew
                g[MISSING] = 0
                g[SURPLUS] = 0
                g[RUN] = 0
                g[FED] = 0
                g[GIVEN] = 0
                g[TAKEN] = 0
                g[EMPTIED] = 0
                g[SINCE] = SETTLE
        g[WAS_DOSE] = s[DOSE]
        g[WAS_BUSY] = s[BUSY]
        g[WAS_FLOW] = s[FLOW]
        g[WAS_FILL] = s[FILL_US]
        g[WAS_VENT] = s[VENT_US]
        if faults:
            s[FAULTS] = faults
            s[CALM] = 0  # control is to look at it in the next tick
            s[COAST] = 0
        g[SEEN] = g[SEEN] & faults
        if g[SEEN] != faults:
            said |= _NEW
        n -= 1
        s = ptr32(uint(s) + 4 * ROW)
        g = ptr32(uint(g) + 4 * GUARD)
    return said


@micropython.viper
def _block_backflow(s: ptr32, pulse: ptr16, supply: int, n: int):
    i = 0
    while i < n:
        if pulse[2 * i] and supply < s[PRESSURE]:
            pulse[2 * i] = 0
            s[FILL_US] = 0
            s[NEXT] = 0
            s[INTEGRAL] = 0
            s[CALM] = 0
            s[COAST] = 0
        i += 1
        s = ptr32(uint(s) + 4 * ROW)


class FaultMonitor:
    """Watches `bubbles`. `check` returns what it has found, as bits: NEW_FAULT, MOVING_BUBBLE and so on."""

    def __init__(self, board, bubbles):
        n = board.BUBBLES
        self._bubbles = bubbles
        self._count = n
        self._tick_us = board.TICK_US
        self._enough_pa = board.PRESSURE_MAX_PA
        self._rows = array("i", bytearray(4 * GUARD * n))
        self._numbers = w = array("i", bytearray(4 * NUMBERS))
        w[ALLOWED] = _ALLOWED_UJ_S * board.TICK_US // 1000000
        w[FROZEN] = board.FROZEN_US // board.TICK_US
        w[WINDOW] = _WINDOW_US // board.TICK_US
        w[STALL] = _STALL_US // board.TICK_US
        w[FLOWS] = -(-_FLOWS_US // board.TICK_US)
        w[DRY_MAX] = _DRY_US // board.TICK_US
        w[FREE_PA] = board.BUDGET_FREE_PA
        self.set_budget(board.BUDGET_KPA_S)
        for at in range(0, n * GUARD, GUARD):
            self._rows[at + WAS_AIR] = -1
            self._rows[at + SINCE] = SETTLE

    def set_budget(self, kpa_s):
        """How much pressure times time above the threshold each bubble may have."""
        self._numbers[LOAD_MAX] = kpa_s * (1000000000 // self._tick_us)

    def check(self):
        """Look at all bubbles, after `Bubbles.step`."""
        bubbles = self._bubbles
        return _check(bubbles.rows, self._rows, bubbles.state, self._numbers)

    def block_backflow(self, supply_pa):
        """After `Bubbles.step`: no fill valve opens to a supply below the bubble's pressure, which would empty it."""
        if supply_pa < self._enough_pa:
            bubbles = self._bubbles
            _block_backflow(bubbles.rows, bubbles.pulses, supply_pa, self._count)

    def take_new_faults(self, bubble):
        """The fault bits of a bubble that are new since the last time."""
        at = bubble * GUARD + SEEN
        faults = self._bubbles.faults(bubble)
        new = faults & ~self._rows[at]
        self._rows[at] = faults
        return new

    def acknowledge(self, bubble):
        """The faults of this bubble are acknowledged: those that still are there are new."""
        self._rows[bubble * GUARD + SEEN] = 0
