"""What is computed for every bubble in every tick: from sensor counts to the open times of its valves.

The controlled quantity is *air*: the pV content of bubble and line in µJ (1 µJ = 1 kPa mm³, isothermal).
Height is a single valued function of air even where pressure hardly changes with height, so

- `estimate` counts the air that the valves let through and corrects the count by the pressure sensor
  whenever no air flows (an observer: predict by dose, correct by measurement),
- `weigh` turns heights into pressure and air through the bubble's table,
- `control` guards the limits and is an integer PID on the air that is missing, fed forward by the air that
  the moving setpoint itself needs; it turns air into open time by the valve's flow and adds the dead times.

A command computed in one tick acts from the start of the next: the PWM hardware latches it there. All
state is one array of 32-bit integers, a row per bubble; the functions are viper on the device and
ordinary Python elsewhere, and compute the same integers. They allocate nothing.
"""

from array import array

from bubble_firmware.table import KNOTS_MAX
from bubble_protocol.portable import const, micropython, ptr16, ptr32

# One row: where each number of a bubble stands.
_ZERO = const(0)  # sensor counts at no pressure
_OPENS_US = const(1)  # valve dead times
_CLOSES_US = const(2)
_FLOW_GAIN = const(3)  # root of pressures (8 Pa) to flow (µJ/ms), /65536
_KNOTS = const(4)  # knots of its table
_PRESSURE = const(5)  # measured, Pa gauge
_TARGET = const(6)  # asked, µm
_START = const(7)  # where the ramp to the target began, µm
_AIR = const(8)  # air at the start of this period, µJ
_DOSE = const(9)  # air that the period now playing brings, µJ
_NEXT = const(10)  # air that the period after it will bring, µJ
_BUSY = const(11)  # from the start of the period until the line is quiet, µs
_TRUST = const(12)  # how many measurements the estimate averages; 0: none yet
_ROOT = const(13)  # root of pressures at the last dose, 8 Pa
_FLOW = const(14)  # flow at the last dose, µJ/ms, *16, filling or venting
_INTEGRAL = const(15)  # of the error, µJ ticks
_ERROR = const(16)  # last tick's, µJ
_AIM = const(17)  # air of last tick's setpoint, µJ
_FILL_US = const(18)  # energised in the period now playing
_VENT_US = const(19)
_FILL_RUN_US = const(20)  # how long the fill valve has been open at a stretch
_OVER = const(21)  # ticks in a row above the pressure limit
_LOST = const(22)  # ticks in a row with the sensor at an end of its range
_FAULTS = const(23)
_STATUS = const(24)
# Two heights are weighed: the estimate and the setpoint. Each is followed by what its table says of it.
_HEIGHT = const(25)  # in 1/16 µm, so that averages do not stall on whole ones
_SETPOINT = const(31)  # in 1/16 µm
_SEGMENT = const(1)  # index of its table segment
_MODEL = const(2)  # pressure, Pa
_CONTENT = const(3)  # air, µJ
_SLOPE = const(4)  # air per height, µJ/µm, *256
_WEIGHED = const(5)  # the height that these belong to
_ROW = const(37)

# The board's numbers.
_N = const(0)
_TICK_US = const(1)
_PA_PER_COUNT = const(2)
_COUNT_LOW = const(3)
_COUNT_HIGH = const(4)
_DEAD_VOLUME = const(5)  # 1/64 mm³
_REST_UM = const(6)
_PRESSURE_MAX = const(7)
_FILL_MAX_US = const(8)
_PULSE_MIN_US = const(9)
_QUIET_US = const(10)
_CRITICAL = const(11)  # critical pressure ratio, *256
_TUBE = const(12)  # pressure lost along the tube, Pa per µJ/ms
_GAIN_P = const(13)  # gains *256
_GAIN_I = const(14)
_GAIN_D = const(15)
_DEADBAND_UM = const(16)
_SETTLED_UM = const(17)
_KNOT_STRIDE = const(18)  # words between two bubbles' tables
_SUPPLY = const(19)  # measured, Pa gauge
_MODE = const(20)
_RAMP_DONE = const(21)  # ticks
_RAMP_TICKS = const(22)
_BOARD = const(23)

_ATMOSPHERE = const(101325)
_AIR_MAX = const(400000)  # more than any bubble of 16 mm holds: keeps every product below within 32 bits
_TRUST_MAX = const(16)
_TRUST_DOSED = const(4)  # left after a short dose
_SURPRISE_UM = const(500)  # further off than metering ever is,
_SURPRISE_PA = const(500)  # by more than noise: believe the sensor afresh
_INTEGRAL_MAX = const(1 << 17)
_ROW_MIN = const(2)  # readings in a row that make a fault: one alone is noise
_STEP_MAX = const(16000)  # 1/16 µm: 1 mm, far more than one period moves a bubble
_NEAR = const(320)  # 1/16 µm: 20 µm, so near to the height last weighed its tangent is good to 0.1 µm
_STEEP_MAX = const(60000)  # Pa/mm
_SIZE_MAX = const(50000)  # µJ, more than any period brings
_SLOPE_MIN = const(256)

# From the schema; a test compares them.
_VENTED = const(0)
_ACTIVE = const(1)
_RESTING = const(0)
_MOVING = const(1)
_SETTLED = const(2)
_STOPPED = const(3)
_FAULT = const(4)
_OVERPRESSURE = const(1)
_SENSOR_LOST = const(2)
_VALVE_TIME = const(4)


@micropython.viper
def estimate(rows, board, counts, knots):
    """Read the sensors; bring each bubble's air and height up to the start of this period."""
    s = ptr32(rows)
    k = ptr32(board)
    count = ptr16(counts)
    knot = ptr16(knots)
    n = k[_N]
    i = 0
    at = 0
    while i < n:
        c = count[i]
        lost = 1 if c <= k[_COUNT_LOW] or c >= k[_COUNT_HIGH] else 0
        if lost:
            s[at + _LOST] = s[at + _LOST] + 1
        else:
            s[at + _LOST] = 0
            s[at + _PRESSURE] = (c - s[at + _ZERO]) * k[_PA_PER_COUNT]
        p = s[at + _PRESSURE]
        air = s[at + _AIR] + s[at + _DOSE]
        slope = s[at + _HEIGHT + _SLOPE]
        open_vent = 1 if s[at + _STATUS] == _RESTING or s[at + _STATUS] == _FAULT else 0
        if lost == 0 and (open_vent or s[at + _BUSY] <= 0):
            # The height that holds this pressure: in the segment that contains it and is nearest to the
            # estimate's, because a bubble stays on the branch where it was. No segment: beyond an end.
            begin = i * k[_KNOT_STRIDE]
            end = begin + 2 * (s[at + _KNOTS] - 1)
            low = begin + 2 * s[at + _HEIGHT + _SEGMENT]
            high = low
            found = -1
            while found < 0 and (low >= begin or high < end):
                if low >= begin:
                    if (knot[low + 1] <= p and p <= knot[low + 3]) or (knot[low + 3] <= p and p <= knot[low + 1]):
                        found = low
                    low -= 2
                if found < 0 and high < end:
                    if (knot[high + 1] <= p and p <= knot[high + 3]) or (knot[high + 3] <= p and p <= knot[high + 1]):
                        found = high
                    high += 2
            if found < 0:
                measured = knot[end] if p > 0 else knot[begin]
            else:
                measured = knot[found]
                rise = knot[found + 3] - knot[found + 1]
                if rise != 0:
                    measured += (p - knot[found + 1]) * (knot[found + 2] - knot[found]) // rise
            off = measured - (s[at + _HEIGHT + _WEIGHED] >> 4)
            trust = s[at + _TRUST] + 1
            if open_vent:
                trust = 0
            elif (off > _SURPRISE_UM or off < 0 - _SURPRISE_UM) and (
                p - s[at + _HEIGHT + _MODEL] > _SURPRISE_PA or p - s[at + _HEIGHT + _MODEL] < 0 - _SURPRISE_PA
            ):
                trust = 1
            elif trust > _TRUST_MAX:
                trust = _TRUST_MAX
            s[at + _TRUST] = trust
            air += (s[at + _HEIGHT + _CONTENT] + (off * slope >> 8) - air) // (4 if trust == 0 else trust)
        if air < 0:
            air = 0
        if air > _AIR_MAX:
            air = _AIR_MAX
        s[at + _AIR] = air
        # The height that this air means, along the tangent at the height last weighed.
        step = (air - s[at + _HEIGHT + _CONTENT] << 12) // slope
        if step > _STEP_MAX:
            step = _STEP_MAX
        if step < 0 - _STEP_MAX:
            step = 0 - _STEP_MAX
        s[at + _HEIGHT] = s[at + _HEIGHT + _WEIGHED] + step
        i += 1
        at += _ROW


@micropython.viper
def weigh(rows, board, knots):
    """Move the setpoints on; then pressure, air and air per height of every estimate and setpoint, by the bubble's table.

    An estimate is weighed again when it has left the neighbourhood of where it was weighed last.
    """
    s = ptr32(rows)
    k = ptr32(board)
    knot = ptr16(knots)
    n = k[_N]
    dead = k[_DEAD_VOLUME]
    moving = 0
    if k[_RAMP_DONE] < k[_RAMP_TICKS]:
        k[_RAMP_DONE] = k[_RAMP_DONE] + 1
        moving = 1
    i = 0
    row = 0
    while i < n:
        if moving:
            reach = s[row + _TARGET] - s[row + _START]
            s[row + _SETPOINT] = (s[row + _START] + reach * k[_RAMP_DONE] // k[_RAMP_TICKS]) << 4
        at = row + _HEIGHT
        while at <= row + _SETPOINT:
            off = s[at] - s[at + _WEIGHED]
            if off > _NEAR or off < 0 - _NEAR or (at != row + _HEIGHT and off != 0):
                begin = i * k[_KNOT_STRIDE]
                end = begin + 2 * (s[row + _KNOTS] - 1)
                if s[at] < knot[begin] << 4:
                    s[at] = knot[begin] << 4
                if s[at] > knot[end] << 4:
                    s[at] = knot[end] << 4
                h = s[at] >> 4
                seg = begin + 2 * s[at + _SEGMENT]
                while h < knot[seg]:
                    seg -= 2
                while seg < end - 2 and h >= knot[seg + 2]:
                    seg += 2
                s[at + _SEGMENT] = (seg - begin) >> 1
                p0 = knot[seg + 1]
                rise = knot[seg + 3] - p0
                run = knot[seg + 2] - knot[seg]
                p = p0 + rise * (h - knot[seg]) // run
                steep = rise * 1000 // run  # Pa/mm
                if steep > _STEEP_MAX:
                    steep = _STEEP_MAX
                if steep < 0 - _STEEP_MAX:
                    steep = 0 - _STEEP_MAX
                # Sphere of diameter h: V = pi/6 h³, dV/dh = pi/2 h². Volume in 1/64 mm³, pressure in 16 Pa.
                square = h * h >> 12
                volume = ((square * h >> 12) * 2303 >> 12) + dead
                p16 = p + _ATMOSPHERE >> 4
                s[at + _MODEL] = p
                s[at + _CONTENT] = p16 * volume // 4000
                # d(pV)/dh = p dV/dh + V dp/dh, *256; kept positive, as it is for every bubble that holds air
                slope = ((p16 * square >> 12) * 7074 >> 16) + (((volume >> 4) * steep >> 6) * 268 >> 16)
                s[at + _SLOPE] = slope if slope > _SLOPE_MIN else _SLOPE_MIN
                s[at + _WEIGHED] = s[at]
            at += _SETPOINT - _HEIGHT
        i += 1
        row += _ROW


@micropython.viper
def control(rows, board, pulses):
    """Guard, then decide what each valve does in the next period: `pulses` holds fill and vent µs of every bubble."""
    s = ptr32(rows)
    k = ptr32(board)
    pulse = ptr16(pulses)
    n = k[_N]
    tick = k[_TICK_US]
    i = 0
    at = 0
    while i < n:
        p = s[at + _PRESSURE]
        filled = s[at + _FILL_US]
        vented = s[at + _VENT_US]
        energised = filled + vented
        opens = s[at + _OPENS_US]
        closes = s[at + _CLOSES_US]
        s[at + _DOSE] = s[at + _NEXT]

        # Guard. A fault stays until it is cleared.
        s[at + _OVER] = s[at + _OVER] + 1 if p > k[_PRESSURE_MAX] else 0
        s[at + _FILL_RUN_US] = s[at + _FILL_RUN_US] + filled if filled == tick else 0
        if s[at + _OVER] >= _ROW_MIN:
            s[at + _FAULTS] = s[at + _FAULTS] | _OVERPRESSURE
        if s[at + _LOST] >= _ROW_MIN:
            s[at + _FAULTS] = s[at + _FAULTS] | _SENSOR_LOST
        if s[at + _FILL_RUN_US] >= k[_FILL_MAX_US]:
            s[at + _FAULTS] = s[at + _FAULTS] | _VALVE_TIME

        # When will the line be quiet, seen from the start of the next period?
        if energised:
            s[at + _BUSY] = energised + closes + k[_QUIET_US] - tick
        elif s[at + _BUSY] > 0:
            s[at + _BUSY] = s[at + _BUSY] - tick

        # A valve energised to the end of this period closes its dead time into the next: that air comes anyway.
        tail = 0
        if energised == tick:
            tail = s[at + _FLOW] * closes // 16000
            if vented:
                tail = 0 - tail

        fill = 0
        vent = 0
        dose = tail
        aim = s[at + _SETPOINT + _CONTENT]
        ahead = aim - s[at + _AIM]  # what the setpoint's own motion asks for: feed-forward
        error = s[at + _AIM] - s[at + _AIR] - s[at + _DOSE] - tail
        resting = 1 if s[at + _SETPOINT] <= (k[_REST_UM] + k[_DEADBAND_UM]) << 4 else 0
        if s[at + _FAULTS] or k[_MODE] == _VENTED or (k[_MODE] == _ACTIVE and resting):
            s[at + _STATUS] = _FAULT if s[at + _FAULTS] else _RESTING
            vent = tick
            dose = 0
            aim = s[at + _AIR]
            error = 0
            s[at + _INTEGRAL] = 0
            s[at + _TRUST] = 0
            s[at + _FLOW] = 0
        elif k[_MODE] != _ACTIVE:
            s[at + _STATUS] = _STOPPED
            aim = s[at + _AIR]
            error = 0
        else:
            off = s[at + _TARGET] - (s[at + _HEIGHT] >> 4)
            still = 1 if k[_RAMP_DONE] == k[_RAMP_TICKS] else 0
            near = 1 if off <= k[_SETTLED_UM] and off >= 0 - k[_SETTLED_UM] else 0
            s[at + _STATUS] = _SETTLED if near and still and s[at + _TRUST] > 1 else _MOVING
            band = s[at + _SETPOINT + _SLOPE] * k[_DEADBAND_UM] >> 8
            enough = 1 if ahead == 0 and error <= band and error >= 0 - band else 0
            if s[at + _TRUST] and enough == 0:
                integral = s[at + _INTEGRAL] + error
                change = error - s[at + _ERROR]
                want = ahead + (error * k[_GAIN_P] + integral * k[_GAIN_I] + change * k[_GAIN_D] >> 8)
                fills = 1 if want > 0 else 0
                size = want if fills else 0 - want

                # Flow of a restrictor below its critical ratio (ISO 6358): C p1 sqrt(1 - ((p2/p1 - b)/(1 - b))²)
                # = C/(1 - b) sqrt((p1 - p2) (p2 + (1 - 2b) p1)). The root by Newton from the last one.
                lost = k[_TUBE] * s[at + _FLOW] >> 4 if s[at + _BUSY] <= 0 else 0
                if fills:
                    p1 = k[_SUPPLY] + _ATMOSPHERE
                    p2 = p + lost + _ATMOSPHERE
                else:
                    p1 = p - lost + _ATMOSPHERE
                    p2 = _ATMOSPHERE
                square = 0
                if p1 > p2:
                    square = (p1 - p2 >> 3) * ((p1 * (256 - 2 * k[_CRITICAL]) >> 8) + p2 >> 3)
                root = s[at + _ROOT]
                root = (root + square // root >> 1) + 1
                root = (root + square // root >> 1) + 1
                s[at + _ROOT] = root
                flow = (root * s[at + _FLOW_GAIN] >> 12) + 1
                s[at + _FLOW] = flow

                # Air to time. A valve that is still open needs no opening and its closing is in the tail.
                if size > _SIZE_MAX:
                    size = _SIZE_MAX
                opened = 1 if (fills and filled == tick) or (fills == 0 and vented == tick) else 0
                delay = 0 if opened else opens - closes
                width = size * 16000 // flow + delay
                if width > tick - k[_PULSE_MIN_US]:  # too short a gap to close in
                    width = tick if width > tick - (k[_PULSE_MIN_US] >> 1) else tick - k[_PULSE_MIN_US]
                elif opened == 0 and width < k[_PULSE_MIN_US]:
                    shortest = k[_PULSE_MIN_US] - delay  # of open time; half of it or more is worth a pulse
                    width = k[_PULSE_MIN_US] if 2 * (width - delay) >= shortest else 0
                if width < tick:
                    # Only while not saturated: the integral must not wind up.
                    if integral > _INTEGRAL_MAX:
                        integral = _INTEGRAL_MAX
                    if integral < 0 - _INTEGRAL_MAX:
                        integral = 0 - _INTEGRAL_MAX
                    s[at + _INTEGRAL] = integral
                if width:
                    moved = width - delay
                    if width == tick:
                        moved -= closes
                    moved = flow * moved // 16000
                    if fills:
                        fill = width
                        dose += moved
                    else:
                        vent = width
                        dose -= moved
                    if width == tick:
                        s[at + _TRUST] = 1
                    elif s[at + _TRUST] > _TRUST_DOSED:
                        s[at + _TRUST] = _TRUST_DOSED
        s[at + _AIM] = aim
        s[at + _ERROR] = error
        s[at + _NEXT] = dose
        s[at + _FILL_US] = fill
        s[at + _VENT_US] = vent
        pulse[2 * i] = fill
        pulse[2 * i + 1] = vent
        i += 1
        at += _ROW


@micropython.viper
def gather(rows, n: int, values, at: int):
    """Copy what STATE and TELEMETRY say of every bubble to `values[at:]`, in the schema's order."""
    s = ptr32(rows)
    v = ptr32(values)
    row = 0
    while n > 0:
        v[at] = s[row + _HEIGHT] >> 4
        v[at + 1] = s[row + _PRESSURE]
        v[at + 2] = s[row + _TARGET]
        v[at + 3] = s[row + _STATUS]
        v[at + 4] = s[row + _FAULTS]
        at += 5
        row += _ROW
        n -= 1


class Bubbles:
    """All bubbles of a board: `pulses` is what `tick` decides, the rest is asked and told by methods."""

    def __init__(self, board, tables):
        n = board.BUBBLES
        self.count = n
        self.pulses = array("H", bytearray(4 * n))
        self._rows = array("i", bytearray(4 * _ROW * n))
        self._board = array("i", bytearray(4 * _BOARD))
        self._tables = tables
        k = self._board
        k[_N] = n
        k[_TICK_US] = board.TICK_US
        k[_PA_PER_COUNT] = board.SENSOR_PA_PER_COUNT
        k[_COUNT_LOW] = board.COUNT_LOW
        k[_COUNT_HIGH] = board.COUNT_HIGH
        k[_DEAD_VOLUME] = 64 * board.DEAD_VOLUME_MM3
        k[_REST_UM] = board.HEIGHT_REST_UM
        k[_PRESSURE_MAX] = board.PRESSURE_MAX_PA
        k[_FILL_MAX_US] = board.FILL_MAX_US
        k[_PULSE_MIN_US] = board.PULSE_MIN_US
        k[_QUIET_US] = board.QUIET_US
        k[_CRITICAL] = board.CRITICAL_RATIO
        k[_TUBE] = board.TUBE_PA_PER_FLOW
        k[_GAIN_P] = board.GAIN_P
        k[_GAIN_I] = board.GAIN_I
        k[_GAIN_D] = board.GAIN_D
        k[_DEADBAND_UM] = board.DEADBAND_UM
        k[_SETTLED_UM] = board.SETTLED_UM
        k[_KNOT_STRIDE] = 2 * KNOTS_MAX
        k[_RAMP_DONE] = k[_RAMP_TICKS] = 1
        for at in range(0, n * _ROW, _ROW):
            row = self._rows
            row[at + _ZERO] = board.SENSOR_ZERO
            row[at + _OPENS_US] = board.VALVE_OPENS_US
            row[at + _CLOSES_US] = board.VALVE_CLOSES_US
            # C (1e-6 dm³/(s bar)) 1e-14 SI, times 1e5 Pa (ANR) 8 Pa/(1 - b), W to µJ/ms, *65536
            row[at + _FLOW_GAIN] = board.CONDUCTANCE * 1342 // (10 * (256 - board.CRITICAL_RATIO))
            row[at + _TARGET] = row[at + _START] = board.HEIGHT_REST_UM
            row[at + _HEIGHT] = row[at + _SETPOINT] = board.HEIGHT_REST_UM << 4
            row[at + _ROOT] = 10000
        self.use_tables()
        for at in range(0, n * _ROW, _ROW):
            row[at + _AIR] = row[at + _HEIGHT + _CONTENT]

    def use_tables(self):
        """Take up the tables in use, after a commit. The air stays; what height it means is found anew."""
        row = self._rows
        for i in range(self.count):
            at = i * _ROW
            row[at + _KNOTS] = self._tables.sizes[i]
            for record in (at + _HEIGHT, at + _SETPOINT):
                row[record + _SEGMENT] = 0
                row[record + _WEIGHED] = -1
        weigh(self._rows, self._board, self._tables.knots)

    def sense(self, counts, supply_pa, mode):
        """The tick's first half: sensor counts in, heights and air estimated, the setpoint moved on."""
        self._board[_SUPPLY] = supply_pa
        self._board[_MODE] = mode
        estimate(self._rows, self._board, counts, self._tables.knots)

    def decide(self, mode):
        """The tick's second half: `pulses` for the next period."""
        self._board[_MODE] = mode
        weigh(self._rows, self._board, self._tables.knots)
        control(self._rows, self._board, self.pulses)

    def show(self, values, first, ticks):
        """Ramp every bubble from where it is to the height (µm) in `values[first:]` within `ticks` ticks."""
        row = self._rows
        for i in range(self.count):
            at = i * _ROW
            row[at + _START] = row[at + _HEIGHT] >> 4
            row[at + _TARGET] = values[first + i]
        self._ramp(ticks)

    def _ramp(self, ticks):
        self._board[_RAMP_DONE] = 0
        self._board[_RAMP_TICKS] = ticks

    def hold(self):
        """Where the bubbles are is where they are wanted."""
        row = self._rows
        for i in range(self.count):
            at = i * _ROW
            row[at + _START] = row[at + _TARGET] = row[at + _HEIGHT] >> 4
        self._ramp(1)

    def rest(self):
        """No bubble is wanted higher than it is without pressure."""
        row = self._rows
        for at in range(0, self.count * _ROW, _ROW):
            row[at + _START] = row[at + _TARGET] = self._board[_REST_UM]
        self._ramp(1)

    def clear_faults(self):
        """Forget all faults; what still is wrong faults again."""
        row = self._rows
        for at in range(0, self.count * _ROW, _ROW):
            row[at + _FAULTS] = row[at + _OVER] = row[at + _LOST] = row[at + _FILL_RUN_US] = 0

    def report(self, values, at):
        """Put the repeated fields of STATE at `values[at:]`."""
        gather(self._rows, self.count, values, at)
