# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""First pass over all bubbles: limits of the sensors, and the air and height of each.

The controlled quantity is *air*. The valves' air is counted, and the count is corrected by the pressure sensor whenever no
air flows: an observer, predict by dose, correct by measurement, through the bubble's curve, see `curve`. Height is a single
valued function of air even where pressure hardly changes with height.

A bubble where nothing is under way is *quiescent*: its limits are looked at in every tick, but it is measured and decided
upon in every fourth only, by the mean of four readings (decimation). Whatever asks something else of a bubble ends that.
A bubble whose valve stays open for three more periods *holds its output* through every second tick. `DUE` says for the
passes that follow whether a bubble is decided upon in this tick.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.faults: used
# [constants] bubble_firmware.hal.base: ABSENT
_SENSOR_ZERO = const(0)
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
_FILL_US = const(18)
_FILL_RUN_US = const(20)
_FAULTS = const(21)
_STATUS = const(22)
_HEIGHT = const(24)
_HEIGHT_SEGMENT = const(25)
_HEIGHT_SLOPE = const(26)
_DUE = const(27)
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
_CONTROL_MODE = const(16)
_ROWS = const(150)
_READINGS_MIN = const(2)
_SAMPLES_MAX = const(64)
_INNOVATION_UM = const(500)
_INNOVATION_PA = const(500)
_OVERPRESSURE = const(1)
_SENSOR_LOST = const(2)
_ABSENT = const(65535)
# [end of constants]

_AIR_MAX = const(400000)  # µJ, more than any bubble of 16 mm holds: keeps every product of control within 32 bits


@micropython.viper
def estimate(row: ptr32, board: ptr32, counts: ptr16, mode: int):
    """Take up this tick's `counts`: pressures, faults of the sensors, and air and height of every bubble that is due.

    `mode` is what control is to do, see `state_layout`: where it has changed, every bubble is due.
    """
    n = board[_BUBBLE_COUNT]
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * n))
    tick = board[_TICK_US]
    same = 1 if mode == board[_CONTROL_MODE] else 0
    board[_CONTROL_MODE] = mode
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
            row[_HOLD_OUTPUT] = 0
            row[_DECIMATION_LEFT] = -1
            if count <= board[_COUNT_LOW] or count >= board[_COUNT_HIGH]:
                row[_SUSPECT] = 1
                # A chip that has not answered is no noise: that one reading is enough.
                row[_LOST_TICKS] = row[_LOST_TICKS] + 1 if count < _ABSENT else _READINGS_MIN
                pressure = row[_PRESSURE]
            else:
                row[_LOST_TICKS] = 0
            if pressure > board[_PRESSURE_MAX]:
                row[_SUSPECT] = 1
                row[_OVERPRESSURE_TICKS] = row[_OVERPRESSURE_TICKS] + 1
            else:
                row[_OVERPRESSURE_TICKS] = 0
            if row[_OVERPRESSURE_TICKS] >= _READINGS_MIN:
                row[_FAULTS] = row[_FAULTS] | _OVERPRESSURE
            if row[_LOST_TICKS] >= _READINGS_MIN:
                row[_FAULTS] = row[_FAULTS] | _SENSOR_LOST
        row[_PRESSURE] = pressure

        # Due?
        due = 1
        if row[_QUIESCENT] & same:
            if row[_SETTLING_US] > 0:
                row[_SETTLING_US] = row[_SETTLING_US] - tick
                due = 0
            elif row[_DECIMATION_LEFT] > 0:
                row[_DECIMATION_LEFT] = row[_DECIMATION_LEFT] - 1
                row[_DECIMATION_SUM] = row[_DECIMATION_SUM] + pressure
                due = 0
        elif row[_HOLD_OUTPUT] & same:
            row[_HOLD_OUTPUT] = 0
            row[_AIR] = row[_AIR] + row[_AIR_IN_FLIGHT]
            row[_AIR_IN_FLIGHT] = row[_AIR_QUEUED]
            row[_FILL_RUN_US] = row[_FILL_RUN_US] + row[_FILL_US]
            due = 0
        row[_DUE] = due

        if due:
            air = row[_AIR] + row[_AIR_IN_FLIGHT]
            segment = row[_HEIGHT_SEGMENT]
            knot = ptr32(uint(curves) + segment)
            if row[_SETTLING_US] <= 0 and row[_SUSPECT] == 0:
                # The air that this pressure means: in the segment that contains it and is nearest to the
                # estimate's, because a bubble stays on the branch where it was.
                mean = pressure
                weight = 1
                if row[_DECIMATION_LEFT] == 0:
                    mean = row[_DECIMATION_SUM] + pressure >> 2
                    weight = 4
                row[_DECIMATION_LEFT] = -1
                if (mean - row[_LOWEST_PRESSURE] | row[_HIGHEST_PRESSURE] - mean) >> 31:
                    if mean < row[_LOWEST_PRESSURE]:
                        knot = ptr32(uint(curves) + row[_FIRST_SEGMENT])
                        innovation = knot[_KNOT_AIR] - air
                    else:
                        knot = ptr32(uint(curves) + row[_LAST_SEGMENT])
                        innovation = knot[_KNOT_WORDS + _KNOT_AIR] - air
                else:
                    low = segment
                    high = segment
                    upwards = 1
                    while (mean - knot[_KNOT_PRESSURE]) * (knot[_KNOT_WORDS + _KNOT_PRESSURE] - mean) >> 31:
                        if upwards:
                            upwards = 0
                            if high != row[_LAST_SEGMENT]:
                                high += 4 * _KNOT_WORDS
                            knot = ptr32(uint(curves) + high)
                        else:
                            upwards = 1
                            if low != row[_FIRST_SEGMENT]:
                                low -= 4 * _KNOT_WORDS
                            knot = ptr32(uint(curves) + low)
                    innovation = knot[_KNOT_AIR] - air
                    rise = knot[_KNOT_WORDS + _KNOT_PRESSURE] - knot[_KNOT_PRESSURE]
                    if rise:
                        part = (mean - knot[_KNOT_PRESSURE] << 12) // rise
                        innovation += part * (knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]) >> 12
                knot = ptr32(uint(curves) + segment)
                if row[_STATUS] & 3:
                    samples = row[_SAMPLES] + weight
                    if samples > _SAMPLES_MAX:
                        samples = _SAMPLES_MAX
                    # Innovation gate: the pressure that the estimate means, within its segment of the tick before.
                    rise = knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]
                    part = air - knot[_KNOT_AIR]
                    if part < 0:
                        part = 0
                    if part > rise:
                        part = rise
                    part = (part << 12) // rise
                    off = knot[_KNOT_WORDS + _KNOT_PRESSURE] - knot[_KNOT_PRESSURE]
                    off = mean - knot[_KNOT_PRESSURE] - (part * off >> 12)
                    far = row[_HEIGHT_SLOPE] * _INNOVATION_UM >> 8
                    if (far - innovation | far + innovation) >> 31 and (
                        off > _INNOVATION_PA or off < 0 - _INNOVATION_PA
                    ):
                        samples = 1
                        weight = 1
                    row[_SAMPLES] = samples
                    air += (
                        innovation * weight + (samples >> 1)
                    ) // samples  # rounded: a bias would add up over so many
                else:  # the vent is open: nothing is counted, the sensor alone says what there is
                    air += innovation
                if air < 0:
                    air = 0
            if air > _AIR_MAX:
                air = _AIR_MAX
            row[_AIR] = air

            # The height that this air means.
            off = air - knot[_KNOT_AIR]
            while (off | knot[_KNOT_WORDS + _KNOT_AIR] - air) >> 31:  # it is in another segment
                if off < 0:
                    if segment == row[_FIRST_SEGMENT]:
                        off = 0
                        break
                    segment -= 4 * _KNOT_WORDS
                else:
                    if segment == row[_LAST_SEGMENT]:
                        off = knot[_KNOT_WORDS + _KNOT_AIR] - knot[_KNOT_AIR]
                        break
                    segment += 4 * _KNOT_WORDS
                knot = ptr32(uint(curves) + segment)
                off = air - knot[_KNOT_AIR]
            row[_HEIGHT] = knot[_KNOT_HEIGHT] + (off * knot[_KNOT_RECIPROCAL] >> 16)
            row[_HEIGHT_SEGMENT] = segment
            row[_HEIGHT_SLOPE] = knot[_KNOT_SLOPE]
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
