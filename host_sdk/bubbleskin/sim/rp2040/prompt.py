"""MicroPython's prompt on the emulated chip: run a script there, get what it prints."""

from collections.abc import Callable

from bubbleskin.errors import BubbleskinError
from bubbleskin.sim.rp2040.chip import BOOT_S, Chip

_RAW, _END = b"\x01", b"\x04"
_STEP = 1e-3


class Prompt:
    """The prompt of `chip`, whose firmware must have left it alone: that of `bubbleskin.toolchain.frozen.BARE`."""

    def __init__(self, chip: Chip):
        self.chip = chip
        self._until(lambda: chip.connected, BOOT_S, "appeared on USB")
        chip.write(b"\r\n")  # what it has said before it was connected waits until it is spoken to
        self._until(lambda: b">>> " in chip.from_device, BOOT_S, "shown a prompt")
        chip.from_device.clear()
        chip.write(_RAW)
        self._until(lambda: chip.from_device.endswith(b"CTRL-B to exit\r\n>"), BOOT_S, "shown its raw prompt")

    def run(self, script: str, seconds: float = 10.0) -> str:
        """What `script` prints within so many emulated seconds; names live on. `BubbleskinError` where it fails."""
        chip = self.chip
        chip.from_device.clear()
        chip.write(script.encode() + _END)
        self._until(lambda: chip.from_device.endswith(_END + b">"), seconds, "finished the script")
        said, complaint = bytes(chip.from_device).removeprefix(b"OK").split(_END)[:2]
        if complaint:
            raise BubbleskinError(f"the script failed on the emulated chip:\n{complaint.decode(errors='replace')}")
        return said.decode().replace("\r\n", "\n")

    def _until(self, done: Callable[[], bool], seconds: float, what: str) -> None:
        end = self.chip.time + seconds
        while not done():
            if self.chip.time > end:
                said = bytes(self.chip.from_device[-200:])
                raise BubbleskinError(f"the emulated chip has not {what} within {seconds:g} s. It said {said!r}.")
            self.chip.run(_STEP)
