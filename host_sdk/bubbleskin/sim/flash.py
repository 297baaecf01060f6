"""NOR flash as a chip has it: sectors are erased, pages are programmed, and power may fail in the middle of either."""

from collections.abc import Callable
from pathlib import Path

from bubble_firmware.drivers.flash import PAGE, SECTOR
from bubbleskin.errors import InvalidInput
from bubbleskin.files import read_bytes, write_bytes

Remains = Callable[[bytes, bytes], bytes]
"""What a cut leaves of one operation, from the bytes before it and those that it would have left."""


class PowerCut(BaseException):
    """Power has failed. No `Exception`: firmware that catches everything must not catch this."""


class NorFlash:
    """Flash of `size` bytes, with the methods of `bubble_firmware.drivers.flash`; with `path`, kept in that file.

    An erase sets all bits of a sector, programming clears bits of a page; both are counted. `cut(after, remains)` lets power
    fail in one of them: its bytes become what `remains` makes of those before it and those it would have left.
    """

    def __init__(self, size: int = 8 * SECTOR, path: Path | None = None):
        self.size = size
        self.image = bytearray(b"\xff" * size)
        self.erases = [0] * (size // SECTOR)
        """Of each sector."""
        self.operations = 0
        """Erases and pages programmed, since the start."""
        self._path = path
        self._cut_at = -1
        self._remains: Remains | None = None
        if path and path.exists():
            kept = read_bytes(path, "the flash", size)
            if len(kept) != size:
                raise InvalidInput(f"{path} has {len(kept)} bytes, but the simulated flash {size}: name another file.")
            self.image[:] = kept

    def cut(self, after: int, remains: Remains) -> None:
        """Let `after` more operations succeed and power fail in the one after them."""
        self._cut_at = self.operations + after
        self._remains = remains

    def read(self, offset: int, page: bytearray) -> None:
        """Fill `page` with what stands at `offset`."""
        page[:] = self.image[offset : offset + len(page)]

    def erase(self, offset: int) -> None:
        """Set all bits of the sector at `offset`."""
        if offset % SECTOR:
            raise ValueError(f"{offset} is not the beginning of a sector")
        self.erases[offset // SECTOR] += 1
        self._change(offset, b"\xff" * SECTOR)

    def program(self, offset: int, page: bytes | bytearray) -> None:
        """Clear the bits of the page at `offset` that are clear in `page`."""
        if offset % PAGE or len(page) != PAGE:
            raise ValueError(f"{len(page)} bytes at {offset} are not a page")
        before = self.image[offset : offset + PAGE]
        self._change(offset, bytes(a & b for a, b in zip(before, page, strict=True)))

    def _change(self, offset: int, after: bytes) -> None:
        place = slice(offset, offset + len(after))
        cut = self.operations == self._cut_at and self._remains
        self.operations += 1
        self.image[place] = cut(bytes(self.image[place]), after) if cut else after
        if self._path:
            write_bytes(self._path, bytes(self.image), "the flash")
        if cut:
            raise PowerCut
