"""A whole wristband without hardware: the plant, and the firmware that controls it, in lockstep."""

import math
from array import array
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from bubble_firmware.hal.lockstep import LINK_IN
from bubbleskin import boards
from bubbleskin.contact.model import CompliantContact
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sim.firmware import Firmware, InProcessFirmware, Outputs
from bubbleskin.sim.flash import NorFlash
from bubbleskin.sim.plant import Plant, PlantParameters


class SimulatedBoard:
    """A simulated wristband in virtual time: it moves only when it is stepped, and the same calls give the same bytes.

    `board`: its name, or the path of its file. `seed`: of sensor noise and spread. `spread`: how much walls, valves and
    sensors differ from the nominal and from each other, 0.1 for ± 10 %; 0 matches the board's tables. The
    reservoir starts full, as on a board that has been powered for a while. `contact`: whether bubbles push each
    other, as real ones do; without it each is alone, which shows what the control law itself does. `firmware`: what
    runs the firmware; None is this interpreter, with `flash` for its store.
    """

    def __init__(
        self,
        board: str | Path = boards.DEFAULT,
        *,
        seed: int = 0,
        spread: float = 0.0,
        contact: bool = True,
        firmware: Firmware | None = None,
        flash: NorFlash | None = None,
    ):
        self.data = boards.load(board)
        if not (math.isfinite(spread) and 0 <= spread <= 0.5):
            raise InvalidInput(f"spread is {spread}; give a share from 0 to 0.5, such as 0.1 for ± 10 %.")
        if seed < 0:
            raise InvalidInput(f"seed is {seed}; give a whole number from 0.")
        n = self.data.BUBBLES
        self.name: str = self.data.NAME
        self.tick_s: float = self.data.TICK_US * 1e-6
        self.plant = make_plant(self.data, seed, spread, contact)
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


def make_plant(data: ModuleType, seed: int, spread: float, contact: bool) -> Plant:
    """The bubbles of a board, where its layout says; the rest as of `SimulatedBoard`."""
    n = data.BUBBLES
    parameters = PlantParameters.spread(n, spread, seed) if spread else PlantParameters.nominal(n)
    layout = Layout.from_um(data.LAYOUT, data.PITCH_UM)
    return Plant(parameters, seed=seed, contact=CompliantContact(layout) if contact else None)
