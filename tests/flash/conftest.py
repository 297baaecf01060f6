"""A computer with a wristband whose firmware runs in this interpreter, above flash that the boot ROM's rules write."""

import errno
import shutil
import struct
from pathlib import Path
from types import SimpleNamespace

import crcmod
import pytest

from bubbleskin import boards
from bubbleskin.errors import LinkError
from bubbleskin.flash import uf2
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware
from bubbleskin.sim.rp2040 import boot_rom
from bubbleskin.sim.transport import SimulatedTransport

PORT = "/dev/ttyBubble"


def image(seed: int, pages: int) -> uf2.Image:
    """Pages of noise, the first with the checksum that the ROM wants."""
    noise = [bytes((seed + 31 * page + 7 * at) & 0xFF for at in range(uf2.PAGE)) for page in range(pages)]
    check = crcmod.mkCrcFun(0x104C11DB7, initCrc=0xFFFFFFFF, rev=False)(noise[0][:-4])
    return uf2.Image((noise[0][:-4] + struct.pack("<I", check), *noise[1:]))


OLD, NEW, BIG = image(2, 60), image(1, 60), image(3, 70)


class Firmware(InProcessFirmware):
    """The firmware, which can be asked to start again."""

    into: int | None = None

    def restart(self, into: int) -> None:
        self.into = into


class Connection(SimulatedTransport):
    @property
    def port(self):
        raise AssertionError("there is no MicroPython here")


class Computer:
    """`programs`: which board's firmware an image is; of others nothing is heard. What a person does: `plug_in`."""

    def __init__(self, drive: Path):
        self.drive = drive
        self.flash = bytearray(OLD.data).ljust(2 << 20, b"\xff")
        self.programs = {OLD.data: "wristband7", NEW.data: "wristband7", BIG.data: "wristband19"}
        self.board: SimulatedBoard | None = None
        self.rom: boot_rom.BootRom | None = None
        self.time = 0.0
        self.boots = 0
        self.more_ports: list[str] = []
        self.more_drives: list[Path] = []
        self.hidden: Path | None = None
        self.mounts = True
        self.busy = False
        self.space = 128 << 20
        self.blocks = 0
        self.fail_after: tuple[int, int] | None = None  # blocks, errno
        self.cut_after: int | None = None  # blocks after which power is lost

    def plug_in(self, bootsel: bool = False) -> "Computer":
        self.board = self.rom = None
        shutil.rmtree(self.drive, ignore_errors=True)
        if bootsel or not boot_rom.starts(self.flash):
            self.rom = boot_rom.BootRom(self.flash)
            self.drive.mkdir()
            (self.drive / "INFO_UF2.TXT").write_text(boot_rom.INFO)
            return self
        for data, name in self.programs.items():
            if self.flash.startswith(data):
                self.boots += 1
                self.board = SimulatedBoard(name, firmware=Firmware(boards.load(name), self.boots))
        return self

    def pull_out(self) -> None:
        self.board = self.rom = None
        shutil.rmtree(self.drive, ignore_errors=True)

    # Machine

    def ports(self) -> list[str]:
        return [*([PORT] if self.board else []), *self.more_ports]

    def drives(self) -> list[Path]:
        return [*([self.drive] if self.rom and self.mounts else []), *self.more_drives]

    def unmounted(self) -> Path | None:
        return self.hidden

    def open(self, port: str) -> Connection:
        if self.busy:
            raise LinkError(f"{port} is in use by another program. Close it.")
        if port != PORT or not self.board:
            raise LinkError(f"There is no {port}.")
        return Connection(self.board, port)

    def free(self, drive: Path) -> int:
        return self.space

    def create(self, path: Path) -> "File":
        if self.fail_after and self.fail_after[0] == 0:
            raise OSError(self.fail_after[1], "so it is")
        return File(self, self.rom)

    def now(self) -> float:
        return self.time + (self.board.time if self.board else 0.0)

    def sleep(self, seconds: float) -> None:
        self.time += seconds
        if self.board:
            into = self.board.firmware.into
            if into is not None:
                self.time += self.board.time
                self.plug_in(bootsel=into == 1)


class File:
    def __init__(self, computer: Computer, rom):
        self.computer = computer
        self.rom = rom

    def write(self, data: bytes) -> None:
        computer = self.computer
        for at in range(0, len(data), uf2.BLOCK):
            if computer.fail_after and computer.blocks == computer.fail_after[0]:
                raise OSError(computer.fail_after[1], "so it is")
            if computer.rom is not self.rom:
                raise OSError(errno.EIO, "Input/output error")
            if self.rom.write(data[at : at + uf2.BLOCK]):
                computer.plug_in()
            computer.blocks += 1
            if computer.blocks == computer.cut_after:
                computer.pull_out()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


@pytest.fixture
def images():
    """Firmware of a wristband7, old and new, and one of a wristband19."""
    return SimpleNamespace(old=OLD, new=NEW, big=BIG)


@pytest.fixture
def computer(tmp_path):
    return Computer(tmp_path / "RPI-RP2")


@pytest.fixture
def file(tmp_path):
    """`file(image, name)`: the path of a UF2 file as the build makes it."""

    def write(image: uf2.Image, name: str = "it.uf2") -> Path:
        n = len(image.pages)
        path = tmp_path / name
        path.write_bytes(
            b"".join(uf2.block(i, n, uf2.FLASH_AT + uf2.PAGE * i, page) for i, page in enumerate(image.pages))
        )
        return path

    return write
