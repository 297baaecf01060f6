# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""Where the bubbles are to be: targets, and the setpoints' way to them."""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.statuses: RESTING
# [constants] bubble_protocol.steps: LEAVE
_QUIESCENT = const(6)
_SAMPLES = const(13)
_FAULTS = const(21)
_STATUS = const(22)
_TARGET = const(23)
_HEIGHT = const(24)
_SETPOINT = const(28)
_RAMP_START = const(32)
_RAMPING = const(33)
_HOLD_OUTPUT = const(34)
_ROW_WORDS = const(41)
_RESTING = const(0)
_LEAVE = const(65535)
# [end of constants]


@micropython.viper
def set_targets(row: ptr32, heights: ptr32, at: int, n: int):
    """Begin every bubble's way from where it is to the height (µm) in `heights[at:]`."""
    while n > 0:
        row[_RAMP_START] = row[_HEIGHT] >> 4
        row[_TARGET] = heights[at]
        row[_QUIESCENT] = 0
        row[_HOLD_OUTPUT] = 0
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
        row[_QUIESCENT] = 0
        row[_HOLD_OUTPUT] = 0
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
        row[_QUIESCENT] = 0
        row[_HOLD_OUTPUT] = 0
        row[_RAMPING] = 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


@micropython.viper
def retract(row: ptr32, height: int, n: int):
    """Want every bubble at `height` µm, at once."""
    while n > 0:
        row[_RAMP_START] = height
        row[_TARGET] = height
        row[_QUIESCENT] = 0
        row[_HOLD_OUTPUT] = 0
        row[_RAMPING] = 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


@micropython.viper
def unsettled(row: ptr32, n: int, tolerance: int, rest_um: int) -> int:
    """The bubbles, as bits, whose height is further than `tolerance` µm from the target, or not yet measured."""
    bits = 0
    bit = 1
    while n > 0:
        target = row[_TARGET]
        off = (target if target > rest_um else rest_um) - (row[_HEIGHT] >> 4)
        known = 1 if row[_SAMPLES] > 1 or row[_STATUS] == _RESTING else 0
        if off > tolerance or off < 0 - tolerance or known == 0 or row[_FAULTS]:
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
