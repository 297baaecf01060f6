# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""Second pass over all bubbles: the setpoints' way to the targets. And the targets themselves, as they are asked."""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.statuses: used
# [constants] bubble_protocol.steps: used
_FLOW_SD = const(7)
_QUIESCENT = const(12)
_DUE = const(24)
_STATUS = const(25)
_HEIGHT = const(26)
_SETPOINT_AIR = const(28)
_RAMPING = const(30)
_SETPOINT = const(33)
_FAULTS = const(36)
_TARGET = const(37)
_SETPOINT_SEGMENT = const(38)
_SETPOINT_VOLUME = const(39)
_SETPOINT_PRESSURE = const(40)
_SETPOINT_SLOPE = const(41)
_RAMP_START = const(42)
_FIRST_SEGMENT = const(44)
_LAST_SEGMENT = const(45)
_HEIGHT_SD = const(53)
_PRESSURE_RATIO = const(54)
_REZERO = const(62)
_ROW_WORDS = const(70)
_KNOT_HEIGHT = const(0)
_KNOT_VOLUME = const(1)
_KNOT_PRESSURE = const(2)
_KNOT_SLOPE = const(3)
_KNOT_RISE = const(5)
_KNOT_WORDS = const(6)
_BUBBLE_COUNT = const(0)
_RAMP_DONE = const(16)
_RAMP_TICKS = const(17)
_RAMP_SHARE = const(18)
_ATMOSPHERE_PA = const(23)
_ROWS = const(157)
_LEAVE = const(65535)
# [end of constants]

_WAY_UM = const(1000)
_FLOW_SD_FAIR = const(1311)  # 2 %, *65536


@micropython.viper
def move_setpoints(row: ptr32, board: ptr32):
    """Move the ramp on by a tick, and find height and air of the setpoint of every bubble that is due.

    Its pressure is expected to be above the curve's by the share by which the pressure of its quiet line was lately.
    """
    if board[_RAMP_DONE] != board[_RAMP_TICKS]:
        board[_RAMP_DONE] = board[_RAMP_DONE] + 1
        board[_RAMP_SHARE] = (board[_RAMP_DONE] << 12) // board[_RAMP_TICKS]
    n = board[_BUBBLE_COUNT]
    atmosphere = board[_ATMOSPHERE_PA]
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * n))
    while n > 0:
        if row[_DUE]:
            if row[_RAMPING]:
                if board[_RAMP_DONE] == board[_RAMP_TICKS]:
                    row[_RAMPING] = 0
                height = (row[_RAMP_START] << 4) + ((row[_TARGET] - row[_RAMP_START]) * board[_RAMP_SHARE] >> 8)
                row[_SETPOINT] = height
                segment = row[_SETPOINT_SEGMENT]
                knot = ptr32(uint(curves) + segment)
                off = height - knot[_KNOT_HEIGHT]
                while (off | knot[_KNOT_WORDS + _KNOT_HEIGHT] - height) >> 31:  # it is in another segment
                    if off < 0:
                        if segment == row[_FIRST_SEGMENT]:
                            off = 0
                            break
                        segment -= 4 * _KNOT_WORDS
                    else:
                        if segment == row[_LAST_SEGMENT]:
                            off = knot[_KNOT_WORDS + _KNOT_HEIGHT] - knot[_KNOT_HEIGHT]
                            break
                        segment += 4 * _KNOT_WORDS
                    knot = ptr32(uint(curves) + segment)
                    off = height - knot[_KNOT_HEIGHT]
                row[_SETPOINT_SEGMENT] = segment
                row[_SETPOINT_SLOPE] = knot[_KNOT_SLOPE]
                row[_SETPOINT_VOLUME] = knot[_KNOT_VOLUME] + (off * knot[_KNOT_SLOPE] >> 12)
                row[_SETPOINT_PRESSURE] = knot[_KNOT_PRESSURE] + (off * knot[_KNOT_RISE] >> 12)
            expected = row[_SETPOINT_PRESSURE] * (4096 + row[_PRESSURE_RATIO]) >> 12
            if expected > 60000:
                expected = 60000
            row[_SETPOINT_AIR] = (expected + atmosphere >> 4) * row[_SETPOINT_VOLUME] >> 12
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


@micropython.viper
def set_targets(row: ptr32, heights: ptr32, at: int, n: int, rezero_um: int):
    """Begin every bubble's way from where it is to the height (µm) in `heights[at:]`.

    Where its height is known no better than `rezero_um`, not 0, and metering it afresh would help, a bubble that has some way to
    go is emptied first.
    """
    while n > 0:
        way = heights[at] - (row[_HEIGHT] >> 4)
        row[_REZERO] = 0
        if way < 0:
            way = 0 - way
        if rezero_um and way > _WAY_UM and row[_HEIGHT_SD] > rezero_um and row[_FLOW_SD] < _FLOW_SD_FAIR:
            row[_REZERO] = 1 if row[_STATUS] & 3 else 0
        row[_RAMP_START] = row[_HEIGHT] >> 4
        row[_TARGET] = heights[at]
        row[_QUIESCENT] = 0
        row[_RAMPING] = 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        at += 1
        n -= 1


@micropython.viper
def set_next_targets(row: ptr32, heights: ptr16, at: int, n: int, from_height: int, rest_um: int):
    """Begin the way to the targets (µm) in `heights[at:]`; a bubble whose target is LEAVE keeps the one that it has.

    It begins where the setpoint is, so that a ramp follows another without a step, or at the estimated height.
    """
    while n > 0:
        row[_RAMP_START] = (row[_HEIGHT] if from_height else row[_SETPOINT]) >> 4
        target = heights[at]
        if target != _LEAVE:
            row[_TARGET] = target if target > rest_um else rest_um  # lower would be the end of the ramp before its time
        row[_REZERO] = 0
        row[_QUIESCENT] = 0
        row[_RAMPING] = 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        at += 1
        n -= 1


@micropython.viper
def hold_position(row: ptr32, n: int):
    """Want every bubble where it is."""
    while n > 0:
        row[_RAMP_START] = row[_HEIGHT] >> 4
        row[_TARGET] = row[_RAMP_START]
        row[_REZERO] = 0
        row[_QUIESCENT] = 0
        row[_RAMPING] = 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


@micropython.viper
def retract(row: ptr32, height: int, n: int):
    """Want every bubble at `height` µm, at once."""
    while n > 0:
        row[_RAMP_START] = height
        row[_TARGET] = height
        row[_REZERO] = 0
        row[_QUIESCENT] = 0
        row[_RAMPING] = 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


@micropython.viper
def unsettled(row: ptr32, n: int, tolerance: int, rest_um: int) -> int:
    """The bubbles, as bits, whose height is further than `tolerance` µm from the target."""
    bits = 0
    bit = 1
    while n > 0:
        target = row[_TARGET]
        off = (target if target > rest_um else rest_um) - (row[_HEIGHT] >> 4)
        if off > tolerance or off < 0 - tolerance or row[_FAULTS]:
            bits |= bit
        bit <<= 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1
    return bits


@micropython.viper
def first_above(values: ptr32, at: int, end: int, limit: int) -> int:
    """The index of the first of `values[at:end]` above `limit`, -1 where there is none."""
    while at < end:
        if values[at] > limit:
            return at
        at += 1
    return -1
