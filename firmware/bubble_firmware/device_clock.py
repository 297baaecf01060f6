"""Device time: ticks since boot, by which everything is dated."""

from bubble_protocol.mpy_compat import const

# [constants] bubble_protocol.schema.system: TICKS_WRAP
_TICKS_WRAP = const(1073741824)
# [end of constants]

LATEST = _TICKS_WRAP - 1
_HALF = const(536870912)  # of TICKS_WRAP, which itself is no small integer


def ticks_diff(later: int, earlier: int) -> int:
    """Ticks from `earlier` to `later`, negative where it is the other way round: right within half of TICKS_WRAP, 31 days.

    Dates are compared by this alone, for after LATEST comes 0.
    """
    ticks = later - earlier
    if ticks >= _HALF:
        return ticks - _HALF - _HALF
    if ticks < -_HALF:
        return ticks + _HALF + _HALF
    return ticks


def ticks_add(ticks: int, periods: int) -> int:
    """The tick that is `periods` after `ticks`, or before it where they are negative."""
    if periods < 0:
        ticks += periods
        return ticks if ticks >= 0 else ticks + _HALF + _HALF
    over = ticks - (LATEST - periods)  # LATEST - ticks would be long before the first tick, when ticks are -1
    return ticks + periods if over <= 0 else over - 1


class DeviceClock:
    """`ticks` is the number of this tick; `before` the first. After LATEST it goes on from 0: no integer becomes long."""

    def __init__(self, before: int = -1):
        self.ticks = before

    def advance(self, periods: int) -> None:
        """So many periods have begun."""
        ticks = self.ticks
        # Nearly always: a function less.
        self.ticks = ticks + periods if 0 <= ticks < _HALF and 0 <= periods < _HALF else ticks_add(ticks, periods)
