"""A whole wristband without hardware: the plant, and the firmware that controls it, in lockstep."""

import math
from array import array
from types import ModuleType
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.hal.base import Hal
from bubbleskin.contact.model import CompliantContact
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sim.flash import NorFlash
from bubbleskin.sim.plant import Plant, PlantParameters

BOARDS = ("wristband7", "wristband19")
LINK_IN = 256
"""Bytes of the link that the firmware takes in one tick."""


class Outputs(NamedTuple):
    """What the firmware decided in one tick, for the period after it."""

    pulses: array
    """µs per period: fill and vent valve of each bubble in turn."""
    pump: int
    """0 to 65535."""
    dump: bool
    link: bytes
    """What it sends over the link."""


class Firmware(Protocol):
    """Some interpreter with the firmware in it."""

    def tick(self, counts: array, link: bytes) -> Outputs:
        """One period: sensor counts (the supply's last) and bytes of the link in, decisions out."""

    def reset(self) -> None:
        """Power fails and comes back: start again, with what flash holds."""

    def listen(self, link: bytes, phase_us: int) -> Outputs:
        """Bytes of the link so many µs after a period has begun."""

    def close(self) -> None:
        """End it."""


class InProcessFirmware(Hal):
    """The firmware in this very interpreter. It is also the hardware under it."""

    def __init__(self, board: ModuleType, boot_id: int, flash: NorFlash | None = None):
        super().__init__(board)
        self.boot_id = boot_id
        self.flash = flash or NorFlash()
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
        """Queue a frame; there is always room."""
        self._out += frame[:length]
        return True

    def restart(self, into: int) -> None:
        """Start again after this tick; there is no other boot loader or prompt."""
        self._restarting = True

    def phase_us(self) -> int:
        """Time stands still within a tick; between ticks it is told."""
        return self._phase_us


class SimulatedBoard:
    """A simulated wristband in virtual time: it moves only when it is stepped, and the same calls give the same bytes.

    `name`: wristband7 or wristband19. `seed`: of sensor noise and spread. `spread`: how much walls, valves and
    sensors differ from the nominal and from each other, 0.1 for ± 10 %; 0 matches the board's tables. The
    reservoir starts full, as on a board that has been powered for a while. `contact`: whether bubbles push each
    other, as real ones do; without it each is alone, which shows what the control law itself does. `firmware`: what
    runs the firmware; None is this interpreter, with `flash` for its store.
    """

    def __init__(
        self,
        name: str = "wristband7",
        *,
        seed: int = 0,
        spread: float = 0.0,
        contact: bool = True,
        firmware: Firmware | None = None,
        flash: NorFlash | None = None,
    ):
        self.data = load_board(name)
        if not (math.isfinite(spread) and 0 <= spread <= 0.5):
            raise InvalidInput(f"spread is {spread}; give a share from 0 to 0.5, such as 0.1 for ± 10 %.")
        if seed < 0:
            raise InvalidInput(f"seed is {seed}; give a whole number from 0.")
        n = self.data.BUBBLES
        self.name = name
        self.tick_s: float = self.data.TICK_US * 1e-6
        self.plant = make_plant(name, n, seed, spread, contact)
        self.firmware = firmware or InProcessFirmware(self.data, seed + 1, flash)
        self.to_device = bytearray()
        self.from_device = bytearray()
        self.pulses = np.zeros((n, 2))
        """Seconds that fill and vent valve of each bubble are energised in the period now beginning, (n, 2)."""
        self.pulses[:, 1] = self.tick_s
        self._pump = 0.0
        self._dump = False
        self._counts = array("H", bytes(2 * (n + 1)))
        self._bubble_counts = np.frombuffer(self._counts, np.uint16)[:n]  # the same memory
        self._decided: array | None = None  # what `pulses` were made from
        self._owed = 0.0

    @property
    def time(self) -> float:
        """Virtual seconds since the start."""
        return self.plant.time

    @property
    def height_mm(self) -> NDArray[np.float64]:
        """The true heights, which the firmware can only estimate, (n,)."""
        return self.plant.height_mm

    def step(self, dt: float) -> None:
        """Let `dt` virtual seconds pass, in whole ticks; what is left over comes with the next step."""
        self._owed += dt
        while self._owed > self.tick_s * (1 - 1e-9):
            self._owed -= self.tick_s
            self.tick()

    def tick(self) -> None:
        """One period: the firmware reads the sensors and decides, while the plant goes on as decided before."""
        self._bubble_counts[:] = self.plant.sense()
        self._counts[-1] = self.plant.sense_supply()
        link = bytes(self.to_device[:LINK_IN])
        del self.to_device[:LINK_IN]
        outputs = self.firmware.tick(self._counts, link)
        self.plant.advance(self.tick_s, self.pulses[:, 0], self.pulses[:, 1], self._pump, self._dump)
        self._take(outputs)

    def listen(self, phase_us: int) -> None:
        """Between two ticks, `phase_us` after the last: the firmware answers what has come over the link."""
        link = bytes(self.to_device[:LINK_IN])
        del self.to_device[:LINK_IN]
        self._take(self.firmware.listen(link, phase_us))

    def _take(self, outputs: Outputs) -> None:
        self.from_device += outputs.link
        if outputs.pulses != self._decided:
            self._decided = outputs.pulses
            pulses = np.frombuffer(outputs.pulses, np.uint16).reshape(-1, 2)
            np.minimum(pulses * 1e-6, self.tick_s, out=self.pulses)
        self._pump = outputs.pump / 65535
        self._dump = outputs.dump

    def reset(self) -> None:
        """Power fails and comes back: the firmware starts again, with what flash holds; bytes under way are lost."""
        self.to_device.clear()
        self.from_device.clear()
        self.pulses[:] = 0.0, self.tick_s
        self._pump, self._dump, self._decided = 0.0, False, None
        self.firmware.reset()

    def inject(self, fault: str, bubble: int, value: float = 1.0) -> None:
        """Give a bubble a fault, as of `bubbleskin.sim.plant.Plant.inject`; a value of 0 takes it away."""
        self.plant.inject(fault, bubble, value)

    def close(self) -> None:
        """End the firmware."""
        self.firmware.close()


def make_plant(name: str, n: int, seed: int, spread: float, contact: bool) -> Plant:
    """The bubbles of board `name`; the rest as of `SimulatedBoard`."""
    parameters = PlantParameters.spread(n, spread, seed) if spread else PlantParameters.nominal(n)
    return Plant(parameters, seed=seed, contact=CompliantContact(Layout.of_board(name, n)) if contact else None)


def load_board(name: str) -> ModuleType:
    """The data of a board that can be simulated."""
    if name not in BOARDS:
        raise InvalidInput(f"There is no board {name!r} to simulate; there are {' and '.join(BOARDS)}.")
    return boards.load(name)
