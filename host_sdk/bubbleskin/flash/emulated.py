"""A computer with one emulated wristband plugged in: its port while a program runs, its drive while the boot loader does.

The `Machine` of tests. All time is emulated time, and power may fail at any moment.
"""

import errno
import shutil
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from bubbleskin import boards
from bubbleskin.errors import LinkError
from bubbleskin.flash.machine import Connection, Machine, Sink
from bubbleskin.sim.rp2040.board import pass_over_carrier
from bubbleskin.sim.rp2040.boot_rom import INFO, BootRom, starts
from bubbleskin.sim.rp2040.bus import SpiBus
from bubbleskin.sim.rp2040.chip import Chip
from bubbleskin.sim.rp2040.mcp3208 import Mcp3208

PORT = "emulated"
FLASH_SIZE = 2 << 20
_STEP = 2e-4
"""Emulated seconds between two looks at what has come."""
_READ_S = 10.0
"""Emulated seconds that a read of the port waits."""


class EmulatedMachine(Machine):
    """The wristband `board` with `flash` in its flash chip, on a computer that shows boot loaders' drives at `drive`."""

    def __init__(self, board: str | Path, flash: bytes | bytearray, drive: Path):
        self.data = boards.load(board)
        """The board's file."""
        self.flash = bytearray(flash).ljust(FLASH_SIZE, b"\xff")
        self.drive = drive
        self.chip: Chip | None = None
        self.rom: BootRom | None = None
        self.busy = False  # another program has the port
        self.written: Callable[[int], bool] = lambda blocks: True  # whether power stays on after so many
        self.on_chip: Callable[[Chip], None] = lambda chip: None  # called with every chip that gets power
        self._passed = 0.0
        self._starts = 0

    # ---- what a person at the table does

    def plug_in(self, bootsel: bool = False) -> None:
        """Give the board power; `bootsel`: with the button held."""
        if bootsel or not starts(self.flash):
            self._show_drive()
            return
        chip = self.chip = Chip(None, self.flash)
        self._starts += 1  # the emulator's random numbers are the same at every start; the firmware adds this one
        chip.mcu.watchdog.scratch_data[0] = self._starts << 8
        data = self.data
        spi = SpiBus(chip, 0)
        for pin, _ in data.CONVERTERS:
            spi.add(Mcp3208(lambda channel: data.SENSOR_ZERO), pin)
        chip.mcu.gpio[data.PIN_ESTOP].set_input_value(False)
        pass_over_carrier(chip, data)
        self.on_chip(chip)

    def pull_out(self) -> None:
        """Take its power. What is in flash stays."""
        self._save_flash()
        self.chip = self.rom = None
        shutil.rmtree(self.drive, ignore_errors=True)

    def _save_flash(self) -> None:
        if self.chip:
            self.flash[:] = self.chip.mcu.flash[:FLASH_SIZE]
            self._passed += self.chip.time

    def _show_drive(self) -> None:
        self.rom = BootRom(self.flash)
        self.drive.mkdir(exist_ok=True)
        (self.drive / "INFO_UF2.TXT").write_text(INFO)

    # ---- the names of Machine

    def ports(self) -> list[str]:
        """The board's port while there is one."""
        return [PORT] if self.chip and self.chip.connected else []

    def drives(self) -> list[Path]:
        """The board's drive while there is one."""
        return [self.drive] if self.rom else []

    def unmounted(self) -> Path | None:
        """Every drive is mounted here."""
        return None

    def open(self, port: str) -> "EmulatedConnection":
        """Open the board's port."""
        if self.busy:
            raise LinkError(f"{port} is in use by another program. Close it, or use `lsof {port}` to find it.")
        if port != PORT or not self.ports():
            raise LinkError(f"There is no {port}. No serial port is here at all.")
        assert self.chip
        self.chip.from_device.clear()
        return EmulatedConnection(self, self.chip)

    def free(self, drive: Path) -> int:
        """Bytes that the boot loader's drive says are free: it always says this."""
        return 128 << 20

    def create(self, path: Path) -> "EmulatedFile":
        """Begin to write a file onto the drive."""
        assert self.rom
        return EmulatedFile(self, self.rom)

    def now(self) -> float:
        """Emulated seconds."""
        return self._passed + (self.chip.time if self.chip else 0.0)

    def sleep(self, seconds: float) -> None:
        """Let emulated time pass."""
        chip = self.chip
        if chip is None:
            self._passed += seconds
            return
        chip.run(seconds)
        if chip.in_boot_loader:
            self._save_flash()
            self.chip = None
            self._show_drive()


class EmulatedConnection(Connection):
    """The board's port, opened: a `Transport`, and what `mpremote` needs of pyserial."""

    name = PORT
    blocks = False

    def __init__(self, machine: EmulatedMachine, chip: Chip):
        self._machine = machine
        self._chip = chip

    @property
    def port(self) -> Any:
        """Itself."""
        return EmulatedPort(self)

    def now(self) -> float:
        """Emulated seconds."""
        return self._machine.now()

    def write(self, data: bytes) -> None:
        """Send bytes to the board."""
        self.check()
        self._chip.write(bytes(data))

    def read(self, timeout: float) -> bytes:
        """Let time pass until something comes, or `timeout` is over."""
        self.wait(timeout, 1)
        data = bytes(self._chip.from_device)
        self._chip.from_device.clear()
        return data

    def wait(self, timeout: float, count: int) -> int:
        """Let time pass until `count` bytes are there, or `timeout` is over; returns how many are there."""
        resets = self._chip.resets
        until = self.now() + timeout
        while len(self._chip.from_device) < count and self.now() < until:
            self.check()
            self._machine.sleep(_STEP)
            if self._chip.resets != resets:
                raise LinkError(f"The connection to {PORT} is lost. Check the cable and connect again.")
        return len(self._chip.from_device)

    def take(self, count: int) -> bytes:
        """The first `count` bytes of those that are there."""
        data = bytes(self._chip.from_device[:count])
        del self._chip.from_device[:count]
        return data

    def check(self) -> None:
        """`LinkError` where the cable has been pulled."""
        if self._machine.chip is not self._chip:
            raise LinkError(f"The connection to {PORT} is lost. Check the cable and connect again.")

    def close(self) -> None:
        """Let go of it; the board runs on."""


class EmulatedPort:
    """The names of pyserial that `mpremote` uses."""

    def __init__(self, connection: EmulatedConnection):
        self._connection = connection
        self._asked = False  # in vain, the last time

    def inWaiting(self) -> int:
        """How many bytes are there; who asks again and again lets time pass."""
        count = self._connection.wait(20 * _STEP if self._asked else 0.0, 1)
        self._asked = not count
        return count

    def read(self, count: int = 1) -> bytes:
        """`count` bytes, fewer where they do not come."""
        self._asked = False
        self._connection.wait(_READ_S, count)
        return self._connection.take(count)

    def write(self, data: bytes) -> int:
        """Send bytes to the board."""
        self._asked = False
        self._connection.write(data)
        return len(data)

    def close(self) -> None:
        """Let go of it; the board runs on."""


class EmulatedFile(Sink):
    """A file on the boot loader's drive: its blocks go where the ROM puts them, and nowhere else."""

    def __init__(self, machine: EmulatedMachine, rom: BootRom):
        self._machine = machine
        self._rom = rom
        self._blocks = 0

    def write(self, data: bytes) -> None:
        """Write whole blocks; `OSError` once the drive has gone."""
        machine = self._machine
        for at in range(0, len(data), 512):
            if machine.rom is not self._rom:
                raise OSError(errno.EIO, "Input/output error")
            if self._rom.write(data[at : at + 512]):
                machine.pull_out()
                machine.plug_in()
            self._blocks += 1
            if not machine.written(self._blocks):
                machine.pull_out()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
