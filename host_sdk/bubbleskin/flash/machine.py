"""The computer that boards are plugged into: its ports, its drives and its clock. A simulated one takes its place in tests."""

import os
import re
import shutil
import string
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from bubbleskin.link.serial import SerialTransport, attached
from bubbleskin.link.transport import Transport

INFO = "INFO_UF2.TXT"
"""The file by which a boot loader's drive is known."""

_LABEL = Path("/dev/disk/by-label/RPI-RP2")


class Connection(Transport):
    """A `Transport` that also hands out the port under it, as pyserial has them."""

    @property
    @abstractmethod
    def port(self) -> Any:
        """What `mpremote` reads and writes: `read`, `write`, `inWaiting`."""


class SerialConnection(SerialTransport, Connection):
    """A serial port of this computer."""


class Sink(ABC):
    """A file being written, block by block to the drive itself, not to a cache."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Write and wait until it is there; `OSError` where it cannot be."""

    def __enter__(self) -> Self:
        return self

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Machine(ABC):
    """What flashing needs of a computer."""

    @abstractmethod
    def ports(self) -> list[str]:
        """Serial ports of boards that run MicroPython, by USB id."""

    @abstractmethod
    def drives(self) -> list[Path]:
        """Drives of boot loaders, of whatever chip."""

    @abstractmethod
    def unmounted(self) -> Path | None:
        """A boot loader's drive that is there and not mounted."""

    @abstractmethod
    def open(self, port: str) -> Connection:
        """Open a port; `LinkError` where that cannot be done."""

    @abstractmethod
    def free(self, drive: Path) -> int:
        """Bytes that are free on a drive."""

    @abstractmethod
    def create(self, path: Path) -> Sink:
        """Begin to write a file."""

    @abstractmethod
    def now(self) -> float:
        """Seconds on the clock of `sleep`."""

    @abstractmethod
    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass."""


class ThisMachine(Machine):
    """The computer that this program runs on."""

    def ports(self) -> list[str]:
        """Serial ports of boards that run MicroPython, by USB id."""
        return attached()

    def drives(self) -> list[Path]:
        """Drives of boot loaders, of whatever chip."""
        return among(mounted())

    def unmounted(self) -> Path | None:
        """A boot loader's drive that is there and not mounted; only Linux tells."""
        return _LABEL if _LABEL.exists() and not self.drives() else None

    def open(self, port: str) -> Connection:
        """Open a port; `LinkError` where that cannot be done."""
        return SerialConnection(port)

    def free(self, drive: Path) -> int:
        """Bytes that are free on a drive."""
        return shutil.disk_usage(drive).free

    def create(self, path: Path) -> Sink:
        """Begin to write a file."""
        return _SyncedFile(path)

    def now(self) -> float:
        """The wall clock's seconds."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)


class _SyncedFile(Sink):
    def __init__(self, path: Path):
        self._file = path.open("wb", buffering=0)

    def write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) or 0 :]
        os.fsync(self._file.fileno())

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._file.close()
        except OSError:  # the drive has gone, as it does when all has come
            if kind is None and sys.platform == "win32":
                raise


def among(folders: Iterable[Path]) -> list[Path]:
    """Those of `folders` that are boot loaders' drives."""
    found = []
    for folder in folders:
        try:
            if (folder / INFO).is_file():
                found.append(folder)
        except OSError:  # not ours to look into, or gone this moment
            continue
    return sorted(found)


def mounted() -> list[Path]:
    """Where drives may be on this system."""
    if sys.platform == "darwin":
        return list(Path("/Volumes").iterdir())
    if sys.platform == "win32":
        return [Path(f"{letter}:\\") for letter in string.ascii_uppercase]
    return fat_mounts(Path("/proc/mounts").read_text())


def fat_mounts(table: str) -> list[Path]:
    """The mount points of FAT file systems in the text of /proc/mounts, which writes a space as \\040."""
    rows = (line.split() for line in table.splitlines())
    points = (row[1] for row in rows if len(row) > 2 and row[2] in ("vfat", "msdos"))
    return [Path(re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), point)) for point in points]
