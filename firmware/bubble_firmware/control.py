# mypy: disable-error-code="valid-type,index,operator,arg-type"
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
ordinary Python elsewhere, and compute the same integers. They allocate nothing. The pointers come first among
their arguments because viper keeps the first three in registers.
"""

from bubble_protocol.portable import const, micropython, ptr16, ptr32, uint

# One row: where each number of a bubble stands.
ZERO = const(0)  # sensor counts at no pressure
OPENS_US = const(1)  # valve dead times
CLOSES_US = const(2)
FLOW_GAIN = const(3)  # root of pressures (8 Pa) to flow (µJ/ms), /65536
KNOTS = const(4)  # knots of its table
PRESSURE = const(5)  # measured, Pa gauge
TARGET = const(6)  # asked, µm
START = const(7)  # where the ramp to the target began, µm
AIR = const(8)  # air at the start of this period, µJ
DOSE = const(9)  # air that the period now playing brings, µJ
NEXT = const(10)  # air that the period after it will bring, µJ
BUSY = const(11)  # from the start of the period until the line is quiet, µs
TRUST = const(12)  # how many measurements the estimate averages; 0: none yet
ROOT = const(13)  # root of pressures at the last dose, 8 Pa
FLOW = const(14)  # flow at the last dose, µJ/ms, *16, filling or venting
INTEGRAL = const(15)  # of the error, µJ ticks
ERROR = const(16)  # last tick's, µJ
AIM = const(17)  # air of last tick's setpoint, µJ
FILL_US = const(18)  # energised in the period now playing
VENT_US = const(19)
FILL_RUN_US = const(20)  # how long the fill valve has been open at a stretch
OVER = const(21)  # ticks in a row above the pressure limit
LOST = const(22)  # ticks in a row with the sensor at an end of its range
FAULTS = const(23)
STATUS = const(24)
# Two heights are weighed: the estimate and the setpoint. Each is followed by what its table says of it.
HEIGHT = const(25)  # in 1/16 µm, so that averages do not stall on whole ones
SETPOINT = const(31)  # in 1/16 µm
SEGMENT = const(1)  # index of its table segment
MODEL = const(2)  # pressure, Pa
CONTENT = const(3)  # air, µJ
SLOPE = const(4)  # air per height, µJ/µm, *256
WEIGHED = const(5)  # the height that these belong to
LOWEST = const(37)  # pressures of its table, Pa
HIGHEST = const(38)
ROW = const(39)

# The board's numbers.
N = const(0)
TICK_US = const(1)
PA_PER_COUNT = const(2)
COUNT_LOW = const(3)
COUNT_HIGH = const(4)
DEAD_VOLUME = const(5)  # 1/64 mm³
REST_UM = const(6)
PRESSURE_MAX = const(7)
FILL_MAX_US = const(8)
PULSE_MIN_US = const(9)
QUIET_US = const(10)
CRITICAL = const(11)  # critical pressure ratio, *256
TUBE = const(12)  # pressure lost along the tube, Pa per µJ/ms
GAIN_P = const(13)  # gains *256
GAIN_I = const(14)
GAIN_D = const(15)
DEADBAND_UM = const(16)
SETTLED_UM = const(17)
KNOT_STRIDE = const(18)  # words between two bubbles' tables
SUPPLY = const(19)  # measured, Pa gauge
MODE = const(20)
RAMP_DONE = const(21)  # ticks
RAMP_TICKS = const(22)
BOARD = const(23)

ATMOSPHERE = const(101325)
AIR_MAX = const(400000)  # more than any bubble of 16 mm holds: keeps every product below within 32 bits
TRUST_MAX = const(64)
TRUST_DOSED = const(16)  # left after a short dose, which is metered well
SURPRISE_UM = const(500)  # further off than metering ever is,
SURPRISE_PA = const(500)  # by more than noise: believe the sensor afresh
INTEGRAL_MAX = const(1 << 17)
READINGS_MIN = const(2)  # readings in a row that make a fault: one alone is noise
ABSENT = const(0xFFFF)  # a count that says: no chip has answered. That is no noise
STEP_MAX = const(16000)  # 1/16 µm: 1 mm, far more than one period moves a bubble
NEAR = const(320)  # 1/16 µm: 20 µm, so near to the height last weighed its tangent is good to 0.1 µm
ROOT_MAX = const(20000)  # 8 Pa: more than any two readings give; from there Newton's next step is a good one
STEEP_MAX = const(50000)  # Pa/mm: more, and the slope of the air of a bubble of 16 mm is beyond 32 bits
SIZE_MAX = const(50000)  # µJ, more than any period brings
SLOPE_MIN = const(256)

# From the schema; a test compares them.
VENTED = const(0)
ACTIVE = const(1)
RESTING = const(0)
MOVING = const(1)
SETTLED = const(2)
STOPPED = const(3)
FAULT = const(4)
OVERPRESSURE = const(1)
SENSOR_LOST = const(2)
VALVE_TIME = const(4)


@micropython.viper
def estimate(s: ptr32, k: ptr32, knot: ptr16, count: ptr16, supply: int, mode: int):
    """Read the sensors; bring each bubble's air and height up to the start of this period."""
    k[SUPPLY] = supply
    k[MODE] = mode
    n = k[N]
    i = 0
    while i < n:
        c = count[i]
        lost = 1 if c <= k[COUNT_LOW] or c >= k[COUNT_HIGH] else 0
        if lost:
            s[LOST] = s[LOST] + 1 if c < ABSENT else READINGS_MIN
        else:
            s[LOST] = 0
            s[PRESSURE] = (c - s[ZERO]) * k[PA_PER_COUNT]
        p = s[PRESSURE]
        air = s[AIR] + s[DOSE]
        slope = s[HEIGHT + SLOPE]
        open_vent = 1 if s[STATUS] == RESTING or s[STATUS] == FAULT else 0
        if lost == 0 and (open_vent or s[BUSY] <= 0):
            # The height that holds this pressure: in the segment that contains it and is nearest to the
            # estimate's, because a bubble stays on the branch where it was. No segment: beyond an end.
            begin = i * k[KNOT_STRIDE]
            end = begin + 2 * (s[KNOTS] - 1)
            low = begin + 2 * s[HEIGHT + SEGMENT]
            high = low
            found = -1
            within = 1 if s[LOWEST] <= p and p <= s[HIGHEST] else 0
            while within and found < 0 and (low >= begin or high < end):
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
            off = measured - (s[HEIGHT + WEIGHED] >> 4)
            trust = s[TRUST] + 1
            if open_vent:
                trust = 0
            elif (off > SURPRISE_UM or off < 0 - SURPRISE_UM) and (
                p - s[HEIGHT + MODEL] > SURPRISE_PA or p - s[HEIGHT + MODEL] < 0 - SURPRISE_PA
            ):
                trust = 1
            elif trust > TRUST_MAX:
                trust = TRUST_MAX
            s[TRUST] = trust
            off = s[HEIGHT + CONTENT] + (off * slope >> 8) - air  # now of air
            if trust == 0:
                air += off >> 2
            else:
                air += (off + (trust >> 1)) // trust  # rounded: a bias would add up over so many
        if air < 0:
            air = 0
        if air > AIR_MAX:
            air = AIR_MAX
        s[AIR] = air
        # The height that this air means, along the tangent at the height last weighed.
        step = (air - s[HEIGHT + CONTENT] << 12) // slope
        if step > STEP_MAX:
            step = STEP_MAX
        if step < 0 - STEP_MAX:
            step = 0 - STEP_MAX
        s[HEIGHT] = s[HEIGHT + WEIGHED] + step
        i += 1
        s = ptr32(uint(s) + 4 * ROW)


@micropython.viper
def weigh(s: ptr32, k: ptr32, knot: ptr16):
    """Move the setpoints on; then pressure, air and air per height of every estimate and setpoint, by the bubble's table.

    An estimate is weighed again when it has left the neighbourhood of where it was weighed last.
    """
    n = k[N]
    dead = k[DEAD_VOLUME]
    moving = 0
    if k[RAMP_DONE] < k[RAMP_TICKS]:
        k[RAMP_DONE] = k[RAMP_DONE] + 1
        moving = 1
    i = 0
    while i < n:
        if moving:
            reach = s[TARGET] - s[START]
            s[SETPOINT] = (s[START] + reach * k[RAMP_DONE] // k[RAMP_TICKS]) << 4
        w = s
        exact = 2  # nothing to do
        off = s[HEIGHT] - s[HEIGHT + WEIGHED]
        if off > NEAR or off < 0 - NEAR or s[SETPOINT] != s[SETPOINT + WEIGHED]:
            w = ptr32(uint(s) + 4 * HEIGHT)
            exact = 0
        while exact < 2:
            off = w[0] - w[WEIGHED]
            if off > NEAR or off < 0 - NEAR or (exact and off != 0):
                begin = i * k[KNOT_STRIDE]
                end = begin + 2 * (s[KNOTS] - 1)
                if w[0] < knot[begin] << 4:
                    w[0] = knot[begin] << 4
                if w[0] > knot[end] << 4:
                    w[0] = knot[end] << 4
                h = w[0] >> 4
                seg = begin + 2 * w[SEGMENT]
                while h < knot[seg]:
                    seg -= 2
                while seg < end - 2 and h >= knot[seg + 2]:
                    seg += 2
                w[SEGMENT] = (seg - begin) >> 1
                p0 = knot[seg + 1]
                rise = knot[seg + 3] - p0
                run = knot[seg + 2] - knot[seg]
                p = p0 + rise * (h - knot[seg]) // run
                steep = rise * 1000 // run  # Pa/mm
                if steep > STEEP_MAX:
                    steep = STEEP_MAX
                if steep < 0 - STEEP_MAX:
                    steep = 0 - STEEP_MAX
                # Sphere of diameter h: V = pi/6 h³, dV/dh = pi/2 h². Volume in 1/64 mm³, pressure in 16 Pa.
                square = h * h >> 12
                volume = ((square * h >> 12) * 2303 >> 12) + dead
                p16 = p + ATMOSPHERE >> 4
                w[MODEL] = p
                w[CONTENT] = p16 * volume // 4000
                # d(pV)/dh = p dV/dh + V dp/dh, *256; kept positive, as it is for every bubble that holds air
                slope = ((p16 * square >> 12) * 7074 >> 16) + (((volume >> 4) * steep >> 6) * 268 >> 16)
                w[SLOPE] = slope if slope > SLOPE_MIN else SLOPE_MIN
                w[WEIGHED] = w[0]
            w = ptr32(uint(s) + 4 * SETPOINT)
            exact += 1
        i += 1
        s = ptr32(uint(s) + 4 * ROW)


@micropython.viper
def control(s: ptr32, k: ptr32, pulse: ptr16):
    """Guard, then decide what each valve does in the next period: `pulses` holds fill and vent µs of every bubble."""
    n = k[N]
    tick = k[TICK_US]
    i = 0
    while i < n:
        p = s[PRESSURE]
        filled = s[FILL_US]
        vented = s[VENT_US]
        energised = filled + vented
        opens = s[OPENS_US]
        closes = s[CLOSES_US]
        s[DOSE] = s[NEXT]

        # Guard. A fault stays until it is cleared.
        s[OVER] = s[OVER] + 1 if p > k[PRESSURE_MAX] else 0
        s[FILL_RUN_US] = s[FILL_RUN_US] + filled if filled == tick else 0
        if s[OVER] >= READINGS_MIN:
            s[FAULTS] = s[FAULTS] | OVERPRESSURE
        if s[LOST] >= READINGS_MIN:
            s[FAULTS] = s[FAULTS] | SENSOR_LOST
        if s[FILL_RUN_US] >= k[FILL_MAX_US]:
            s[FAULTS] = s[FAULTS] | VALVE_TIME

        # When will the line be quiet, seen from the start of the next period?
        if energised:
            s[BUSY] = energised + closes + k[QUIET_US] - tick
        elif s[BUSY] > 0:
            s[BUSY] = s[BUSY] - tick

        # A valve energised to the end of this period closes its dead time into the next: that air comes anyway.
        tail = 0
        if energised == tick:
            tail = s[FLOW] * closes // 16000
            if vented:
                tail = 0 - tail

        fill = 0
        vent = 0
        dose = tail
        aim = s[SETPOINT + CONTENT]
        ahead = aim - s[AIM]  # what the setpoint's own motion asks for: feed-forward
        error = s[AIM] - s[AIR] - s[DOSE] - tail
        resting = 1 if s[SETPOINT] <= (k[REST_UM] + k[DEADBAND_UM]) << 4 else 0
        if s[FAULTS] or k[MODE] == VENTED or (k[MODE] == ACTIVE and resting):
            s[STATUS] = FAULT if s[FAULTS] else RESTING
            vent = tick
            dose = 0
            aim = s[AIR]
            error = 0
            s[INTEGRAL] = 0
            s[TRUST] = 0
            s[FLOW] = 0
        elif k[MODE] != ACTIVE:
            s[STATUS] = STOPPED
            aim = s[AIR]
            error = 0
        else:
            off = s[TARGET] - (s[HEIGHT] >> 4)
            still = 1 if k[RAMP_DONE] == k[RAMP_TICKS] else 0
            near = 1 if off <= k[SETTLED_UM] and off >= 0 - k[SETTLED_UM] else 0
            s[STATUS] = SETTLED if near and still and s[TRUST] > 1 else MOVING
            band = s[SETPOINT + SLOPE] * k[DEADBAND_UM] >> 8
            enough = 1 if ahead == 0 and error <= band and error >= 0 - band else 0
            if s[TRUST] and enough == 0:
                integral = s[INTEGRAL] + error
                change = error - s[ERROR]
                want = ahead + (error * k[GAIN_P] + integral * k[GAIN_I] + change * k[GAIN_D] >> 8)
                fills = 1 if want > 0 else 0
                size = want if fills else 0 - want

                # Flow of a restrictor below its critical ratio (ISO 6358): C p1 sqrt(1 - ((p2/p1 - b)/(1 - b))²)
                # = C/(1 - b) sqrt((p1 - p2) (p2 + (1 - 2b) p1)). The root by Newton from the last one.
                lost = k[TUBE] * s[FLOW] >> 4 if s[BUSY] <= 0 else 0
                if fills:
                    p1 = k[SUPPLY] + ATMOSPHERE
                    p2 = p + lost + ATMOSPHERE
                else:
                    p1 = p - lost + ATMOSPHERE
                    p2 = ATMOSPHERE
                square = 0
                if p1 > p2:
                    square = (p1 - p2 >> 3) * ((p1 * (256 - 2 * k[CRITICAL]) >> 8) + p2 >> 3)
                root = s[ROOT]
                root = (root + square // root >> 1) + 1
                if root > ROOT_MAX:  # far off, as after no pressure at all
                    root = ROOT_MAX
                root = (root + square // root >> 1) + 1
                s[ROOT] = root
                flow = (root * s[FLOW_GAIN] >> 12) + 1
                s[FLOW] = flow

                # Air to time. A valve that is still open needs no opening and its closing is in the tail.
                if size > SIZE_MAX:
                    size = SIZE_MAX
                opened = 1 if (fills and filled == tick) or (fills == 0 and vented == tick) else 0
                delay = 0 if opened else opens - closes
                width = size * 16000 // flow + delay
                if width > tick - k[PULSE_MIN_US]:  # too short a gap to close in
                    width = tick if width > tick - (k[PULSE_MIN_US] >> 1) else tick - k[PULSE_MIN_US]
                elif opened == 0 and width < k[PULSE_MIN_US]:
                    shortest = k[PULSE_MIN_US] - delay  # of open time; half of it or more is worth a pulse
                    width = k[PULSE_MIN_US] if 2 * (width - delay) >= shortest else 0
                if width < tick:
                    # Only while not saturated: the integral must not wind up.
                    if integral > INTEGRAL_MAX:
                        integral = INTEGRAL_MAX
                    if integral < 0 - INTEGRAL_MAX:
                        integral = 0 - INTEGRAL_MAX
                    s[INTEGRAL] = integral
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
                        s[TRUST] = 1
                    elif s[TRUST] > TRUST_DOSED:
                        s[TRUST] = TRUST_DOSED
        s[AIM] = aim
        s[ERROR] = error
        s[NEXT] = dose
        s[FILL_US] = fill
        s[VENT_US] = vent
        pulse[2 * i] = fill
        pulse[2 * i + 1] = vent
        i += 1
        s = ptr32(uint(s) + 4 * ROW)


@micropython.viper
def gather(s: ptr32, v: ptr32, at: int, n: int):
    """Copy what STATE and TELEMETRY say of every bubble to `values[at:]`, in the schema's order."""
    while n > 0:
        v[at] = s[HEIGHT] >> 4
        v[at + 1] = s[PRESSURE]
        v[at + 2] = s[TARGET]
        v[at + 3] = s[STATUS]
        v[at + 4] = s[FAULTS]
        at += 5
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1


@micropython.viper
def pick(s: ptr32, v: ptr32, plan: ptr32, at: int, columns: int, n: int):
    """Copy the words of every row that `plan` names, shifted right by what stands 8 words after each name."""
    while n > 0:
        i = 0
        while i < columns:
            v[at] = s[plan[i]] >> plan[i + 8]
            at += 1
            i += 1
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1


@micropython.viper
def aim(s: ptr32, v: ptr32, at: int, n: int):
    """Begin every bubble's way from where it is to the height (µm) in `values[at:]`."""
    while n > 0:
        s[START] = s[HEIGHT] >> 4
        s[TARGET] = v[at]
        s = ptr32(uint(s) + 4 * ROW)
        at += 1
        n -= 1


@micropython.viper
def hold(s: ptr32, n: int):
    """Want every bubble where it is."""
    while n > 0:
        s[START] = s[HEIGHT] >> 4
        s[TARGET] = s[START]
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1


@micropython.viper
def rest(s: ptr32, height: int, n: int):
    """Want every bubble at `height` µm, at once."""
    while n > 0:
        s[START] = height
        s[TARGET] = height
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1


@micropython.viper
def forget(s: ptr32, n: int):
    """Forget all faults, but not what is about to become one."""
    while n > 0:
        s[FAULTS] = 0
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1


@micropython.viper
def first_above(v: ptr32, at: int, end: int, limit: int) -> int:
    """The index of the first of `values[at:end]` above `limit`, -1 where there is none."""
    while at < end:
        if v[at] > limit:
            return at
        at += 1
    return -1
