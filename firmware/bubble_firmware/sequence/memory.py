# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""The records of one sequence in memory that is made once, checked as they come."""

from array import array

from bubble_protocol import steps
from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr16, ptr32

if TYPE_CHECKING:
    from types import ModuleType

# [constants] bubble_protocol.steps: HEAD CHECK BUBBLES HEIGHT_MAX TICK_US DEPTH
_HEAD = const(4)
_CHECK = const(12)
_BUBBLES = const(0)
_HEIGHT_MAX = const(1)
_TICK_US = const(2)
_DEPTH = const(4)
# [end of constants]

_BLOCK = const(4096)  # bytes
_SPARED = const(8)  # blocks of the heap that are not ours: what is made after us takes 10 kB, and some is to stay free


@micropython.viper
def _store(v: ptr32, w: ptr16, at: int, count: int, to: int):  # type: ignore[no-untyped-def]
    """Copy `count` words of `v[at:]` to `w[to:]`."""
    end = at + count
    while at < end:
        w[to] = v[at]
        at += 1
        to += 1


@micropython.viper
def word(w: ptr16, at: int) -> int:
    """Word `at` of a block."""
    return w[at]


class SequenceMemory:
    """A program that is all there, or a stream that is written ahead of what is read. `next`: the record to be read next.

    `total`: records in all, 0 for a stream without end. `received`: those that have come. `capacity`: those that fit.
    `words`: of a record. `check`: what `steps.first_invalid` works on.
    """

    def __init__(self, board: "ModuleType"):
        self.words = _HEAD + board.BUBBLES
        # In blocks, because a heap that compiles its own code has no large ones left; no arrays, for each would be
        # made from a second one.
        self._per_block = _BLOCK // (2 * self.words)  # records
        size = 2 * self._per_block * self.words
        self._blocks = [bytearray(size)]
        spared = []
        try:
            for _ in range(_SPARED):
                spared.append(bytearray(_BLOCK))
            while len(self._blocks) < board.SEQUENCE_BYTES // _BLOCK:
                self._blocks.append(bytearray(size))
        except MemoryError:  # a stock MicroPython has our code on its heap, too
            pass
        del spared
        self.capacity = len(self._blocks) * self._per_block
        self.check = array("i", bytearray(4 * _CHECK))
        self.check[_BUBBLES] = board.BUBBLES
        self.check[_HEIGHT_MAX] = board.HEIGHT_MAX_UM
        self.check[_TICK_US] = board.TICK_US
        self.total = 0
        self.received = 0
        self.streams = False
        self.next = 0

    def begin(self, total: int) -> None:
        """Await `total` records."""
        self.total = total
        self.received = 0
        self.next = 0
        self.streams = total == 0 or total > self.capacity
        steps.restart(self.check, 0 if self.streams else 1)

    @property
    def free(self) -> int:
        """Records that there is room for."""
        room = self.capacity - self.received
        if self.streams:
            room += self.next
        if self.total and room > self.total - self.received:
            room = self.total - self.received
        return room

    @property
    def complete(self) -> bool:
        """Whether it can be played: a program is all there and nested properly, a stream has filled the memory."""
        if self.streams:
            return self.received > 0 and self.free == 0
        return self.received == self.total and self.check[_DEPTH] == 0

    def write(self, values: "array[int]", at: int, records: int) -> int:
        """Take the records at `values[at:]`, all or none: -1, or what `steps.first_invalid` says of the first unsound one."""
        invalid: int = steps.first_invalid(values, self.check, at, records)
        if invalid < 0:
            words = self.words
            steps.accept(values, self.check, at, at + records * words)
            for _ in range(records):
                _store(values, self.block(self.received), at, words, self.offset(self.received))
                self.received += 1
                at += words
        return invalid

    def block(self, record: int) -> bytearray:
        """The block that a record is in."""
        return self._blocks[record % self.capacity // self._per_block]

    def offset(self, record: int) -> int:
        """Where in its block a record begins, in words."""
        return record % self.capacity % self._per_block * self.words
