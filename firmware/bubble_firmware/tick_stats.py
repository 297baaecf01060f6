# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""How long ticks take and how late they begin: counts in bins, made once."""

from array import array

from bubble_protocol.mpy_compat import const, micropython, ptr32
from bubble_protocol.schema.system import TICKS_WRAP

LATEST = TICKS_WRAP - 1

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


def later(ticks, periods):
    """The device time some periods after `ticks`: it goes on from 0 before an integer would become long."""
    over = ticks - (LATEST - periods)  # LATEST - ticks would be long before the first tick, when ticks are -1
    return ticks + periods if over <= 0 else over - 1
