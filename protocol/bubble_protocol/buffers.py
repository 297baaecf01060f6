# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""Numbers in bytes, little-endian, and bytes from here to there: without the tuples of `struct` and the slices that allocate."""

from bubble_protocol.mpy_compat import micropython, ptr8


@micropython.viper
def copy(source: ptr8, at: int, target: ptr8, to: int, size: int):
    """Copy `source[at:at + size]` to `target[to:]`."""
    while size > 0:
        target[to] = source[at]
        at += 1
        to += 1
        size -= 1


def put16(data, at, value):
    """Write an unsigned word to `data[at:at + 2]`."""
    data[at] = value & 255
    data[at + 1] = value >> 8 & 255


def get16(data, at):
    """The unsigned word in `data[at:at + 2]`."""
    return data[at] | data[at + 1] << 8


def put32(data, at, value):
    """Write a word, signed or not, to `data[at:at + 4]`."""
    put16(data, at, value & 0xFFFF)
    put16(data, at + 2, value >> 16)


def get32(data, at):
    """The signed word in `data[at:at + 4]`."""
    return ((data[at + 3] ^ 128) - 128) * 16777216 + (data[at + 2] << 16 | get16(data, at))


@micropython.viper
def same(one: ptr8, at: int, other: ptr8, to: int, size: int) -> int:
    """Whether `one[at:at + size]` and `other[to:to + size]` are the same bytes."""
    while size > 0 and one[at] == other[to]:
        at += 1
        to += 1
        size -= 1
    return 1 if size == 0 else 0
