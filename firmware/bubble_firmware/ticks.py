# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""How long ticks take and how late they begin: counts in bins, made once."""

from array import array

from bubble_protocol.portable import const, micropython, ptr32

BINS = 24
_LAST = const(23)


@micropython.viper
def count(counts: ptr32, us: int, width: int):
    """Count one time in bins of `width` µs; the last bin also takes everything longer."""
    index = us // width
    if index > _LAST:
        index = _LAST
    counts[index] = counts[index] + 1


def bins():
    """Empty bins."""
    return array("i", bytearray(4 * BINS))
