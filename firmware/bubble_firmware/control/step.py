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

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.statuses: used
# [constants] bubble_protocol.schema.faults: used
_SENSOR_ZERO = const(0)
_OPENS_US = const(1)
_CLOSES_US = const(2)
_FLOW_GAIN = const(3)
_PRESSURE = const(4)
_SUSPECT = const(5)
_QUIESCENT = const(6)
_DECIMATION_LEFT = const(7)
_DECIMATION_SUM = const(8)
_SETTLING_US = const(9)
_AIR = const(10)
_AIR_IN_FLIGHT = const(11)
_AIR_QUEUED = const(12)
_SAMPLES = const(13)
_FLOW = const(14)
_INTEGRAL = const(15)
_ERROR = const(16)
_PREVIOUS_SETPOINT_AIR = const(17)
_FILL_US = const(18)
_VENT_US = const(19)
_FILL_RUN_US = const(20)
_FAULTS = const(21)
_STATUS = const(22)
_TARGET = const(23)
_HEIGHT = const(24)
_HEIGHT_SEGMENT = const(25)
_HEIGHT_SLOPE = const(26)
_MODEL_PRESSURE = const(27)
_SETPOINT = const(28)
_SETPOINT_SEGMENT = const(29)
_SETPOINT_SLOPE = const(30)
_SETPOINT_AIR = const(31)
_RAMP_START = const(32)
_RAMPING = const(33)
_HOLD_OUTPUT = const(34)
_FIRST_SEGMENT = const(35)
_LAST_SEGMENT = const(36)
_LOWEST_PRESSURE = const(37)
_HIGHEST_PRESSURE = const(38)
_OVERPRESSURE_TICKS = const(39)
_LOST_TICKS = const(40)
_ROW_WORDS = const(41)
_KNOT_HEIGHT = const(0)
_KNOT_AIR = const(1)
_KNOT_PRESSURE = const(2)
_KNOT_SLOPE = const(3)
_KNOT_RECIPROCAL = const(4)
_KNOT_WORDS = const(5)
_BUBBLE_COUNT = const(0)
_TICK_US = const(1)
_PA_PER_COUNT = const(2)
_COUNT_LOW = const(3)
_COUNT_HIGH = const(4)
_PRESSURE_MAX = const(5)
_FILL_MAX_US = const(6)
_PULSE_MIN_US = const(7)
_QUIET_US = const(8)
_TUBE_PA = const(9)
_GAIN_P = const(10)
_GAIN_I = const(11)
_GAIN_D = const(12)
_DEADBAND_UM = const(13)
_SETTLED_UM = const(14)
_REST_UM = const(15)
_SUPPLY_PA = const(16)
_CONTROL_MODE = const(17)
_RAMP_DONE = const(18)
_RAMP_TICKS = const(19)
_RAMP_SHARE = const(20)
_ROOT_SCALE = const(21)
_ROOT_RECIPROCAL = const(22)
_ROOTS = const(23)
_ROOT_STEPS = const(64)
_ROWS = const(153)
_VENT = const(0)
_FOLLOW = const(1)
_RESTING = const(0)
_MOVING = const(1)
_SETTLED = const(2)
_STOPPED = const(3)
_FAULT = const(4)
_OVERPRESSURE = const(1)
_SENSOR_LOST = const(2)
_VALVE_TIME = const(4)
# [end of constants]

_ATMOSPHERE = const(101325)
_AIR_MAX = const(400000)  # more than any bubble of 16 mm holds: keeps every product below within 32 bits
_SAMPLES_MAX = const(64)
_SAMPLES_DOSED = const(16)  # left after a short dose, which is metered well
_INNOVATION_UM = const(500)  # further off than metering ever is,
_INNOVATION_PA = const(500)  # by more than noise: believe the sensor afresh
_INTEGRAL_MAX = const(1 << 17)
_READINGS_MIN = const(2)  # readings in a row that make a fault: one alone is noise
_ABSENT = const(0xFFFF)  # a count that says: no chip has answered. That is no noise
_DOSE_MAX = const(50000)  # µJ, more than any period brings
_DECIMATION = const(3)  # readings of a calm bubble that are summed; with the one after them they make a mean of four
_ROOT_END = const(8191)  # the last place in a table of roots, *128


@micropython.viper
def step(row: ptr32, board: ptr32, count: ptr16, pulse: ptr16, supply: int, mode: int):
    """One tick of all bubbles: counts of their sensors in, `pulses` out, fill and vent µs of each in the next period."""
    n = board[_BUBBLE_COUNT]
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * n))
    tick = board[_TICK_US]
    same = 1 if mode == board[_CONTROL_MODE] else 0
    board[_CONTROL_MODE] = mode
    board[_SUPPLY_PA] = supply
    board[_ROOT_SCALE] = supply + _ATMOSPHERE >> 3
    board[_ROOT_RECIPROCAL] = 0x3FFFFFFF // (supply + _ATMOSPHERE)
    if board[_RAMP_DONE] != board[_RAMP_TICKS]:
        board[_RAMP_DONE] = board[_RAMP_DONE] + 1
        board[_RAMP_SHARE] = (board[_RAMP_DONE] << 12) // board[_RAMP_TICKS]
    i = 0
    while i < n:
        c = count[i]
        p = (c - row[_SENSOR_ZERO]) * board[_PA_PER_COUNT]
        if (c - board[_COUNT_LOW] - 1 | board[_COUNT_HIGH] - 1 - c | board[_PRESSURE_MAX] - p) >> 31 | row[_SUSPECT]:
            # Guard: the sensor at an end of its range, or too much pressure, now or in the tick before.
            row[_SUSPECT] = 0
            row[_QUIESCENT] = 0
            row[_HOLD_OUTPUT] = 0
            row[_DECIMATION_LEFT] = -1
            if c <= board[_COUNT_LOW] or c >= board[_COUNT_HIGH]:
                row[_SUSPECT] = 1
                row[_LOST_TICKS] = row[_LOST_TICKS] + 1 if c < _ABSENT else _READINGS_MIN
                p = row[_PRESSURE]
            else:
                row[_LOST_TICKS] = 0
            if p > board[_PRESSURE_MAX]:
                row[_SUSPECT] = 1
                row[_OVERPRESSURE_TICKS] = row[_OVERPRESSURE_TICKS] + 1
            else:
                row[_OVERPRESSURE_TICKS] = 0
            if row[_OVERPRESSURE_TICKS] >= _READINGS_MIN:
                row[_FAULTS] = row[_FAULTS] | _OVERPRESSURE
            if row[_LOST_TICKS] >= _READINGS_MIN:
                row[_FAULTS] = row[_FAULTS] | _SENSOR_LOST
        row[_PRESSURE] = p

        work = 1
        if row[_QUIESCENT] & same:
            if row[_SETTLING_US] > 0:
                row[_SETTLING_US] = row[_SETTLING_US] - tick
                work = 0
            elif row[_DECIMATION_LEFT] > 0:
                row[_DECIMATION_LEFT] = row[_DECIMATION_LEFT] - 1
                row[_DECIMATION_SUM] = row[_DECIMATION_SUM] + p
                work = 0
        elif row[_HOLD_OUTPUT] & same:
            row[_HOLD_OUTPUT] = 0
            row[_AIR] = row[_AIR] + row[_AIR_IN_FLIGHT]
            row[_AIR_IN_FLIGHT] = row[_AIR_QUEUED]
            row[_FILL_RUN_US] = row[_FILL_RUN_US] + row[_FILL_US]
            work = 0
        if work:
            air = row[_AIR] + row[_AIR_IN_FLIGHT]
            seg = row[_HEIGHT_SEGMENT]
            knot = ptr32(uint(curves) + seg)
            if row[_SETTLING_US] <= 0 and row[_SUSPECT] == 0:
                # The air that this pressure means: in the segment that contains it and is nearest to the
                # estimate's, because a bubble stays on the branch where it was.
                mean = p
                weight = 1
                if row[_DECIMATION_LEFT] == 0:
                    mean = row[_DECIMATION_SUM] + p >> 2
                    weight = 4
                row[_DECIMATION_LEFT] = -1
                if (mean - row[_LOWEST_PRESSURE] | row[_HIGHEST_PRESSURE] - mean) >> 31:
                    if mean < row[_LOWEST_PRESSURE]:
                        knot = ptr32(uint(curves) + row[_FIRST_SEGMENT])
                        off = knot[_KNOT_AIR] - air
                    else:
                        knot = ptr32(uint(curves) + row[_LAST_SEGMENT])
                        off = knot[_KNOT_WORDS + _KNOT_AIR] - air
                else:
                    low = seg
                    high = seg
                    turn = 0
                    while (mean - knot[_KNOT_PRESSURE]) * (knot[_KNOT_WORDS + _KNOT_PRESSURE] - mean) >> 31:
                        if turn:
                            turn = 0
                            if low != row[_FIRST_SEGMENT]:
                                low -= 4 * _KNOT_WORDS
                            knot = ptr32(uint(curves) + low)
                        else:
                            turn = 1
                            if high != row[_LAST_SEGMENT]:
                                high += 4 * _KNOT_WORDS
                            knot = ptr32(uint(curves) + high)
                    off = knot[_KNOT_AIR] - air
                    rise = knot[_KNOT_WORDS + _KNOT_PRESSURE] - knot[_KNOT_PRESSURE]
                    if rise:
                        off += ((mean - knot[_KNOT_PRESSURE] << 12) // rise) * (
                            knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]
                        ) >> 12
                if row[_STATUS] & 3:
                    trust = row[_SAMPLES] + weight
                    if trust > _SAMPLES_MAX:
                        trust = _SAMPLES_MAX
                    far = row[_HEIGHT_SLOPE] * _INNOVATION_UM >> 8
                    knot = ptr32(uint(curves) + seg)
                    rise = (
                        air - knot[_KNOT_AIR]
                    )  # the pressure that the estimate means, within its segment of the tick before
                    if rise < 0:
                        rise = 0
                    if rise > knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]:
                        rise = knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]
                    row[_MODEL_PRESSURE] = knot[_KNOT_PRESSURE] + (
                        ((rise << 12) // (knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]))
                        * (knot[_KNOT_WORDS + _KNOT_PRESSURE] - knot[_KNOT_PRESSURE])
                        >> 12
                    )
                    if (far - off | far + off) >> 31 and (
                        mean - row[_MODEL_PRESSURE] > _INNOVATION_PA or mean - row[_MODEL_PRESSURE] < 0 - _INNOVATION_PA
                    ):
                        trust = 1
                        weight = 1
                    row[_SAMPLES] = trust
                    air += (off * weight + (trust >> 1)) // trust  # rounded: a bias would add up over so many
                else:  # the vent is open: nothing is counted, the sensor alone says what there is
                    knot = ptr32(uint(curves) + seg)
                    air += off
                if air < 0:
                    air = 0
            if air > _AIR_MAX:
                air = _AIR_MAX
            row[_AIR] = air

            # The height that this air means.
            off = air - knot[_KNOT_AIR]
            while (off | knot[_KNOT_WORDS + _KNOT_AIR] - air) >> 31:  # it is in another segment
                if off < 0:
                    if seg == row[_FIRST_SEGMENT]:
                        off = 0
                        break
                    seg -= 4 * _KNOT_WORDS
                else:
                    if seg == row[_LAST_SEGMENT]:
                        off = knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]
                        break
                    seg += 4 * _KNOT_WORDS
                knot = ptr32(uint(curves) + seg)
                off = air - knot[_KNOT_AIR]
            height = knot[_KNOT_HEIGHT] + (off * knot[_KNOT_RECIPROCAL] >> 16)
            row[_HEIGHT] = height
            row[_HEIGHT_SEGMENT] = seg
            row[_HEIGHT_SLOPE] = knot[_KNOT_SLOPE]

            # The air of the setpoint.
            if row[_RAMPING]:
                if board[_RAMP_DONE] == board[_RAMP_TICKS]:
                    row[_RAMPING] = 0
                height = (row[_RAMP_START] << 4) + ((row[_TARGET] - row[_RAMP_START]) * board[_RAMP_SHARE] >> 8)
                row[_SETPOINT] = height
                seg = row[_SETPOINT_SEGMENT]
                knot = ptr32(uint(curves) + seg)
                off = height - knot[_KNOT_HEIGHT]
                while (off | knot[_KNOT_WORDS + _KNOT_HEIGHT] - height) >> 31:
                    if off < 0:
                        if seg == row[_FIRST_SEGMENT]:
                            off = 0
                            break
                        seg -= 4 * _KNOT_WORDS
                    else:
                        if seg == row[_LAST_SEGMENT]:
                            off = knot[_KNOT_WORDS + _KNOT_HEIGHT] - knot[_KNOT_HEIGHT]
                            break
                        seg += 4 * _KNOT_WORDS
                    knot = ptr32(uint(curves) + seg)
                    off = height - knot[_KNOT_HEIGHT]
                row[_SETPOINT_SEGMENT] = seg
                row[_SETPOINT_SLOPE] = knot[_KNOT_SLOPE]
                row[_SETPOINT_AIR] = knot[_KNOT_AIR] + (off * knot[_KNOT_SLOPE] >> 12)

            filled = row[_FILL_US]
            vented = row[_VENT_US]
            energised = filled + vented
            dose = row[_AIR_QUEUED]
            row[_AIR_IN_FLIGHT] = dose
            tail = 0
            if energised:
                row[_SETTLING_US] = energised + row[_CLOSES_US] + board[_QUIET_US] - tick
                row[_FILL_RUN_US] = row[_FILL_RUN_US] + filled if filled == tick else 0
                if row[_FILL_RUN_US] >= board[_FILL_MAX_US]:
                    row[_FAULTS] = row[_FAULTS] | _VALVE_TIME
                if energised == tick:
                    # It closes its dead time into the next period: that air comes anyway. /16000 by multiplication.
                    tail = (row[_FLOW] * row[_CLOSES_US] >> 12) * 16777 >> 16
                    if vented:
                        tail = 0 - tail
            else:
                row[_FILL_RUN_US] = 0
                if row[_SETTLING_US] > 0:
                    row[_SETTLING_US] = row[_SETTLING_US] - tick

            fill = 0
            vent = 0
            aim = row[_SETPOINT_AIR]
            rest = 0
            if row[_FAULTS]:
                row[_STATUS] = _FAULT
                rest = 1
            elif mode == _VENT or (mode == _FOLLOW and row[_SETPOINT] <= board[_REST_UM] + board[_DEADBAND_UM] << 4):
                row[_STATUS] = _RESTING
                rest = 1
            if rest:
                row[_QUIESCENT] = 1 if vented == tick and row[_RAMPING] == 0 else 0
                row[_AIR_QUEUED] = 0
                row[_SETTLING_US] = 0
                row[_PREVIOUS_SETPOINT_AIR] = air
                row[_ERROR] = 0
                row[_INTEGRAL] = 0
                row[_SAMPLES] = 0
                row[_FLOW] = 0
                vent = tick
            elif mode != _FOLLOW:
                row[_STATUS] = _STOPPED
                row[_QUIESCENT] = 0 if energised or dose else 1
                row[_AIR_QUEUED] = tail
                row[_PREVIOUS_SETPOINT_AIR] = air
                row[_ERROR] = 0
            else:
                off = row[_TARGET] - (row[_HEIGHT] >> 4)
                row[_STATUS] = _MOVING
                if (
                    row[_RAMPING] == 0
                    and row[_SAMPLES] > 1
                    and (board[_SETTLED_UM] - off | board[_SETTLED_UM] + off) >> 31 == 0
                ):
                    row[_STATUS] = _SETTLED
                ahead = aim - row[_PREVIOUS_SETPOINT_AIR]  # what the setpoint's own motion asks for: feed-forward
                error = row[_PREVIOUS_SETPOINT_AIR] - air - dose - tail
                row[_PREVIOUS_SETPOINT_AIR] = aim
                row[_AIR_QUEUED] = tail
                row[_QUIESCENT] = 0
                band = row[_SETPOINT_SLOPE] * board[_DEADBAND_UM] >> 8
                if ahead | (band - error | band + error) >> 31 == 0:
                    if (energised | dose | row[_RAMPING]) == 0:
                        row[_QUIESCENT] = 1
                elif row[_SAMPLES]:
                    integral = row[_INTEGRAL] + error
                    want = ahead + (
                        error * board[_GAIN_P] + integral * board[_GAIN_I] + (error - row[_ERROR]) * board[_GAIN_D] >> 8
                    )

                    # Flow of a restrictor below its critical ratio (ISO 6358), from the tables of its root.
                    lost = board[_TUBE_PA] * row[_FLOW] >> 4 if row[_SETTLING_US] <= 0 else 0
                    size = want
                    if want > 0:
                        opened = 1 if filled == tick else 0
                        at = (board[_SUPPLY_PA] - p - lost) * board[_ROOT_RECIPROCAL] >> 16
                        scale = board[_ROOT_SCALE]
                    else:
                        size = 0 - want
                        opened = 1 if vented == tick else 0
                        at = p - lost >> 3
                        scale = 1 << 14
                    if at >> 13:
                        at = _ROOT_END if at > 0 else 0
                    part = at & 127
                    at >>= 7
                    if want <= 0:
                        at += _ROOT_STEPS + 1
                    knot = ptr32(uint(board) + 4 * at)
                    root = scale * (knot[_ROOTS] + ((knot[_ROOTS + 1] - knot[_ROOTS]) * part >> 7)) >> 14
                    flow = (root * row[_FLOW_GAIN] >> 12) + 1
                    row[_FLOW] = flow

                    # Air to time. A valve that is still open needs no opening and its closing is in the tail.
                    if size > _DOSE_MAX:
                        size = _DOSE_MAX
                    delay = 0 if opened else row[_OPENS_US] - row[_CLOSES_US]
                    width = size * 16000 // flow + delay
                    shortest = board[_PULSE_MIN_US]
                    if opened and width > 3 * tick and row[_FILL_RUN_US] + 2 * tick < board[_FILL_MAX_US]:
                        row[_HOLD_OUTPUT] = 1
                    if width > tick - shortest:  # too short a gap to close in
                        width = tick if width > tick - (shortest >> 1) else tick - shortest
                    elif opened == 0 and width < shortest:  # of open time, half of that or more is worth a pulse
                        width = shortest if 2 * (width - delay) >= shortest - delay else 0
                    if width < tick:
                        # Only while not saturated: the integral must not wind up.
                        if integral > _INTEGRAL_MAX:
                            integral = _INTEGRAL_MAX
                        if integral < 0 - _INTEGRAL_MAX:
                            integral = 0 - _INTEGRAL_MAX
                        row[_INTEGRAL] = integral
                    if width:
                        moved = width - delay
                        if width == tick:
                            moved -= row[_CLOSES_US]
                            row[_SAMPLES] = 1
                        elif row[_SAMPLES] > _SAMPLES_DOSED:
                            row[_SAMPLES] = _SAMPLES_DOSED
                        moved = (flow * moved >> 12) * 16777 >> 16
                        if want > 0:
                            fill = width
                            row[_AIR_QUEUED] = tail + moved
                        else:
                            vent = width
                            row[_AIR_QUEUED] = tail - moved
                row[_ERROR] = error
            if row[_QUIESCENT] and row[_SETTLING_US] <= 0:
                row[_DECIMATION_LEFT] = _DECIMATION
                row[_DECIMATION_SUM] = 0
            row[_FILL_US] = fill
            row[_VENT_US] = vent
        pulse[2 * i] = row[_FILL_US]
        pulse[2 * i + 1] = row[_VENT_US]
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
