"""What lives through a full recording: the firmware in this process, or one in another, of any version."""

import sys
import tempfile
import zlib
from abc import ABC, abstractmethod
from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType

from bubbleskin import boards
from bubbleskin.errors import InvalidInput
from bubbleskin.replays.compare import NOTHING, Decided
from bubbleskin.sim.firmware import Firmware, InProcessFirmware, Outputs
from bubbleskin.sim.flash import NorFlash
from bubbleskin.sim.micropython import HEAP, LockstepFirmware, board_import
from bubbleskin.sim.trace_file import LOOP, POWER_FAILED, TICK, Call, Head
from bubbleskin.toolchain.interpreter import own_micropython
from bubbleskin.toolchain.unix import micropython

_PACKAGES = ("bubble_protocol", "bubble_firmware")

# As `bubble_firmware.main.lockstep` does, with flash as it was. CPython has no `gc.threshold`, and needs none.
_PROGRAM = """
import gc, sys
if hasattr(gc, "threshold"):
    gc.threshold(16384)
    sys.path[:] = {path!r}
else:
    sys.path[:0] = {path!r}
{import_board}
from bubble_firmware.app import App, run
from bubble_firmware.drivers.flash import Memory
from bubble_firmware.hal.lockstep import LockstepHal
if hasattr(gc, "threshold"):
    gc.threshold(-1)
hal = LockstepHal(board, {boot_id}, {boot_ticks})
hal.flash = Memory({size})
with open({flash!r}, "rb") as file:
    file.readinto(hal.flash.image)
while not hal.ended:
    app = App(board, hal)
    gc.collect()
    run(app)
    del app
    gc.collect()
"""


class Player(ABC):
    """Something that lives through calls."""

    @abstractmethod
    def play(self, calls: Iterable[Call]) -> Iterator[tuple[Call, Decided]]:
        """Every call, with what it leads to."""

    @abstractmethod
    def close(self) -> None:
        """End it."""


class FirmwarePlayer(Player):
    """A `Firmware` that lives through calls."""

    def __init__(self, firmware: Firmware):
        self._firmware = firmware

    def play(self, calls: Iterable[Call]) -> Iterator[tuple[Call, Decided]]:
        """See `Player`."""
        firmware = self._firmware
        for call in calls:
            if call.kind == POWER_FAILED:
                firmware.reset()
                yield call, Decided((), 0, False, self._flash_crc())
            elif call.kind == LOOP:
                firmware.open_loop(bool(call.phase_us))
                yield call, NOTHING
            elif call.kind == TICK:
                yield call, _decided(firmware.tick(_counts(call.counts), call.link))
            else:
                yield call, _decided(firmware.listen(call.link, call.phase_us))

    def _flash_crc(self) -> bytes:
        image = self._firmware.flash_image()
        return b"" if image is None else zlib.crc32(image).to_bytes(4, "little")

    def close(self) -> None:
        """See `Player`."""
        self._firmware.close()


class OtherProcess(LockstepFirmware):
    """The firmware of the sources in `path` in an interpreter of its own, `on` "cpython" or "micropython"."""

    def __init__(self, head: Head, data: ModuleType, on: str, path: list[str]):
        self.interpreter = on
        own = boards.own_file(data)
        self._folder = tempfile.TemporaryDirectory()
        flash = Path(self._folder.name) / "flash"
        flash.write_bytes(head.flash)
        program = _PROGRAM.format(
            path=[*path, str(own.parent)] if own else path,
            import_board=board_import(data),
            boot_id=head.boot_id,
            boot_ticks=head.boot_ticks,
            size=len(head.flash),
            flash=str(flash),
        )
        if on == "micropython":
            command = [str(own_micropython() or micropython()), "-X", f"heapsize={HEAP}"]
        else:
            command = [sys.executable, "-IBu"]
        super().__init__([*command, "-c", program], data.BUBBLES, "The firmware that replays")

    def close(self) -> None:
        """End the process."""
        super().close()
        self._folder.cleanup()


def in_process(head: Head, data: ModuleType) -> FirmwarePlayer:
    """This bubbleskin's own firmware, in this interpreter."""
    flash = NorFlash(len(head.flash))
    flash.image[:] = head.flash
    return FirmwarePlayer(InProcessFirmware(data, head.boot_id, flash, head.boot_ticks))


def source_folders(firmware: Path) -> list[str]:
    """The folders in which the packages of another version lie, of which `firmware` is a checkout or an installation."""
    found = []
    for package in _PACKAGES:
        places = [
            firmware / room
            for room in ("", "protocol", "firmware")
            if (firmware / room / package / "__init__.py").is_file()
        ]
        if not places:
            raise InvalidInput(
                f"{firmware} has no {package}; give the folder of a checkout, with firmware/ and protocol/ in it, "
                "or one that holds bubble_firmware and bubble_protocol."
            )
        found.append(str(places[0].absolute()))
    return list(dict.fromkeys(found))


def _counts(data: bytes) -> array:
    counts = array("H", data)
    if sys.byteorder == "big":
        counts.byteswap()
    return counts


def _decided(outputs: Outputs) -> Decided:
    return Decided(tuple(outputs.pulses), outputs.pump, outputs.dump, outputs.link)
