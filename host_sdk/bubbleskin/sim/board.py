"""Whole wristbands without hardware: what each of them is, and the one whose firmware is stepped in lockstep."""

import os
from abc import ABC, abstractmethod
from array import array
from dataclasses import replace
from pathlib import Path
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from bubble_firmware.hal.lockstep import LINK_IN
from bubbleskin import boards, checks
from bubbleskin.errors import InvalidInput
from bubbleskin.sim import plant_file
from bubbleskin.sim.failures import Failures
from bubbleskin.sim.firmware import Firmware, InProcessFirmware, Outputs
from bubbleskin.sim.flash import NorFlash
from bubbleskin.sim.history import History, TraceFile
from bubbleskin.sim.impairment import Impairment
from bubbleskin.sim.recipe import PlantOptions, make_plant
from bubbleskin.sim.wiring import Wires, Wiring


class Simulated(ABC):
    """A simulated wristband in virtual time: it moves only when it is stepped, and the same calls give the same bytes.

    What the link, the simulator's server and a script need of one, whatever runs its firmware. `board`, `seed`, `spread`,
    `contact`, `wiring` and `options` are those of `SimulatedBoard`.
    """

    def __init__(
        self,
        board: str | Path,
        *,
        seed: int = 0,
        spread: float = 0.0,
        contact: bool = True,
        wiring: Wiring | None = None,
        **options: Unpack[PlantOptions],
    ):
        self.data = boards.load(board)
        """The board's file."""
        spread = checks.number("spread", spread, 0.0, 0.5)
        seed = checks.whole("seed", seed, 0, checks.SEED_MAX)
        self.name: str = self.data.NAME
        self.tick_s: float = self.data.TICK_US * 1e-6
        """Length of one control period, s."""
        self.contact = contact
        """Whether its bubbles push each other."""
        self.plant = make_plant(self.data, seed, spread, contact, **options)
        self.wiring = _wiring(wiring, options.get("plant"), self.data.BUBBLES)
        """What of it is wired wrongly."""
        self.line: Impairment | None = None
        """How its line is impaired, where that was injected."""
        self.clock_pace = 1.0
        """Seconds of the host's clock in one of the device's, where that was injected."""
        self._failures = Failures(self)
        self.to_device = bytearray()
        """Bytes of the link that the firmware has not read yet."""
        self.from_device = bytearray()
        """Bytes of the link that the firmware has sent and nobody has taken yet."""
        self.history: History | None = None
        """What has reached its firmware since power came, where that is kept: what `Skin.record(full=True)` writes."""
        self._seed = seed
        self._asked_s = 0.0  # of `step`, less than a tick

    @property
    @abstractmethod
    def time(self) -> float:
        """Virtual seconds since the start."""

    @property
    @abstractmethod
    def height_mm(self) -> NDArray[np.float64]:
        """The true heights, which the firmware can only estimate: each bubble's top above the base plane, mm, (n,)."""

    @property
    def alone_mm(self) -> NDArray[np.float64]:
        """How high each bubble would truly stand if no neighbour lifted it, mm, (n,): what the firmware can know."""
        return self.plant.alone_mm

    def write_plant(self, path: str | Path) -> None:
        """Write every figure of the plant to the file `path`, what its walls have been through included.

        `sim://BOARD?plant=PATH` has the same plant, with the same `seed` the same noise too. Raises `InvalidInput`.
        """
        plant = self.plant
        figures = replace(plant.parameters, conditioned=np.maximum(plant.largest_stretch, 1.0))
        about = f"The plant of {self.name} with seed={self._seed}, after {plant.time:.3f} s"
        plant_file.write(path, figures, about, self.wiring)

    no_history = "its history is not kept. Connect without history=0, or call keep_history() before its first step"
    """Why it cannot be recorded in full where `history` is None."""

    def record(self, path: str | os.PathLike[str]) -> TraceFile:
        """Begin a full recording, see `Skin.record`; `InvalidInput` where that cannot be."""
        if self.history is None:
            raise InvalidInput(f"This {self.name} cannot be recorded in full: {self.no_history}.")
        return self.history.record(path)

    @property
    @abstractmethod
    def pulses(self) -> NDArray[np.float64]:
        """Seconds for which fill and vent valve of each bubble are open in the period now beginning, (n, 2)."""

    def step(self, dt: float) -> None:
        """Let `dt` virtual seconds pass, in whole ticks; what is left over comes with the next step."""
        self._asked_s += dt
        while self._asked_s > self.tick_s * (1 - 1e-9):
            self._asked_s -= self.tick_s
            self.tick()

    @abstractmethod
    def tick(self) -> None:
        """Let one control period pass."""

    @abstractmethod
    def listen(self, phase_us: int) -> None:
        """Let the firmware answer what has come over the link, `phase_us` µs after the last tick; no time passes."""

    def inject(self, fault: str, number: int = 0, value: str | float = 1.0) -> None:
        """Make a part fail: `inject("sensor", 3, "stuck")`, by the words of `bubbleskin.sim.failures`; "healthy" mends it.

        Or one of `Plant.inject`, with a number for its value: `inject("leak", 3, 5e-8)`; 0 mends it. Or `inject("estop")`, which
        presses the emergency stop. `number` is the bubble's. Raises `InvalidInput`.
        """
        number = checks.whole("The number of the bubble", number, 0, self.data.BUBBLES - 1)
        checks.text("fault", fault)
        if isinstance(value, str):
            self._failures.inject(fault, number, value)
        else:
            self._inject(fault, number, checks.number("value", value))

    @abstractmethod
    def _inject(self, fault: str, number: int, value: float) -> None:
        """Make something fail that has a value."""

    def _loop_is_open(self, pressed: bool) -> bool:
        """Whether the loop through the emergency stop is open, by its contact."""
        return pressed == (self.wiring.estop == "closed")

    @abstractmethod
    def close(self) -> None:
        """End the firmware."""


def _wiring(asked: Wiring | None, plant: str | Path | None, n: int) -> Wiring:
    """What was asked for, or what stands in the plant's file; `InvalidInput` for both."""
    filed = plant_file.read_wiring(plant, n) if plant is not None else Wiring()
    if asked is None or asked.right:
        return filed
    if not filed.right:
        raise InvalidInput(f"The plant {plant} says how the board is wired; leave {', '.join(asked.said)} out.")
    return asked.checked(n)


class SimulatedBoard(Simulated):
    """A simulated wristband whose firmware and plant are stepped in lockstep, in virtual time.

    `board`: its name, or the path of its file. `seed`: of sensor noise and spread. `spread`: how much walls, valves and
    sensors differ from the nominal and from each other, 0.1 for ± 10 %; 0 matches the board's tables. The
    reservoir starts full, as on a board that has been powered for a while. `contact`: whether bubbles push each
    other, as real ones do; without it each is alone, which shows what the control law itself does. `firmware`: what
    runs the firmware; None is this interpreter, with `flash` for its store. `wiring`: what is wired wrongly.
    `options`: `PlantOptions`, such as `rubber="real"`.
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
        wiring: Wiring | None = None,
        **options: Unpack[PlantOptions],
    ):
        super().__init__(board, seed=seed, spread=spread, contact=contact, wiring=wiring, **options)
        n = self.data.BUBBLES
        self._wires = None if self.wiring.right else Wires(self.wiring, n)
        self._pressed = False  # the emergency stop
        self.firmware = firmware or InProcessFirmware(self.data, self._seed + 1, flash)
        if self._loop_is_open(pressed=False):
            self.firmware.open_loop(True)
        self._pulses = np.zeros((n, 2))
        self._pulses[:, 1] = self.tick_s
        self._pump = 0.0  # duty, 0 to 1
        self._dump = False
        self._counts = array("H", bytes(2 * (n + 1)))
        self._sensed = np.frombuffer(self._counts, np.uint16)  # the same memory
        self._decided: array | None = None  # what `_pulses` were made from

    def keep_history(self) -> None:
        """Keep what reaches the firmware from now on, for full recordings; the board must not have been stepped yet."""
        if self.plant.time:
            raise InvalidInput(f"A history begins when power comes, and that was {self.plant.time:g} s ago.")
        self.history = History(self.data, self.firmware)
        if self._loop_is_open(pressed=False):
            self.history.loop(True)

    @property
    def time(self) -> float:
        """Virtual seconds since the start."""
        return self.plant.time

    @property
    def height_mm(self) -> NDArray[np.float64]:
        """The true heights, which the firmware can only estimate: each bubble's top above the base plane, mm, (n,)."""
        return self.plant.height_mm

    @property
    def pulses(self) -> NDArray[np.float64]:
        """Seconds for which fill and vent valve of each bubble are energised in the period now beginning, (n, 2)."""
        return self._pulses

    def tick(self) -> None:
        """One period: the firmware reads the sensors and decides, while the plant goes on as decided before."""
        wires = self._wires
        self.plant.read(self._sensed)
        if wires:
            self._sensed[:-1] = self._sensed[wires.channels]
        link = self._link_in()
        outputs = self.firmware.tick(self._counts, link)
        if self.history:
            self.history.tick(self._counts, link, outputs)
        if self._pressed:
            self._lose_current()
        if wires:
            wires.advance(self.plant, self.tick_s, self._pulses, self._pump, self._dump)
        else:
            self.plant.advance(self.tick_s, self._pulses[:, 0], self._pulses[:, 1], self._pump, self._dump)
        self._take(outputs)

    def listen(self, phase_us: int) -> None:
        """Between two ticks, `phase_us` µs after the last: the firmware answers what has come over the link."""
        link = self._link_in()
        outputs = self.firmware.listen(link, phase_us)
        if self.history:
            self.history.listen(phase_us, link, outputs)
        self._take(outputs)

    def _link_in(self) -> bytes:
        link = bytes(self.to_device[:LINK_IN])
        del self.to_device[:LINK_IN]
        return link

    def _take(self, outputs: Outputs) -> None:
        self.from_device += outputs.link
        if outputs.pulses != self._decided:
            self._decided = outputs.pulses
            pulses = np.frombuffer(outputs.pulses, np.uint16).reshape(-1, 2)
            np.minimum(pulses * 1e-6, self.tick_s, out=self._pulses)
        self._pump = outputs.pump / 65535
        self._dump = outputs.dump

    def reset(self) -> None:
        """Power fails and comes back: the firmware starts again, with what flash holds; bytes under way are lost."""
        self.to_device.clear()
        self.from_device.clear()
        self._lose_current()
        self.firmware.reset()
        if self.history:
            self.history.reset()

    def _lose_current(self) -> None:
        """Valves and pump are without current: fill shut, vent open."""
        self._pulses[:] = 0.0, self.tick_s
        self._pump, self._dump, self._decided = 0.0, False, None

    def _inject(self, fault: str, number: int, value: float) -> None:
        if fault == "estop":
            is_open = self._loop_is_open(value != 0)
            self.firmware.open_loop(is_open)
            if self.history:
                self.history.loop(is_open)
            self._pressed = value != 0
        else:
            self.plant.inject(fault, number, value)

    def close(self) -> None:
        """End the firmware."""
        if self.history:
            self.history.close()
        self.firmware.close()
