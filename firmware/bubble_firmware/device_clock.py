"""Device time: ticks since boot, by which everything is dated."""

from bubble_protocol.mpy_compat import const

# [constants] bubble_protocol.schema.system: TICKS_WRAP
_TICKS_WRAP = const(1073741824)
# [end of constants]

LATEST = _TICKS_WRAP - 1


class DeviceClock:
    """`ticks` is the number of this tick; -1 before the first. After LATEST it goes on from 0: no integer becomes long."""

    def __init__(self) -> None:
        self.ticks = -1

    def advance(self, periods: int) -> None:
        """So many periods have begun."""
        ticks = self.ticks
        over = ticks - (LATEST - periods)  # LATEST - ticks would be long before the first tick, when ticks are -1
        self.ticks = ticks + periods if over <= 0 else over - 1
