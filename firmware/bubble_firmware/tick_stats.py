# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""How long ticks take and how late they begin."""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr32

if TYPE_CHECKING:
    from types import ModuleType

BINS = const(24)


@micropython.viper
def _count(counts: ptr32, us: int, width: int):  # type: ignore[no-untyped-def]
    """Count one time in bins of `width` µs; the last bin also takes everything longer."""
    index = us // width
    if index > BINS - 1:
        index = BINS - 1
    counts[index] = counts[index] + 1


class TickStats:
    """Histograms since boot, made once: `worked` in bins of `work_us`, `delayed` in bins of `delay_us`, BINS each.

    `worst_us`: the longest tick. `exceptions`: how many ticks have failed.
    """

    def __init__(self, board: "ModuleType"):
        self.work_us = board.TICK_US // 50
        self.delay_us = board.TICK_US // 250
        self.worked = array("i", bytearray(4 * BINS))
        self.delayed = array("i", bytearray(4 * BINS))
        self.worst_us = 0
        self.exceptions = 0

    def began(self, us: int) -> None:
        """A tick has begun so many µs after its period."""
        _count(self.delayed, us, self.delay_us)

    def ended(self, us: int) -> None:
        """A tick has ended so many µs after its period began."""
        _count(self.worked, us, self.work_us)
        if us > self.worst_us:
            self.worst_us = us
