"""The fault log: what has gone wrong since boot, when, at what pressure; the last sixteen entries."""

from array import array

from bubble_protocol.mpy_compat import const

SIZE = const(16)
FIELDS = const(5)  # id, tick, what, bubble, value
_ID_MAX = const(0x3FFFFFFF)


class FaultLog:
    """`newest` and `acknowledged` are ids, counted from 1; entries stand in `entries`, a ring, FIELDS words each."""

    def __init__(self) -> None:
        self.newest = 0
        self.acknowledged = 0
        self.entries = array("i", bytearray(4 * FIELDS * SIZE))

    def add(self, tick: int, what: int, bubble: int, value: int) -> int:
        """Write an entry over the oldest; its id."""
        if self.newest < _ID_MAX:  # else the last one is written over and over
            self.newest += 1
        entries = self.entries
        at = self.newest % SIZE * FIELDS
        entries[at] = self.newest
        entries[at + 1] = tick
        entries[at + 2] = what
        entries[at + 3] = bubble
        entries[at + 4] = value
        return self.newest

    def acknowledge(self, up_to: int) -> None:
        """The entries up to this id have been seen."""
        if up_to > self.acknowledged:
            self.acknowledged = up_to if up_to < self.newest else self.newest

    def oldest_after(self, after: int) -> int:
        """The id of the oldest entry kept whose id is greater than `after`."""
        oldest = self.newest - SIZE + 1
        if oldest < 1:
            oldest = 1
        return after + 1 if after >= oldest else oldest
