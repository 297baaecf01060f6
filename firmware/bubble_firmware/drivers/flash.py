"""Flash for the store: MicroPython's block device, files where that is all there is, or memory that forgets.

All three have `size`, `read(offset, page)`, `erase(offset)` of a sector and `program(offset, page)`; a page is a buffer of
256 bytes. Before what takes long, `patience()` is called: a watchdog may want to hear of it.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

SECTOR = 4096
PAGE = 256
_COUNT, _ERASE = 4, 6  # of a MicroPython block device's ioctl


class Sectors:
    """Flash behind a block device of MicroPython that erases and programs as it is told, as `rp2.Flash` does."""

    def __init__(self, device: "Any", patience: "Callable[[], None]"):
        self._device = device
        self._patience = patience
        self.size = device.ioctl(_COUNT, 0) * SECTOR

    def read(self, offset: int, page: bytearray) -> None:
        """Fill `page` with what stands at `offset`."""
        self._device.readblocks(offset // SECTOR, page, offset % SECTOR)

    def erase(self, offset: int) -> None:
        """Set all bits of the sector at `offset`."""
        self._patience()
        self._device.ioctl(_ERASE, offset // SECTOR)

    def program(self, offset: int, page: bytearray) -> None:
        """Clear the bits of the page at `offset` that are clear in `page`."""
        self._patience()
        self._device.writeblocks(offset // SECTOR, page, offset % SECTOR)


class Files:
    """The same in files, one per sector, in the current folder: for a MicroPython whose flash is all file system.

    The file system sees to it that a file changes as a whole when it is closed, or not at all.
    """

    size = 8 * SECTOR

    def __init__(self, patience: "Callable[[], None]"):
        self._patience = patience

    def read(self, offset: int, page: bytearray) -> None:
        """Fill `page` with what stands at `offset`; what has never been written is as if erased."""
        size = 0
        try:
            with open(_name(offset), "rb") as file:
                file.seek(offset % SECTOR)
                size = file.readinto(page)
        except OSError:
            pass
        for index in range(size, len(page)):
            page[index] = 0xFF

    def erase(self, offset: int) -> None:
        """Set all bits of the sector at `offset`."""
        self._patience()
        with open(_name(offset), "wb") as file:
            blank = b"\xff" * PAGE
            for _ in range(SECTOR // PAGE):
                file.write(blank)

    def program(self, offset: int, page: bytearray) -> None:
        """Write the page at `offset`, which has been erased before."""
        self._patience()
        with open(_name(offset), "r+b") as file:
            file.seek(offset % SECTOR)
            file.write(page)


def _name(offset: int) -> str:
    return "store-%d.bin" % (offset // SECTOR)


class Memory:
    """The same in memory, for a board that is simulated."""

    def __init__(self, size: int):
        self.size = size
        self.image = bytearray(size)
        for offset in range(0, size, SECTOR):
            self.erase(offset)

    def read(self, offset: int, page: bytearray) -> None:
        """Fill `page` with what stands at `offset`."""
        for index in range(len(page)):
            page[index] = self.image[offset + index]

    def erase(self, offset: int) -> None:
        """Set all bits of the sector at `offset`."""
        for index in range(offset, offset + SECTOR):
            self.image[index] = 0xFF

    def program(self, offset: int, page: bytearray) -> None:
        """Clear the bits of the page at `offset` that are clear in `page`."""
        for index in range(len(page)):
            self.image[offset + index] &= page[index]
