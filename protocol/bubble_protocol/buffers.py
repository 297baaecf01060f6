# mypy: disable-error-code="valid-type,index,operator,arg-type,no-redef"
"""Numbers in bytes, little-endian, and bytes from here to there: without the tuples of `struct` and the slices that allocate."""

from bubble_protocol.mpy_compat import COMPILED, TYPE_CHECKING, micropython, ptr8

if TYPE_CHECKING:
    from bubble_protocol.mpy_compat import Buffer


@micropython.viper
def copy(source: ptr8, start: int, end: int, target: ptr8, at: int):  # type: ignore[no-untyped-def]
    """`target[at:] = source[start:end]`, without slices."""
    while start < end:
        target[at] = source[start]
        at += 1
        start += 1


if not COMPILED:  # CPython loops over bytes slowly, but slices in C

    def _copy_in_slices(source: "Buffer", start: int, end: int, target: bytearray, at: int) -> None:
        target[at : at + end - start] = source[start:end]

    copy = _copy_in_slices


def put16(data: bytearray, at: int, value: int) -> None:
    """Write an unsigned word to `data[at:at + 2]`."""
    data[at] = value & 255
    data[at + 1] = value >> 8 & 255


def get16(data: "Buffer", at: int) -> int:
    """The unsigned word in `data[at:at + 2]`."""
    return data[at] | data[at + 1] << 8


def put32(data: bytearray, at: int, value: int) -> None:
    """Write a word, signed or not, to `data[at:at + 4]`."""
    put16(data, at, value & 0xFFFF)
    put16(data, at + 2, value >> 16)


def get32(data: "Buffer", at: int) -> int:
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
