# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""What is computed for every bubble in every tick: from sensor counts to the open times of its valves.

The controlled quantity is *air*: the pV content of bubble and line in µJ (1 µJ = 1 kPa mm³, isothermal).
Height is a single valued function of air even where pressure hardly changes with height, so `step`

- guards the limits,
- counts the air that the valves let through and corrects the count by the pressure sensor whenever no air
  flows (an observer: predict by dose, correct by measurement), through the bubble's curve, see `curve`,
- is an integer PID on the air that is missing, fed forward by the air that the moving setpoint itself needs;
  it turns air into open time by the valve's flow and adds the dead times.

A bubble where nothing is under way is *calm*: it is guarded in every tick, but measured and decided upon in every
fourth only, by the mean of four readings. Whatever asks something else of a bubble takes its calm away. A bubble
whose valve stays open for three more periods *coasts* through every second tick.

A command computed in one tick acts from the start of the next: the PWM hardware latches it there. All state is
one array of 32-bit integers, a row per bubble; the functions are viper on the device and ordinary Python
elsewhere, and compute the same integers. They allocate nothing. What docs/micropython.md says of viper's speed
decided how things are written here: two pointers first among the arguments, small offsets, signs tested as bits.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# One row: where each number of a bubble stands. The first four are its figures, in the order of `figures`. Offsets
# below 32 are cheap to reach.
ZERO = const(0)  # sensor counts at no pressure
OPENS_US = const(1)  # valve dead times
CLOSES_US = const(2)
FLOW_GAIN = const(3)  # root of pressures (8 Pa) to flow (µJ/ms), /65536
PRESSURE = const(4)  # measured, Pa gauge
ALERT = const(5)  # whether the last reading was one that may become a fault
CALM = const(6)  # whether nothing is under way
WAIT = const(7)  # readings yet to be summed before the mean is taken; -1: there is no sum
SUM = const(8)  # of pressures, Pa
BUSY = const(9)  # from the start of the period until the line is quiet, µs
AIR = const(10)  # air at the start of this period, µJ
DOSE = const(11)  # air that the period now playing brings, µJ
NEXT = const(12)  # air that the period after it will bring, µJ
TRUST = const(13)  # how many readings the estimate averages; 0: none yet
FLOW = const(14)  # flow at the last dose, µJ/ms, *16, filling or venting
INTEGRAL = const(15)  # of the error, µJ ticks
ERROR = const(16)  # last tick's, µJ
AIM = const(17)  # air of last tick's setpoint, µJ
FILL_US = const(18)  # energised in the period now playing
VENT_US = const(19)
FILL_RUN_US = const(20)  # how long the fill valve has been open at a stretch
FAULTS = const(21)
STATUS = const(22)
TARGET = const(23)  # asked, µm
# Two heights, the estimate and the setpoint. Each is followed by what its curve says of it.
HEIGHT = const(24)  # in 1/16 µm, so that averages do not stall on whole ones
SETPOINT = const(28)  # in 1/16 µm
SEGMENT = const(1)  # where its segment of the curve begins, bytes
SLOPE = const(2)  # air per height in that segment, µJ/µm, *256
MODEL = const(3)  # of the estimate: the pressure that belonged to it when it was last measured, Pa
CONTENT = const(3)  # of the setpoint: its air, µJ
START = const(32)  # where the ramp to the target began, µm
RAMPING = const(33)  # whether the setpoint is not at its target yet
COAST = const(34)  # whether the next tick goes on as this one
FIRST = const(35)  # first and last segment of its curve, bytes
LAST = const(36)
LOWEST = const(37)  # pressures of its curve, Pa
HIGHEST = const(38)
OVER = const(39)  # ticks in a row above the pressure limit
LOST = const(40)  # ticks in a row with the sensor at an end of its range
ROW = const(41)

# A knot of a curve, see `curve`.
H = const(0)  # height, 1/16 µm
A = const(1)  # air, µJ
P = const(2)  # pressure, Pa
S = const(3)  # air per height from here on, µJ/µm, *256
R = const(4)  # its reciprocal, 2^28/S
KNOT = const(5)

# The board's numbers.
N = const(0)
TICK_US = const(1)
PA_PER_COUNT = const(2)
COUNT_LOW = const(3)
COUNT_HIGH = const(4)
PRESSURE_MAX = const(5)
FILL_MAX_US = const(6)
PULSE_MIN_US = const(7)
QUIET_US = const(8)
TUBE = const(9)  # pressure lost along the tube, Pa per µJ/ms
GAIN_P = const(10)  # gains *256
GAIN_I = const(11)
GAIN_D = const(12)
DEADBAND_UM = const(13)
SETTLED_UM = const(14)
REST_UM = const(15)
SUPPLY = const(16)  # measured, Pa gauge
MODE = const(17)
RAMP_DONE = const(18)  # ticks
RAMP_TICKS = const(19)
RAMP_SHARE = const(20)  # how much of it is done, *4096
ROOT_SCALE = const(21)  # supply's absolute pressure, 8 Pa
ROOT_SHARE = const(22)  # its reciprocal, (2^30 - 1)/Pa
BOARD = const(23)

# The state: the board's numbers, then the tables of roots, the rows, the curves.
ROOTS = const(23)
STEPS = const(64)  # in each of the two tables, see `curve`
ROWS = const(153)

ATMOSPHERE = const(101325)
AIR_MAX = const(400000)  # more than any bubble of 16 mm holds: keeps every product below within 32 bits
TRUST_MAX = const(64)
TRUST_DOSED = const(16)  # left after a short dose, which is metered well
SURPRISE_UM = const(500)  # further off than metering ever is,
SURPRISE_PA = const(500)  # by more than noise: believe the sensor afresh
INTEGRAL_MAX = const(1 << 17)
READINGS_MIN = const(2)  # readings in a row that make a fault: one alone is noise
ABSENT = const(0xFFFF)  # a count that says: no chip has answered. That is no noise
SIZE_MAX = const(50000)  # µJ, more than any period brings
SUMMED = const(3)  # readings of a calm bubble that are summed; with the one after them they make a mean of four
ROOT_END = const(8191)  # the last place in a table of roots, *128

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
LEAVE = const(0xFFFF)


def flow_gain(board):
    """FLOW_GAIN of the board's restrictors."""
    # C (1e-6 dm³/(s bar)) 1e-14 SI, times 1e5 Pa (ANR) 8 Pa/(1 - b), W to µJ/ms, *65536
    return board.CONDUCTANCE * 1342 // (10 * (256 - board.CRITICAL_RATIO))


@micropython.viper
def step(s: ptr32, k: ptr32, count: ptr16, pulse: ptr16, supply: int, mode: int):
    """One tick of all bubbles: counts of their sensors in, `pulses` out, fill and vent µs of each in the next period."""
    n = k[N]
    curves = ptr32(uint(k) + 4 * (ROWS + ROW * n))
    tick = k[TICK_US]
    same = 1 if mode == k[MODE] else 0
    k[MODE] = mode
    k[SUPPLY] = supply
    k[ROOT_SCALE] = supply + ATMOSPHERE >> 3
    k[ROOT_SHARE] = 0x3FFFFFFF // (supply + ATMOSPHERE)
    if k[RAMP_DONE] != k[RAMP_TICKS]:
        k[RAMP_DONE] = k[RAMP_DONE] + 1
        k[RAMP_SHARE] = (k[RAMP_DONE] << 12) // k[RAMP_TICKS]
    i = 0
    while i < n:
        c = count[i]
        p = (c - s[ZERO]) * k[PA_PER_COUNT]
        if (c - k[COUNT_LOW] - 1 | k[COUNT_HIGH] - 1 - c | k[PRESSURE_MAX] - p) >> 31 | s[ALERT]:
            # Guard: the sensor at an end of its range, or too much pressure, now or in the tick before.
            s[ALERT] = 0
            s[CALM] = 0
            s[COAST] = 0
            s[WAIT] = -1
            if c <= k[COUNT_LOW] or c >= k[COUNT_HIGH]:
                s[ALERT] = 1
                s[LOST] = s[LOST] + 1 if c < ABSENT else READINGS_MIN
                p = s[PRESSURE]
            else:
                s[LOST] = 0
            if p > k[PRESSURE_MAX]:
                s[ALERT] = 1
                s[OVER] = s[OVER] + 1
            else:
                s[OVER] = 0
            if s[OVER] >= READINGS_MIN:
                s[FAULTS] = s[FAULTS] | OVERPRESSURE
            if s[LOST] >= READINGS_MIN:
                s[FAULTS] = s[FAULTS] | SENSOR_LOST
        s[PRESSURE] = p

        work = 1
        if s[CALM] & same:
            if s[BUSY] > 0:
                s[BUSY] = s[BUSY] - tick
                work = 0
            elif s[WAIT] > 0:
                s[WAIT] = s[WAIT] - 1
                s[SUM] = s[SUM] + p
                work = 0
        elif s[COAST] & same:
            s[COAST] = 0
            s[AIR] = s[AIR] + s[DOSE]
            s[DOSE] = s[NEXT]
            s[FILL_RUN_US] = s[FILL_RUN_US] + s[FILL_US]
            work = 0
        if work:
            air = s[AIR] + s[DOSE]
            seg = s[HEIGHT + SEGMENT]
            q = ptr32(uint(curves) + seg)
            if s[BUSY] <= 0 and s[ALERT] == 0:
                # The air that this pressure means: in the segment that contains it and is nearest to the
                # estimate's, because a bubble stays on the branch where it was.
                mean = p
                weight = 1
                if s[WAIT] == 0:
                    mean = s[SUM] + p >> 2
                    weight = 4
                s[WAIT] = -1
                if (mean - s[LOWEST] | s[HIGHEST] - mean) >> 31:
                    if mean < s[LOWEST]:
                        q = ptr32(uint(curves) + s[FIRST])
                        off = q[A] - air
                    else:
                        q = ptr32(uint(curves) + s[LAST])
                        off = q[KNOT + A] - air
                else:
                    low = seg
                    high = seg
                    turn = 0
                    while (mean - q[P]) * (q[KNOT + P] - mean) >> 31:
                        if turn:
                            turn = 0
                            if low != s[FIRST]:
                                low -= 4 * KNOT
                            q = ptr32(uint(curves) + low)
                        else:
                            turn = 1
                            if high != s[LAST]:
                                high += 4 * KNOT
                            q = ptr32(uint(curves) + high)
                    off = q[A] - air
                    rise = q[KNOT + P] - q[P]
                    if rise:
                        off += ((mean - q[P] << 12) // rise) * (q[KNOT + A] - q[A]) >> 12
                if s[STATUS] & 3:
                    trust = s[TRUST] + weight
                    if trust > TRUST_MAX:
                        trust = TRUST_MAX
                    far = s[HEIGHT + SLOPE] * SURPRISE_UM >> 8
                    q = ptr32(uint(curves) + seg)
                    rise = air - q[A]  # the pressure that the estimate means, within its segment of the tick before
                    if rise < 0:
                        rise = 0
                    if rise > q[KNOT + A] - q[A]:
                        rise = q[KNOT + A] - q[A]
                    s[HEIGHT + MODEL] = q[P] + (((rise << 12) // (q[KNOT + A] - q[A])) * (q[KNOT + P] - q[P]) >> 12)
                    if (far - off | far + off) >> 31 and (
                        mean - s[HEIGHT + MODEL] > SURPRISE_PA or mean - s[HEIGHT + MODEL] < 0 - SURPRISE_PA
                    ):
                        trust = 1
                        weight = 1
                    s[TRUST] = trust
                    air += (off * weight + (trust >> 1)) // trust  # rounded: a bias would add up over so many
                else:  # the vent is open: nothing is counted, the sensor alone says what there is
                    q = ptr32(uint(curves) + seg)
                    air += off
                if air < 0:
                    air = 0
            if air > AIR_MAX:
                air = AIR_MAX
            s[AIR] = air

            # The height that this air means.
            off = air - q[A]
            while (off | q[KNOT + A] - air) >> 31:  # it is in another segment
                if off < 0:
                    if seg == s[FIRST]:
                        off = 0
                        break
                    seg -= 4 * KNOT
                else:
                    if seg == s[LAST]:
                        off = q[KNOT + A] - q[A]
                        break
                    seg += 4 * KNOT
                q = ptr32(uint(curves) + seg)
                off = air - q[A]
            height = q[H] + (off * q[R] >> 16)
            s[HEIGHT] = height
            s[HEIGHT + SEGMENT] = seg
            s[HEIGHT + SLOPE] = q[S]

            # The air of the setpoint.
            if s[RAMPING]:
                if k[RAMP_DONE] == k[RAMP_TICKS]:
                    s[RAMPING] = 0
                height = (s[START] << 4) + ((s[TARGET] - s[START]) * k[RAMP_SHARE] >> 8)
                s[SETPOINT] = height
                seg = s[SETPOINT + SEGMENT]
                q = ptr32(uint(curves) + seg)
                off = height - q[H]
                while (off | q[KNOT + H] - height) >> 31:
                    if off < 0:
                        if seg == s[FIRST]:
                            off = 0
                            break
                        seg -= 4 * KNOT
                    else:
                        if seg == s[LAST]:
                            off = q[KNOT + H] - q[H]
                            break
                        seg += 4 * KNOT
                    q = ptr32(uint(curves) + seg)
                    off = height - q[H]
                s[SETPOINT + SEGMENT] = seg
                s[SETPOINT + SLOPE] = q[S]
                s[SETPOINT + CONTENT] = q[A] + (off * q[S] >> 12)

            filled = s[FILL_US]
            vented = s[VENT_US]
            energised = filled + vented
            dose = s[NEXT]
            s[DOSE] = dose
            tail = 0
            if energised:
                s[BUSY] = energised + s[CLOSES_US] + k[QUIET_US] - tick
                s[FILL_RUN_US] = s[FILL_RUN_US] + filled if filled == tick else 0
                if s[FILL_RUN_US] >= k[FILL_MAX_US]:
                    s[FAULTS] = s[FAULTS] | VALVE_TIME
                if energised == tick:
                    # It closes its dead time into the next period: that air comes anyway. /16000 by multiplication.
                    tail = (s[FLOW] * s[CLOSES_US] >> 12) * 16777 >> 16
                    if vented:
                        tail = 0 - tail
            else:
                s[FILL_RUN_US] = 0
                if s[BUSY] > 0:
                    s[BUSY] = s[BUSY] - tick

            fill = 0
            vent = 0
            aim = s[SETPOINT + CONTENT]
            rest = 0
            if s[FAULTS]:
                s[STATUS] = FAULT
                rest = 1
            elif mode == VENTED or (mode == ACTIVE and s[SETPOINT] <= k[REST_UM] + k[DEADBAND_UM] << 4):
                s[STATUS] = RESTING
                rest = 1
            if rest:
                s[CALM] = 1 if vented == tick and s[RAMPING] == 0 else 0
                s[NEXT] = 0
                s[BUSY] = 0
                s[AIM] = air
                s[ERROR] = 0
                s[INTEGRAL] = 0
                s[TRUST] = 0
                s[FLOW] = 0
                vent = tick
            elif mode != ACTIVE:
                s[STATUS] = STOPPED
                s[CALM] = 0 if energised or dose else 1
                s[NEXT] = tail
                s[AIM] = air
                s[ERROR] = 0
            else:
                off = s[TARGET] - (s[HEIGHT] >> 4)
                s[STATUS] = MOVING
                if s[RAMPING] == 0 and s[TRUST] > 1 and (k[SETTLED_UM] - off | k[SETTLED_UM] + off) >> 31 == 0:
                    s[STATUS] = SETTLED
                ahead = aim - s[AIM]  # what the setpoint's own motion asks for: feed-forward
                error = s[AIM] - air - dose - tail
                s[AIM] = aim
                s[NEXT] = tail
                s[CALM] = 0
                band = s[SETPOINT + SLOPE] * k[DEADBAND_UM] >> 8
                if ahead | (band - error | band + error) >> 31 == 0:
                    if (energised | dose | s[RAMPING]) == 0:
                        s[CALM] = 1
                elif s[TRUST]:
                    integral = s[INTEGRAL] + error
                    want = ahead + (error * k[GAIN_P] + integral * k[GAIN_I] + (error - s[ERROR]) * k[GAIN_D] >> 8)

                    # Flow of a restrictor below its critical ratio (ISO 6358), from the tables of its root.
                    lost = k[TUBE] * s[FLOW] >> 4 if s[BUSY] <= 0 else 0
                    size = want
                    if want > 0:
                        opened = 1 if filled == tick else 0
                        at = (k[SUPPLY] - p - lost) * k[ROOT_SHARE] >> 16
                        scale = k[ROOT_SCALE]
                    else:
                        size = 0 - want
                        opened = 1 if vented == tick else 0
                        at = p - lost >> 3
                        scale = 1 << 14
                    if at >> 13:
                        at = ROOT_END if at > 0 else 0
                    part = at & 127
                    at >>= 7
                    if want <= 0:
                        at += STEPS + 1
                    q = ptr32(uint(k) + 4 * at)
                    root = scale * (q[ROOTS] + ((q[ROOTS + 1] - q[ROOTS]) * part >> 7)) >> 14
                    flow = (root * s[FLOW_GAIN] >> 12) + 1
                    s[FLOW] = flow

                    # Air to time. A valve that is still open needs no opening and its closing is in the tail.
                    if size > SIZE_MAX:
                        size = SIZE_MAX
                    delay = 0 if opened else s[OPENS_US] - s[CLOSES_US]
                    width = size * 16000 // flow + delay
                    shortest = k[PULSE_MIN_US]
                    if opened and width > 3 * tick and s[FILL_RUN_US] + 2 * tick < k[FILL_MAX_US]:
                        s[COAST] = 1
                    if width > tick - shortest:  # too short a gap to close in
                        width = tick if width > tick - (shortest >> 1) else tick - shortest
                    elif opened == 0 and width < shortest:  # of open time, half of that or more is worth a pulse
                        width = shortest if 2 * (width - delay) >= shortest - delay else 0
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
                            moved -= s[CLOSES_US]
                            s[TRUST] = 1
                        elif s[TRUST] > TRUST_DOSED:
                            s[TRUST] = TRUST_DOSED
                        moved = (flow * moved >> 12) * 16777 >> 16
                        if want > 0:
                            fill = width
                            s[NEXT] = tail + moved
                        else:
                            vent = width
                            s[NEXT] = tail - moved
                s[ERROR] = error
            if s[CALM] and s[BUSY] <= 0:
                s[WAIT] = SUMMED
                s[SUM] = 0
            s[FILL_US] = fill
            s[VENT_US] = vent
        pulse[2 * i] = s[FILL_US]
        pulse[2 * i + 1] = s[VENT_US]
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
        s[CALM] = 0
        s[COAST] = 0
        s[RAMPING] = 1
        s = ptr32(uint(s) + 4 * ROW)
        at += 1
        n -= 1


@micropython.viper
def aim_on(s: ptr32, w: ptr16, at: int, n: int, from_height: int, rest: int):
    """Begin the way to the targets (µm) in `w[at:]`; a bubble whose target is LEAVE keeps the one that it has.

    It begins where the setpoint is, so that a ramp follows another without a step, or at the estimated height.
    """
    while n > 0:
        s[START] = (s[HEIGHT] if from_height else s[SETPOINT]) >> 4
        target = w[at]
        if target != LEAVE:
            s[TARGET] = target if target > rest else rest  # lower would be the end of the ramp before its time
        s[CALM] = 0
        s[COAST] = 0
        s[RAMPING] = 1
        s = ptr32(uint(s) + 4 * ROW)
        at += 1
        n -= 1


@micropython.viper
def unsettled(s: ptr32, n: int, tolerance: int, rest: int) -> int:
    """The bubbles, as bits, whose height is further than `tolerance` µm from the target, or not yet measured."""
    bits = 0
    bit = 1
    while n > 0:
        target = s[TARGET]
        off = (target if target > rest else rest) - (s[HEIGHT] >> 4)
        known = 1 if s[TRUST] > 1 or s[STATUS] == RESTING else 0
        if off > tolerance or off < 0 - tolerance or known == 0 or s[FAULTS]:
            bits |= bit
        bit <<= 1
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1
    return bits


@micropython.viper
def hold(s: ptr32, n: int):
    """Want every bubble where it is."""
    while n > 0:
        s[START] = s[HEIGHT] >> 4
        s[TARGET] = s[START]
        s[CALM] = 0
        s[COAST] = 0
        s[RAMPING] = 1
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1


@micropython.viper
def rest(s: ptr32, height: int, n: int):
    """Want every bubble at `height` µm, at once."""
    while n > 0:
        s[START] = height
        s[TARGET] = height
        s[CALM] = 0
        s[COAST] = 0
        s[RAMPING] = 1
        s = ptr32(uint(s) + 4 * ROW)
        n -= 1


@micropython.viper
def forget(s: ptr32, n: int):
    """Forget all faults, but not what is about to become one."""
    while n > 0:
        s[FAULTS] = 0
        s[CALM] = 0
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
