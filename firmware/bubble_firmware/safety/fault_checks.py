# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""Watches every bubble for what control cannot mend, and for how long it has been under pressure.

`FaultMonitor.check` runs the three checks in every tick after `Bubbles.step`, on the same rows. They set fault bits, and a
bubble that has one is isolated in the same tick, whatever control has decided. docs/safety.md has thresholds and times:

1. pressures: a *sensor* has noise, so one that always says the same is not read; the *budget* of pressure and time; and
   a *vented* line must lose its pressure.
2. air: the *air balance*. Control adds what the valves have brought and then moves the sum to what the sensor says. What
   is taken away in this way is a deficit, what is added a surplus: two leaky buckets collect the residuals. A bubble to
   which air is *delivered* must get some pressure.
3. lines: an *open* valve must show the tube's loss of pressure, a *closed* line must keep its pressure.

What is watched but not controlled stands in rows of its own, see `watch_layout`. Nothing is allocated.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_firmware.safety.watch_layout: used
# [constants] bubble_protocol.schema.statuses: used
# [constants] bubble_protocol.schema.faults: LEAK NO_AIR VALVE_STUCK SENSOR_STUCK BUDGET
_FILL_OPENS_US = const(1)
_FILL_CLOSES_US = const(2)
_PRESSURE = const(10)
_QUIESCENT = const(12)
_SETTLING_US = const(15)
_AIR = const(16)
_AIR_IN_FLIGHT = const(17)
_FILL_FLOW = const(18)
_VENT_FLOW = const(19)
_FILL_US = const(20)
_VENT_US = const(21)
_STATUS = const(25)
_HEIGHT_SEGMENT = const(27)
_AIR_METERED = const(35)
_FAULTS = const(36)
_LOST_TICKS = const(47)
_ROW_WORDS = const(70)
_KNOT_PRESSURE = const(2)
_KNOT_WORDS = const(6)
_BUBBLE_COUNT = const(0)
_TICK_US = const(1)
_TUBE_PA = const(9)
_RAMP_DONE = const(16)
_RAMP_TICKS = const(17)
_ROWS = const(157)
_READINGS_MIN = const(2)
_NEW_FAULT = const(1)
_MOVING_BUBBLE = const(2)
_PRESSED_BUBBLE = const(4)
_OVERFILLED_BUBBLE = const(8)
_FROZEN_TICKS = const(0)
_FALL_PA = const(1)
_BUDGET_USED = const(2)
_BUDGET_SPENT = const(3)
_STALL_PA = const(4)
_STALL_TICKS = const(5)
_INFLOW = const(6)
_RESIDUAL_DEFICIT = const(7)
_RESIDUAL_SURPLUS = const(8)
_DELIVERED = const(9)
_VENTED = const(10)
_DELIVERED_FLAT = const(11)
_DROPPED = const(12)
_LOW_PA = const(13)
_HIGH_PA = const(14)
_OPEN_TICKS = const(15)
_NO_FLOW_TICKS = const(16)
_CLOSED_PA = const(17)
_CLOSED_TICKS = const(18)
_CLOSED_OFF_TICKS = const(19)
_LOGGED_FAULTS = const(20)
_PREVIOUS_PA = const(21)
_PREVIOUS_AIR = const(22)
_PREVIOUS_STATUS = const(23)
_PREVIOUS_IN_FLIGHT = const(24)
_PREVIOUS_SETTLING_US = const(25)
_PREVIOUS_FLOW = const(26)
_PREVIOUS_FILL_US = const(27)
_PREVIOUS_VENT_US = const(28)
_EMPTYING_TICKS = const(29)
_MOVED_PA = const(30)
_WATCH_WORDS = const(31)
_LOSS_MAX = const(0)
_FROZEN_MAX = const(1)
_CLOSED_WINDOW = const(2)
_STALL_MAX = const(3)
_FLOW_DUE = const(4)
_NO_FLOW_MAX = const(5)
_BUDGET_FREE_PA = const(6)
_BUDGET_MAX = const(7)
_SETTLE_TICKS = const(-2)
_MOVING = const(1)
_FAULT = const(4)
_LEAK = const(8)
_NO_AIR = const(16)
_VALVE_STUCK = const(32)
_SENSOR_STUCK = const(64)
_BUDGET = const(128)
# [end of constants]

_DEFICIT_MAX = const(80000)  # µJ
_SURPLUS_MAX = const(90000)
_CLOSED_WITHIN_PA = const(700)  # a closed line keeps its pressure within, and a share of it: neighbours move
_INFLATED_PA = const(8000)  # which 4 mJ bring about
_FLAT_MAX = const(12000)  # µJ
_DROP_PA = const(10000)
_UNSURE_US = const(600)  # that a valve may be open less than is known
_NO_PA = const(1500)  # as good as nothing
_FLAT_PA = const(1000)  # below it a vented bubble is flat
_VENTED_PA = const(3000)  # below it a vented line need not fall
_STALL_FALL_PA = const(1000)  # by which it must fall otherwise
_OVERFILLED_PA = const(12000)  # 5.8 mm: more in a vented bubble, and the supply is shut down for all
_HIGH_AND_VENTED_PA = const(30000)  # 13 mm: too high to ask whether it gets air or only keeps it
_EMPTY_AFTER = const(3)  # times STALL_MAX, 0.9 s: an open vent takes half of that to empty the greatest bubble


@micropython.viper
def check_pressures(row: ptr32, watch: ptr32, limits: ptr32, board: ptr32) -> int:
    """Sensor, budget and vented lines of all bubbles; whether one moves, has pressure or is overfilled."""
    found = _MOVING_BUBBLE if board[_RAMP_DONE] < board[_RAMP_TICKS] else 0
    n = board[_BUBBLE_COUNT]
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * n))
    while n > 0:
        pressure = row[_PRESSURE]
        faults = row[_FAULTS]
        if watch[_PREVIOUS_AIR] < 0:
            watch[_STALL_PA] = pressure
            watch[_PREVIOUS_AIR] = row[_AIR]

        # A sensor has noise.
        fall = watch[_PREVIOUS_PA] - pressure
        watch[_FALL_PA] = fall
        if fall or row[_LOST_TICKS]:
            watch[_FROZEN_TICKS] = 0
            watch[_PREVIOUS_PA] = pressure
        else:
            watch[_FROZEN_TICKS] = watch[_FROZEN_TICKS] + 1
            if watch[_FROZEN_TICKS] >= limits[_FROZEN_MAX]:
                faults |= _SENSOR_STUCK

        # The budget: what is above the threshold adds up, what is below recovers.
        used = watch[_BUDGET_USED] + pressure - limits[_BUDGET_FREE_PA]
        used &= ~(used >> 31)
        if used > limits[_BUDGET_MAX]:
            used = limits[_BUDGET_MAX] + 1
            watch[_BUDGET_SPENT] = 1
        watch[_BUDGET_USED] = used
        if watch[_BUDGET_SPENT]:
            if used < limits[_BUDGET_MAX] >> 1:
                watch[_BUDGET_SPENT] = 0
            else:
                faults |= _BUDGET

        if watch[_PREVIOUS_STATUS] & 3:  # under control
            found |= _PRESSED_BUBBLE
            if watch[_PREVIOUS_STATUS] == _MOVING:
                found |= _MOVING_BUBBLE
            watch[_STALL_PA] = pressure
            watch[_STALL_TICKS] = 0
            watch[_EMPTYING_TICKS] = 0
        else:
            # Vented: the pressure falls, or is gone.
            watch[_LOW_PA] = pressure
            watch[_HIGH_PA] = pressure
            if pressure > _FLAT_PA:
                found |= _PRESSED_BUBBLE
            if pressure < _VENTED_PA or pressure < watch[_STALL_PA] - _STALL_FALL_PA:
                watch[_STALL_PA] = pressure
                watch[_STALL_TICKS] = 0
                if pressure < _VENTED_PA and faults == 0:
                    watch[_INFLOW] = 0
            elif row[_LOST_TICKS] == 0:
                # On its plateau a soft bubble empties without losing pressure: one that had the air that is left would have less.
                knot = ptr32(uint(curves) + row[_HEIGHT_SEGMENT])
                least = knot[_KNOT_PRESSURE]
                if least > knot[_KNOT_WORDS + _KNOT_PRESSURE]:
                    least = knot[_KNOT_WORDS + _KNOT_PRESSURE]
                if pressure > watch[_STALL_PA] + _STALL_FALL_PA:
                    watch[_INFLOW] = 1
                    least = 0
                if pressure > least or pressure > _OVERFILLED_PA:
                    watch[_STALL_TICKS] = watch[_STALL_TICKS] + 1
                    if watch[_STALL_TICKS] >= limits[_STALL_MAX]:
                        faults |= _VALVE_STUCK
                        if watch[_INFLOW] and pressure > _OVERFILLED_PA:
                            found |= _OVERFILLED_BUBBLE

            # One that is not empty in time gets air. A high one may only keep its own: the supply is shut down for it, too.
            if pressure <= _OVERFILLED_PA or row[_LOST_TICKS]:
                watch[_EMPTYING_TICKS] = 0
            else:
                watch[_EMPTYING_TICKS] = watch[_EMPTYING_TICKS] + 1
                overdue = watch[_EMPTYING_TICKS] - _EMPTY_AFTER * limits[_STALL_MAX]
                if overdue >= 0 and (pressure > _HIGH_AND_VENTED_PA or faults & _VALVE_STUCK == 0):
                    watch[_INFLOW] = 1
                    faults |= _VALVE_STUCK
                    found |= _OVERFILLED_BUBBLE
        row[_FAULTS] = faults
        n -= 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        watch = ptr32(uint(watch) + 4 * _WATCH_WORDS)
    return found


@micropython.viper
def check_air(row: ptr32, watch: ptr32, limits: ptr32, board: ptr32):
    """The air balance of all bubbles under control, and whether what is delivered brings pressure."""
    tick = board[_TICK_US]
    n = board[_BUBBLE_COUNT]
    while n > 0:
        if watch[_PREVIOUS_STATUS] & 3 and row[_LOST_TICKS] == 0:
            faults = row[_FAULTS]
            residual = row[_AIR] - watch[_PREVIOUS_AIR] - row[_AIR_METERED]
            delivered = 0
            # Where nothing has come and nothing is counted, the balance stays as it is.
            if (
                residual
                | watch[_PREVIOUS_FILL_US]
                | watch[_RESIDUAL_DEFICIT]
                | watch[_RESIDUAL_SURPLUS]
                | watch[_DELIVERED] >> 4
            ):
                # For sure: dead times differ, so a valve may be open for less than is known.
                open_us = watch[_PREVIOUS_FILL_US]
                if open_us and (open_us < tick or watch[_OPEN_TICKS] == 0):
                    open_us -= row[_FILL_OPENS_US] - row[_FILL_CLOSES_US] + _UNSURE_US
                delivered = watch[_PREVIOUS_FLOW] * open_us // 16000 if open_us > 0 else 0

                # The deficit is at most what has come in for sure: the rest is bad metering.
                deficit = 0 - residual
                if deficit > 0:
                    if deficit > watch[_DELIVERED]:
                        deficit = watch[_DELIVERED]
                    watch[_DELIVERED] = watch[_DELIVERED] - deficit
                deficit += watch[_RESIDUAL_DEFICIT] - limits[_LOSS_MAX]
                watch[_RESIDUAL_DEFICIT] = deficit if deficit > 0 else 0
                if watch[_PREVIOUS_SETTLING_US] <= 0:  # control moves its estimate over many readings, and so do we
                    watch[_DELIVERED] = watch[_DELIVERED] - (watch[_DELIVERED] >> 4)
                watch[_DELIVERED] = watch[_DELIVERED] + delivered
                surplus = watch[_RESIDUAL_SURPLUS] + residual - limits[_LOSS_MAX]
                if surplus <= 0:
                    surplus = 0
                    watch[_VENTED] = 0
                elif watch[_PREVIOUS_IN_FLIGHT] < 0:
                    watch[_VENTED] = watch[_VENTED] - watch[_PREVIOUS_IN_FLIGHT]
                watch[_RESIDUAL_SURPLUS] = surplus
                if deficit > _DEFICIT_MAX:
                    faults |= _LEAK
                if surplus > _SURPLUS_MAX:
                    faults |= _VALVE_STUCK
                    if surplus > watch[_VENTED] + _SURPLUS_MAX // 4:  # else it may be that nothing was let out
                        watch[_INFLOW] = 1

            if row[_PRESSURE] >= _INFLATED_PA:
                watch[_DROPPED] = 0
                watch[_DELIVERED_FLAT] = 0
            else:
                # No valve empties a bubble in a tick.
                if watch[_DROPPED]:
                    faults |= _LEAK
                elif watch[_FALL_PA] > _DROP_PA:
                    watch[_DROPPED] = 1
                # Fed, nothing let out, and still without pressure? What now begins to flow counts from the next tick on.
                if watch[_PREVIOUS_VENT_US]:
                    watch[_DELIVERED_FLAT] = 0
                else:
                    if watch[_DELIVERED_FLAT] > _FLAT_MAX:
                        faults |= _LEAK if row[_PRESSURE] > _NO_PA else _NO_AIR
                    watch[_DELIVERED_FLAT] = watch[_DELIVERED_FLAT] + delivered
            row[_FAULTS] = faults
        n -= 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        watch = ptr32(uint(watch) + 4 * _WATCH_WORDS)


@micropython.viper
def check_lines(row: ptr32, watch: ptr32, limits: ptr32, board: ptr32, pulses: ptr16) -> int:
    """Flow through open valves and pressure of closed lines of all bubbles; then what the next tick compares with.

    Last, so every bubble with a fault is isolated in the `pulses` of this tick. Returns whether a fault is new.
    """
    found = 0
    tick = board[_TICK_US]
    i = 0
    while i < board[_BUBBLE_COUNT]:
        pressure = row[_PRESSURE]
        faults = row[_FAULTS]
        if watch[_PREVIOUS_STATUS] & 3 and row[_LOST_TICKS] == 0:
            quiet = 1 if watch[_PREVIOUS_SETTLING_US] <= 0 else 0

            # Open: the tube's loss of pressure shows, this way or the other.
            if quiet or pressure < watch[_LOW_PA]:
                watch[_LOW_PA] = pressure
            if quiet or pressure > watch[_HIGH_PA]:
                watch[_HIGH_PA] = pressure
            if watch[_PREVIOUS_FILL_US] == tick or watch[_PREVIOUS_VENT_US] == tick:
                watch[_OPEN_TICKS] = watch[_OPEN_TICKS] + 1
                if watch[_OPEN_TICKS] > limits[_FLOW_DUE]:
                    loss = pressure - watch[_LOW_PA] if watch[_PREVIOUS_FILL_US] else watch[_HIGH_PA] - pressure
                    if loss < (board[_TUBE_PA] * watch[_PREVIOUS_FLOW] >> 4) // 3:
                        watch[_NO_FLOW_TICKS] = watch[_NO_FLOW_TICKS] + 1
                        if watch[_NO_FLOW_TICKS] >= limits[_NO_FLOW_MAX]:
                            faults |= _NO_AIR if watch[_PREVIOUS_FILL_US] else _VALVE_STUCK
                    else:
                        watch[_NO_FLOW_TICKS] = 0
            else:
                watch[_OPEN_TICKS] = 0
                watch[_NO_FLOW_TICKS] = 0

            # Closed: the pressure stays.
            if quiet == 0 or watch[_PREVIOUS_IN_FLIGHT] != 0:
                watch[_CLOSED_TICKS] = _SETTLE_TICKS
            else:
                closed = watch[_CLOSED_TICKS]
                if closed <= 0 or closed >= limits[_CLOSED_WINDOW]:
                    watch[_MOVED_PA] = watch[_MOVED_PA] + pressure - watch[_CLOSED_PA] if closed <= 0 else 0
                    watch[_CLOSED_PA] = pressure
                    watch[_CLOSED_OFF_TICKS] = 0
                    closed &= closed >> 31  # not above 0
                watch[_CLOSED_TICKS] = closed + 1
                change = pressure - watch[_CLOSED_PA]
                # Rubber that was filled quickly relaxes, and what was let out recovers, most of it at once.
                moved = watch[_MOVED_PA]
                relaxed = watch[_CLOSED_PA] + (moved & ~(moved >> 31)) >> 5
                recovered = (watch[_CLOSED_PA] >> 6) - ((moved & moved >> 31) >> 4)
                within = _CLOSED_WITHIN_PA + (relaxed if change < 0 else recovered)
                if change > within or change < 0 - within:
                    watch[_CLOSED_OFF_TICKS] = watch[_CLOSED_OFF_TICKS] + 1
                    if watch[_CLOSED_OFF_TICKS] >= _READINGS_MIN:
                        if change < 0:
                            faults |= _LEAK
                        else:
                            faults |= _VALVE_STUCK
                            watch[_INFLOW] = 1
                else:
                    watch[_CLOSED_OFF_TICKS] = 0

        if faults:
            row[_FAULTS] = faults
            row[_STATUS] = _FAULT
            row[_QUIESCENT] = 0  # control is to look at it in the next tick
            row[_FILL_US] = 0
            row[_VENT_US] = tick
            pulses[2 * i] = 0
            pulses[2 * i + 1] = tick
        watch[_PREVIOUS_AIR] = row[_AIR]
        if watch[_PREVIOUS_STATUS] != row[_STATUS]:
            watch[_PREVIOUS_STATUS] = row[_STATUS]
            if row[_STATUS] & 3 == 0:  # what only matters to a bubble under control begins anew
                watch[_RESIDUAL_DEFICIT] = 0
                watch[_RESIDUAL_SURPLUS] = 0
                watch[_OPEN_TICKS] = 0
                watch[_DELIVERED_FLAT] = 0
                watch[_DELIVERED] = 0
                watch[_VENTED] = 0
                watch[_DROPPED] = 0
                watch[_CLOSED_TICKS] = _SETTLE_TICKS
                watch[_MOVED_PA] = watch[_CLOSED_PA]  # from no pressure
        watch[_PREVIOUS_IN_FLIGHT] = row[_AIR_IN_FLIGHT]
        watch[_PREVIOUS_SETTLING_US] = row[_SETTLING_US]
        watch[_PREVIOUS_FLOW] = row[_FILL_FLOW] if row[_FILL_US] else row[_VENT_FLOW]
        watch[_PREVIOUS_FILL_US] = row[_FILL_US]
        watch[_PREVIOUS_VENT_US] = row[_VENT_US]
        watch[_LOGGED_FAULTS] = watch[_LOGGED_FAULTS] & faults
        if watch[_LOGGED_FAULTS] != faults:
            found = _NEW_FAULT
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        watch = ptr32(uint(watch) + 4 * _WATCH_WORDS)
    return found


@micropython.viper
def block_backflow(row: ptr32, pulses: ptr16, supply: int, n: int):
    """Keep the fill valve of every bubble shut whose pressure is above the supply's, which would empty it."""
    i = 0
    while i < n:
        if pulses[2 * i] and supply < row[_PRESSURE]:
            pulses[2 * i] = 0
            row[_FILL_US] = 0
            row[_QUIESCENT] = 0
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)


@micropython.viper
def open_vents(row: ptr32, pulses: ptr16, tick: int, n: int):
    """Close every fill valve and open every vent valve in the period that `pulses` are of."""
    i = 0
    while i < n:
        row[_QUIESCENT] = 0
        row[_FILL_US] = 0
        row[_VENT_US] = tick
        pulses[2 * i] = 0
        pulses[2 * i + 1] = tick
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
