"""The firmware as the simulator sees it: sensor counts and bytes of the link in, valve pulses and bytes out, tick by tick."""

from abc import ABC, abstractmethod
from array import array
from types import ModuleType
from typing import NamedTuple

from bubble_firmware.app import App
from bubble_firmware.hal.base import Hal
from bubble_firmware.hal.lockstep import LINK_OUT
from bubble_protocol.schema.faults import ESTOP
from bubbleskin.errors import InvalidInput
from bubbleskin.sim import jit
from bubbleskin.sim.flash import NorFlash


class Outputs(NamedTuple):
    """What the firmware decided in one tick, for the period after it."""

    pulses: array
    """µs per period: fill and vent valve of each bubble in turn."""
    pump: int
    """0 to 65535."""
    dump: bool
    link: bytes
    """What it sends over the link."""


class Firmware(ABC):
    """The firmware in some interpreter, as the simulator drives it.

    `interpreter`: which one, "cpython" or "micropython". `boot_id` and `boot_ticks`: those of its first boot, see `Hal`.
    `flash_at_start`: what flash held then.
    """

    interpreter = "cpython"
    boot_id: int
    boot_ticks: int
    flash_at_start: bytes

    def flash_image(self) -> bytes | None:
        """What flash holds now; None where that cannot be seen."""
        return None

    @abstractmethod
    def tick(self, counts: array, link: bytes) -> Outputs:
        """One period: sensor counts (the supply's last) and bytes of the link in, decisions out."""

    @abstractmethod
    def listen(self, link: bytes, phase_us: int) -> Outputs:
        """Bytes of the link, `phase_us` µs after a period has begun."""

    def open_loop(self, is_open: bool) -> None:
        """The loop through the emergency stop is open from now on, as when the button is pressed, or closed.

        As it stands here, `InvalidInput`: in lockstep with another process there are no pins.
        """
        raise InvalidInput(
            "What runs the firmware here has no pin for an emergency stop: it cannot be pressed or wired. Use sim:// or rp2040://."
        )

    @abstractmethod
    def reset(self) -> None:
        """Power fails and comes back: start again, with what flash holds."""

    @abstractmethod
    def close(self) -> None:
        """End it."""


class InProcessFirmware(Firmware, Hal):
    """The firmware in this very interpreter. It is also the hardware under it."""

    def __init__(self, board: ModuleType, boot_id: int, flash: NorFlash | None = None, boot_ticks: int = -1):
        jit.enable()
        super().__init__(board)
        self.boot_id = boot_id
        self.boot_ticks = boot_ticks
        self.flash: NorFlash = flash or NorFlash()
        self.flash_at_start = self.flash_image()
        self._restarting = False
        self._counts = array("H", bytes(2 * (board.BUBBLES + 1)))
        self._pulses = array("H", bytes(4 * board.BUBBLES))
        self._tick_us = board.TICK_US
        self._pump = 0
        self._dump = False
        self._in = b""
        self._out = bytearray()
        self._phase_us = 0
        self.app = App(board, self)

    def tick(self, counts: array, link: bytes) -> Outputs:
        """See `Firmware`."""
        self._counts = counts
        self._in = link
        self._out.clear()
        self._phase_us = 0
        self.app.tick()
        if self._restarting:
            self.reset()
        return Outputs(self._pulses, self._pump, self._dump, bytes(self._out))

    def flash_image(self) -> bytes:
        """See `Firmware`."""
        return bytes(self.flash.image)

    def open_loop(self, is_open: bool) -> None:
        """See `Firmware`."""
        self.active_faults = self.active_faults | ESTOP if is_open else self.active_faults & ~ESTOP

    def reset(self) -> None:
        """See `Firmware`."""
        self._restarting = False
        self.boot_id += 1
        self.app = App(self.board, self)

    def listen(self, link: bytes, phase_us: int) -> Outputs:
        """See `Firmware`."""
        self._in = link
        self._out.clear()
        self._phase_us = phase_us
        self.app.listen()
        return Outputs(self._pulses, self._pump, self._dump, bytes(self._out))

    def close(self) -> None:
        """Nothing to end."""

    # The hardware.

    def read_sensors(self, counts: array) -> None:
        """Fill in the counts of this tick."""
        counts[:] = self._counts

    def write_outputs(self, pulses: array, pump: int, dump: int) -> None:
        """Set the outputs of the next period."""
        self._pulses, self._pump, self._dump = pulses[:], pump, bool(dump)

    def safe_outputs(self) -> None:
        """Fill closed, vent open, pump off."""
        self._pulses = array("H", [0, self._tick_us] * (len(self._pulses) // 2))
        self._pump, self._dump = 0, False

    def receive(self, buffer: bytearray) -> int:
        """Bytes that have come over the link."""
        buffer[: len(self._in)] = self._in
        return len(self._in)

    def send(self, frame: bytearray, length: int) -> bool:
        """Queue a frame; False where it does not fit: there is as much room as in lockstep."""
        if len(self._out) + length > LINK_OUT:
            return False
        self._out += frame[:length]
        return True

    def restart(self, into: int) -> None:
        """Start again after this tick; there is no other boot loader or prompt."""
        self._restarting = True

    def phase_us(self) -> int:
        """Time stands still within a tick; between ticks it is told."""
        return self._phase_us
