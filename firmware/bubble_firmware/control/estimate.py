# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""First pass over all bubbles: from sensor counts to pressure, air and height.

Air is metered: what the valves have brought in the period that ended is the time for which they were open times the mean of
the flows at its beginning and end, see `flow`. Height follows from air by the gas law: V = A/(p0 + P) - V_line. No membrane is
in it. What is known of the membrane corrects the air now and then, see `reference`.

A *quiescent* bubble has its limits looked at in every tick, but is measured and decided upon only when a mean of its quiet line
is there: of eight readings, later of 32. A *held* bubble is far from its target: its valve stays open for a period more. Whatever
asks something else of a bubble ends both. `DUE` says for the passes that follow whether it is decided upon in this tick.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.faults: used
# [constants] bubble_firmware.hal.base: ABSENT
# [constants] bubble_firmware.device_clock: LATEST
_SENSOR_ZERO = const(0)
_FILL_OPENS_US = const(1)
_FILL_CLOSES_US = const(2)
_FILL_GAIN = const(3)
_FLOW_SD = const(7)
_CURVE_SD = const(8)
_LEAK_RATE = const(9)
_PRESSURE = const(10)
_SUSPECT = const(11)
_QUIESCENT = const(12)
_READINGS = const(13)
_READINGS_SUM = const(14)
_SETTLING_US = const(15)
_AIR = const(16)
_AIR_IN_FLIGHT = const(17)
_FILL_FLOW = const(18)
_VENT_FLOW = const(19)
_FILL_US = const(20)
_FILL_FULL = const(22)
_VENT_FULL = const(23)
_DUE = const(24)
_STATUS = const(25)
_HEIGHT = const(26)
_HEIGHT_SEGMENT = const(27)
_SETPOINT_AIR = const(28)
_FILL_OPEN_US = const(31)
_VENT_OPEN_US = const(32)
_AIR_METERED = const(35)
_FAULTS = const(36)
_FILL_RUN_US = const(43)
_FIRST_SEGMENT = const(44)
_LAST_SEGMENT = const(45)
_OVERPRESSURE_TICKS = const(46)
_LOST_TICKS = const(47)
_EMPTY_TICKS = const(48)
_AIR_SD = const(49)
_CURVE_ERROR = const(50)
_CURVE_ERROR_SD = const(51)
_CORRELATION = const(52)
_HEIGHT_SD = const(53)
_PEAK = const(58)
_QUIET_PRESSURE = const(59)
_FAR_TICKS = const(60)
_LEAKED = const(61)
_REZERO = const(62)
_LEAK_TICK = const(63)
_FAR = const(64)
_READINGS_BITS = const(69)
_ROW_WORDS = const(70)
_KNOT_HEIGHT = const(0)
_KNOT_VOLUME = const(1)
_KNOT_PRESSURE = const(2)
_KNOT_RECIPROCAL = const(4)
_KNOT_WORDS = const(6)
_BUBBLE_COUNT = const(0)
_TICK_US = const(1)
_PA_PER_COUNT = const(2)
_COUNT_LOW = const(3)
_COUNT_HIGH = const(4)
_PRESSURE_MAX = const(5)
_TUBE_PA = const(9)
_REST_UM = const(14)
_CONTROL_MODE = const(15)
_TICK = const(19)
_ATMOSPHERE_PA = const(23)
_LEAK_SHARE = const(26)
_ROOTS = const(27)
_ROOT_STEPS = const(64)
_ROWS = const(157)
_READINGS_MIN = const(2)
_READINGS_BITS_FIRST = const(3)
_READINGS_BITS_NEXT = const(5)
_AIR_SD_MAX = const(60000)
_EMPTY_PA = const(1000)
_EMPTY_US = const(15000)
_HELD = const(2)
_RESTART = const(256)
_ROOT_END = const(8191)
_OVERPRESSURE = const(1)
_SENSOR_LOST = const(2)
_ABSENT = const(65535)
_LATEST = const(1073741823)
# [end of constants]

_AIR_MAX = const(400000)  # µJ, more than any bubble of 16 mm holds: keeps every product of control within 32 bits
_AIR_SD_EMPTY = const(200)  # µJ
_ABSOLUTE_MIN = const(3000)  # 16 Pa
_FAR_PA = const(10000)
_FAR_MOVING_PA = const(15000)  # with what tube, rubber and steep curve add while it moves
_LOW_UM = const(2500)  # above rest: lower, viscous rubber that is filled adds 2 Pa for each µm more
_FAR_MAX = const(3)  # ticks
_AIR_SD_FAR = const(20000)


@micropython.viper
def estimate(row: ptr32, board: ptr32, counts: ptr16, supply: int, mode: int) -> int:
    """Take up this tick's `counts`: pressures, faults of the sensors, and air and height of every bubble that is due.

    `supply` is in Pa. `mode` is what control is to do, see `state_layout`: where it has changed, every bubble is due. Returns
    the number, from 1, of the bubble whose mean of a quiet line is to be compared with its curve, plus RESTART for `restart`.
    """
    n = board[_BUBBLE_COUNT]
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * n))
    tick = board[_TICK_US]
    atmosphere = board[_ATMOSPHERE_PA]
    same = 1 if mode == board[_CONTROL_MODE] else 0
    board[_CONTROL_MODE] = mode
    board[_TICK] = board[_TICK] + 1 & _LATEST
    supply_scale = supply + atmosphere >> 3  # 8 Pa
    supply_reciprocal = 0x3FFFFFFF // (supply + atmosphere)
    chosen = 0
    found = 0
    i = 0
    while i < n:
        count = counts[i]
        pressure = (count - row[_SENSOR_ZERO]) * board[_PA_PER_COUNT]

        # Limits: the sensor at an end of its range, or too much pressure, now or in the tick before.
        if (
            count - board[_COUNT_LOW] - 1 | board[_COUNT_HIGH] - 1 - count | board[_PRESSURE_MAX] - pressure
        ) >> 31 | row[_SUSPECT]:
            row[_SUSPECT] = 0
            row[_QUIESCENT] = 0
            if count <= board[_COUNT_LOW] or count >= board[_COUNT_HIGH]:
                row[_SUSPECT] = 1
                # A chip that has not answered is no noise: that one reading is enough.
                row[_LOST_TICKS] = row[_LOST_TICKS] + 1 if count < _ABSENT else _READINGS_MIN
                pressure = row[_PRESSURE]
            else:
                row[_LOST_TICKS] = 0
            over = board[_PRESSURE_MAX] - pressure >> 31  # -1 or 0
            row[_SUSPECT] = row[_SUSPECT] | 0 - over
            row[_OVERPRESSURE_TICKS] = row[_OVERPRESSURE_TICKS] - over & over
            if row[_OVERPRESSURE_TICKS] >= _READINGS_MIN:
                row[_FAULTS] = row[_FAULTS] | _OVERPRESSURE
            if row[_LOST_TICKS] >= _READINGS_MIN:
                row[_FAULTS] = row[_FAULTS] | _SENSOR_LOST
        row[_PRESSURE] = pressure

        # Due?
        due = 1
        if row[_QUIESCENT] == 1 and same:
            if row[_SETTLING_US] > 0:
                row[_SETTLING_US] = row[_SETTLING_US] - tick
                due = 0
            elif row[_READINGS] < 1 << row[_READINGS_BITS]:
                row[_READINGS] = row[_READINGS] + 1
                row[_READINGS_SUM] = row[_READINGS_SUM] + pressure
                due = 0
            elif chosen:
                due = 0  # one in a tick
            else:
                if row[_VENT_FULL] == 0:
                    chosen = i + 1
                pressure = row[_READINGS_SUM] >> row[_READINGS_BITS]
                row[_QUIET_PRESSURE] = pressure
                row[_READINGS] = 0
                row[_READINGS_SUM] = 0
                row[_READINGS_BITS] = _READINGS_BITS_NEXT
        else:
            row[_READINGS] = 0
            row[_READINGS_SUM] = 0
            row[_READINGS_BITS] = _READINGS_BITS_FIRST
            if row[_QUIESCENT] == _HELD and same:
                row[_QUIESCENT] = 0
                row[_FILL_RUN_US] = row[_FILL_RUN_US] + row[_FILL_US]
                if row[_FILL_US]:
                    row[_FILL_OPEN_US] = row[_FILL_OPEN_US] + tick
                else:
                    row[_VENT_OPEN_US] = row[_VENT_OPEN_US] + tick
                due = 0
        row[_DUE] = due
        row[_AIR_METERED] = 0

        if due:
            # Air that valves have brought and bring. One that does nothing is looked at only with the setpoint on its side.
            metered = 0
            in_flight = 0
            missing = row[_SETPOINT_AIR] - row[_AIR]
            valve = 0
            while valve < 2:
                state = ptr32(uint(row) + 4 * valve)
                energised = state[_FILL_US]
                open_us = state[_FILL_OPEN_US]
                was_open = state[_FILL_FULL]
                active = open_us | energised | was_open
                flow = 0
                if active or missing > 0:
                    before = state[_FILL_FLOW]
                    trim = ptr32(uint(row) + 12 * valve)  # of this valve
                    at = 0 if was_open else board[_TUBE_PA] * before >> 4  # which the tube will lose once air flows
                    if valve:
                        sign = 0 - 1
                        at = row[_PRESSURE] - at >> 3
                        scale = 1 << 14
                    else:
                        sign = 1
                        at = (supply - row[_PRESSURE] - at) * supply_reciprocal >> 16
                        scale = supply_scale
                    if at >> 13:
                        at = _ROOT_END if at > 0 else 0
                    part = at & 127
                    at >>= 7
                    if valve:
                        at += _ROOT_STEPS + 1
                    roots = ptr32(uint(board) + 4 * at)
                    at = roots[_ROOTS]
                    root = scale * (at + ((roots[_ROOTS + 1] - at) * part >> 7)) >> 14
                    flow = (root * trim[_FILL_GAIN] >> 12) + 1
                    if active:
                        if open_us:
                            moved = ((before + flow) * open_us >> 13) * 16777 >> 16
                            row[_AIR_SD] = row[_AIR_SD] + (moved * row[_FLOW_SD] >> 16) + (10 if energised == 0 else 0)
                            metered += sign * moved
                            open_us = 0
                        if energised:
                            open_us = energised if was_open else energised - trim[_FILL_OPENS_US]
                        if energised < tick and energised | was_open:
                            open_us += trim[_FILL_CLOSES_US]
                        open_us &= ~(open_us >> 31)  # not below 0
                        state[_FILL_OPEN_US] = open_us
                        state[_FILL_FULL] = 1 if energised == tick else 0
                        if open_us:
                            coming = (flow * open_us >> 12) * 16777 >> 16
                            in_flight += sign * coming
                state[_FILL_FLOW] = flow
                missing = 0 - missing
                valve += 1
            row[_AIR_IN_FLIGHT] = in_flight
            if row[_LEAK_RATE]:
                # Pa/16 times µJ/s per kPa *16, ticks: µJ/s/1000 ticks.
                leaked = row[_LEAKED] + (pressure >> 4) * row[_LEAK_RATE] * (board[_TICK] - row[_LEAK_TICK] & _LATEST)
                lost = leaked // board[_LEAK_SHARE]
                row[_LEAKED] = leaked - lost * board[_LEAK_SHARE]
                metered -= lost
                row[_AIR_SD] = row[_AIR_SD] + (lost >> 4)
            row[_LEAK_TICK] = board[_TICK]
            row[_AIR_METERED] = metered
            air = row[_AIR] + metered
            segment = row[_HEIGHT_SEGMENT]

            # Without pressure it is empty.
            if pressure < _EMPTY_PA:
                if row[_EMPTY_TICKS] * tick < _EMPTY_US:
                    row[_EMPTY_TICKS] = row[_EMPTY_TICKS] + 1
                else:
                    segment = row[_FIRST_SEGMENT]
                    knot = ptr32(uint(curves) + segment)
                    was = air
                    air = (pressure + atmosphere >> 4) * knot[_KNOT_VOLUME] >> 12
                    # What was learned of the curve at an air that was not there is wrong, too: -1 then, else 0.
                    wrong = (_AIR_SD_FAR - was + air | _AIR_SD_FAR + was - air) >> 31
                    row[_CURVE_ERROR] = row[_CURVE_ERROR] & ~wrong
                    row[_CURVE_ERROR_SD] = row[_CURVE_ERROR_SD] + (row[_CURVE_SD] - row[_CURVE_ERROR_SD] & wrong)
                    row[_AIR_SD] = _AIR_SD_EMPTY
                    row[_REZERO] = 0
                    row[_LEAKED] = 0
                    row[_CORRELATION] = 0
            else:
                row[_EMPTY_TICKS] = 0
            if air >> 31 or air > _AIR_MAX:
                air = 0 if air < 0 else _AIR_MAX
            row[_AIR] = air
            if row[_AIR_SD] > _AIR_SD_MAX:
                row[_AIR_SD] = _AIR_SD_MAX

            # Height: by the gas law. What the open valve's tube loses is not in the bubble.
            absolute = pressure + atmosphere
            if row[_FILL_FULL] | row[_VENT_FULL] and chosen != i + 1:
                if row[_FILL_FULL]:
                    absolute -= board[_TUBE_PA] * row[_FILL_FLOW] >> 4
                else:
                    absolute += board[_TUBE_PA] * row[_VENT_FLOW] >> 4
            absolute >>= 4
            if absolute < _ABSOLUTE_MIN:
                absolute = _ABSOLUTE_MIN
            volume = (air << 12) // absolute
            knot = ptr32(uint(curves) + segment)
            off = volume - knot[_KNOT_VOLUME]
            while (off | knot[_KNOT_WORDS + _KNOT_VOLUME] - volume) >> 31:  # it is in another segment
                if off < 0:
                    if segment == row[_FIRST_SEGMENT]:
                        off = 0
                        break
                    segment -= 4 * _KNOT_WORDS
                else:
                    if segment == row[_LAST_SEGMENT]:
                        off = knot[_KNOT_WORDS + _KNOT_VOLUME] - knot[_KNOT_VOLUME]
                        break
                    segment += 4 * _KNOT_WORDS
                knot = ptr32(uint(curves) + segment)
                off = volume - knot[_KNOT_VOLUME]
            height = knot[_KNOT_HEIGHT] + (off * knot[_KNOT_RECIPROCAL] >> 16)

            # A pressure that no memory explains: the air is not what was metered.
            far = pressure - knot[_KNOT_PRESSURE] - (knot[_KNOT_PRESSURE] * (row[_CURVE_ERROR] >> 4) >> 12)
            low = (board[_REST_UM] + _LOW_UM << 4) - height
            most = _FAR_MOVING_PA + ((low & ~(low >> 31) & 0 - row[_FILL_FULL]) >> 3) if row[_STATUS] & 3 else _FAR_PA
            if (most - far | most + far) >> 31 == 0 or row[_SUSPECT] | row[_EMPTY_TICKS]:
                row[_FAR_TICKS] = 0
            elif row[_STATUS] & 3 and row[_FAR_TICKS] < _FAR_MAX:
                row[_FAR_TICKS] = row[_FAR_TICKS] + 1
            else:
                row[_FAR_TICKS] = 0
                row[_FAR] = 1
                found = _RESTART
            row[_HEIGHT] = height
            row[_HEIGHT_SEGMENT] = segment
            if height > row[_PEAK]:
                row[_PEAK] = height
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
    return chosen | found


@micropython.viper
def deviations(row: ptr32, board: ptr32):
    """Find how well every bubble's height is known: `HEIGHT_SD`. The tick does without, so it is found when somebody asks."""
    n = board[_BUBBLE_COUNT]
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * n))
    while n > 0:
        absolute = row[_PRESSURE] + board[_ATMOSPHERE_PA] >> 4
        if absolute < _ABSOLUTE_MIN:
            absolute = _ABSOLUTE_MIN
        knot = ptr32(uint(curves) + row[_HEIGHT_SEGMENT])
        volume = (row[_AIR_SD] << 12) // absolute
        row[_HEIGHT_SD] = ((volume >> 4) * (knot[_KNOT_RECIPROCAL] >> 8) >> 8) + 15
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


@micropython.viper
def restart(row: ptr32, board: ptr32):
    """Let the curve say the air of every bubble that `estimate` has found to have another pressure than its air can have.

    It is what the curve has there where it has this pressure next to the height so far: a bubble stays on its branch.
    """
    n = board[_BUBBLE_COUNT]
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * n))
    while n > 0:
        if row[_FAR]:
            row[_FAR] = 0
            pressure = row[_PRESSURE]
            segment = row[_HEIGHT_SEGMENT]
            knot = ptr32(uint(curves) + segment)
            low = segment
            high = segment
            upwards = 1
            while (pressure - knot[_KNOT_PRESSURE]) * (knot[_KNOT_WORDS + _KNOT_PRESSURE] - pressure) >> 31:
                if high == row[_LAST_SEGMENT] and low == row[_FIRST_SEGMENT]:  # nowhere
                    segment = high if pressure > 0 else low
                    knot = ptr32(uint(curves) + segment)
                    break
                if (upwards and high != row[_LAST_SEGMENT]) or low == row[_FIRST_SEGMENT]:
                    upwards = 0
                    high += 4 * _KNOT_WORDS
                    segment = high
                else:
                    upwards = 1
                    low -= 4 * _KNOT_WORDS
                    segment = low
                knot = ptr32(uint(curves) + segment)
            off = pressure - knot[_KNOT_PRESSURE]
            rise = knot[_KNOT_WORDS + _KNOT_PRESSURE] - knot[_KNOT_PRESSURE]
            if rise == 0:
                off = 0
                rise = 1
            off = (off << 10) // rise  # share of the segment, *1024
            if off < 0:
                off = 0
            if off > 1024:
                off = 1024
            row[_HEIGHT] = knot[_KNOT_HEIGHT] + (off * (knot[_KNOT_WORDS + _KNOT_HEIGHT] - knot[_KNOT_HEIGHT]) >> 10)
            row[_HEIGHT_SEGMENT] = segment
            volume = knot[_KNOT_VOLUME] + (off * (knot[_KNOT_WORDS + _KNOT_VOLUME] - knot[_KNOT_VOLUME]) >> 10)
            row[_AIR] = (pressure + board[_ATMOSPHERE_PA] >> 4) * volume >> 12
            row[_AIR_SD] = _AIR_SD_FAR
            row[_CORRELATION] = 0
            row[_CURVE_ERROR] = 0
            row[_CURVE_ERROR_SD] = row[_CURVE_SD]
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1
