"""The simulated wristband without its electronics: bubbles, lines, valves, reservoir, pump and sensors.

`Plant.advance` steps it by an explicit time; nothing here reads a clock, and the same calls give the same
bits. Importing this module imports numba, and the first steps compile two functions: a few seconds, once.
"""

import math
from dataclasses import astuple
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin.contact.energy import BUBBLE, SPRINGS
from bubbleskin.errors import InvalidInput
from bubbleskin.membrane.balloon import yeoh_pressure
from bubbleskin.sim import devices, kernel, records
from bubbleskin.sim.live import Live
from bubbleskin.sim.parameters import RUBBERS, PlantParameters, Supply
from bubbleskin.sim.pneumatics import REFERENCE_TEMPERATURE, VISCOSITY_EXPONENT
from bubbleskin.sim.real import kernel as real_kernel
from bubbleskin.sim.real import rest as real_rest

if TYPE_CHECKING:
    from bubbleskin.contact.model import CompliantContact

__all__ = ["Plant", "PlantParameters", "Supply"]

SUBSTEP = 50e-6
"""Longest step of the integration, s: heights are then right to 1 µm, of bubbles that touch at rest; while those move, to 10 µm.

A bubble that a push flings to another place goes there some ms earlier or later than with finer steps, and is up to 0.6 mm
elsewhere on the way. Where it could fall to either side, the step may decide, as does all else that is small.

Stable up to twice the settling time of the node: 160 µs against the tube, 100 µs with both valves open,
25 µs with both open and no restrictors (C = 0.03 dm³/(s·bar)), which needs a shorter step; real rubber takes that by itself.
"""

SHORTEST = 2e-6
"""Shortest step, s: 25 times the work."""

REACH = 18e-3
"""Bubbles whose barbs are further apart never meet, m: past a radius of 9 mm they slip off."""

BARBS = 10e-6
"""How far barbs are from where they should be, RMS in m. A perfectly even ring would never fall to one side."""

PA_PER_COUNT = (17.0, 25.0)
"""Of the sensors of bubbles and reservoir."""


def _address(array: NDArray[Any]) -> int:
    if not array.flags.c_contiguous:
        raise InvalidInput("the plant's arrays must lie in one piece")
    return array.ctypes.data


class Plant:
    """`len(parameters.mu)` bubbles at rest, at atmospheric pressure, on a reservoir at `supply_pa` gauge.

    By default the reservoir is that of a board which has been powered for a while. `seed` is that of the
    sensors' noise. `contact` says where the bubbles are and how they push each other; without one, each is alone. Real rubber
    takes of it where the bubbles are, and pushes with the springs of `parameters`.
    Attributes: `parameters`, and `time` in s since the start.
    """

    def __init__(
        self,
        parameters: PlantParameters,
        seed: int = 0,
        supply_pa: float = 60e3,
        substep: float = SUBSTEP,
        contact: "CompliantContact | None" = None,
    ):
        if parameters.rubber not in RUBBERS:
            raise InvalidInput(f"rubber is {parameters.rubber!r}; choose one of {', '.join(RUBBERS)}.")
        n = len(parameters.mu)
        self.parameters = parameters
        self.time = 0.0
        self._real = parameters.rubber == "real"
        self._substep = min(substep, real_rest.longest_step(parameters, contact is not None)) if self._real else substep
        if self._substep < SHORTEST:
            raise InvalidInput(
                f"These parameters need steps of {self._substep * 1e6:.2g} µs, which would take forever: "
                "a node volume, tube resistance or viscosity is far too small."
            )
        self._atmosphere = parameters.supply.atmosphere
        self._neck = parameters.neck if self._real else np.zeros(n)
        self._constants = np.empty(n, records.CONSTANTS)
        for name in records.CONSTANTS.names or ():
            self._constants[name] = getattr(parameters, name)
        self._state = np.zeros(n, records.STATE)
        self._state["stretch"] = 1.0
        self._state["pressure"] = self._state["node"] = self._atmosphere
        self._supply = np.array([astuple(parameters.supply)], records.SUPPLY)
        self._air = np.zeros(1, records.AIR)
        self._air["pressure"] = self._atmosphere + supply_pa
        if self._real:
            real_rest.begin(self._state, self._air, parameters)
        else:
            self._warm()
        self.live = Live(self.inject)
        """Failures that move by themselves."""
        self._nominal = self._constants.copy(), self._supply.copy()  # what `change` multiplies
        self._fill_on, self._vent_on = np.zeros(n), np.zeros(n)
        self._noise = np.zeros(n + 1)
        self._rng = np.random.default_rng(seed)
        self._place = np.zeros((n if contact else 0, 4))
        """Centre x, y, z and radius of each bubble, m. No rows without contact."""
        self._force = np.zeros_like(self._place)
        self._barbs = np.zeros((len(self._place), 2))
        self._pairs = np.zeros((0, 2), np.int64)
        necks, springs = np.zeros(len(self._place), BUBBLE), np.zeros(1, SPRINGS)
        if contact:
            if len(contact) != n:
                raise InvalidInput(f"The contact is of {len(contact)} bubbles, the plant has {n}.")
            necks, springs[0] = contact.bubbles, contact.springs
            for axis in ("x", "y"):
                necks[axis] += np.random.default_rng((seed, ord(axis))).normal(0.0, BARBS, n)
            self._barbs = np.column_stack([necks["x"], necks["y"]])
            gap = np.linalg.norm(self._barbs[:, None] - self._barbs[None], axis=2)
            self._pairs = np.ascontiguousarray(np.argwhere(np.triu(gap < REACH, 1)))
            self._stand()

        # Where the arrays are, as the kernel takes them: their content changes, they themselves do not.
        self._plant = (n, *map(_address, (self._state, self._constants, self._air, self._supply)))
        own = (self._barbs,) if self._real else (necks, springs)
        self._kept = (self._place, *own, self._pairs, self._force)
        self._moving = (len(self._place), len(self._pairs), *map(_address, self._kept))
        self._coils = (_address(self._fill_on), _address(self._vent_on))
        self._read = (_address(self._noise), *PA_PER_COUNT)
        self._into: tuple[NDArray[np.uint16] | None, int] = (None, 0)  # what `read` filled last, and where that is
        self._advance, self._sense = (real_kernel if self._real else kernel).advance(), devices.sense()

    def _warm(self) -> None:
        """Let the pV that orifices and tubes pass be that of gas at its temperature: orifices as √T, tubes as its viscosity."""
        warm = self.parameters.supply.temperature / REFERENCE_TEMPERATURE
        for name in ("fill_conductance", "vent_conductance"):
            self._constants[name] *= math.sqrt(warm)
        self._supply["dump_conductance"] *= math.sqrt(warm)
        self._constants["tube_resistance"] *= warm**VISCOSITY_EXPONENT

    def _stand(self) -> None:
        """Put every bubble on its barb, touching the base."""
        if len(self._place):
            radius = self.parameters.radius * self._state["stretch"]
            self._place[:] = np.column_stack([self._barbs, radius + self._neck, radius])

    def advance(self, dt: float, fill_on: ArrayLike, vent_on: ArrayLike, pump: float = 0.0, dump: bool = False) -> None:
        """Let `dt` seconds pass.

        `fill_on` and `vent_on` are (n,) seconds within [0, dt] for which each valve's coil is energised from
        the start of this interval; dt is throughout, and goes on seamlessly if the next interval starts
        energised. `pump` is a duty from 0 to 1; `dump` opens the reservoir to the air.
        """
        if not 0.0 <= dt < math.inf:
            raise InvalidInput(f"dt is {dt!r}; the plant can only step forward by a finite number of seconds")
        if self.live:
            self.live.step(self.time)
        self._fill_on[:] = fill_on
        self._vent_on[:] = vent_on
        # A hair less than the quotient: 5 ms in steps of 50 µs are 100 steps, whatever the rounding says.
        substeps = max(1, math.ceil(dt / self._substep - 1e-6))
        if dt > 0.0:
            self._advance(*self._plant, *self._moving, *self._coils, dt, substeps, pump, dump)
        self.time += dt

    def read(self, counts: NDArray[np.uint16]) -> None:
        """Read all sensors into `counts`, (n + 1,): those of the bubbles as of `sense`, the reservoir's last."""
        self._rng.standard_normal(out=self._noise)
        if self._into[0] is not counts:
            self._into = counts, _address(counts)
        self._sense(*self._plant, *self._read, self._into[1])
        if self.live:
            self.live.read(self.time, counts)

    def sense(self) -> NDArray[np.uint16]:
        """Read the bubbles' sensors, at the valve nodes: (n,) counts of 17 Pa, 160 at zero gauge."""
        counts = np.empty(len(self._state) + 1, np.uint16)
        self.read(counts)
        return counts[:-1]

    def sense_supply(self) -> int:
        """Read the reservoir's sensor: counts of 25 Pa, 160 at zero gauge."""
        counts = np.empty(len(self._state) + 1, np.uint16)
        self.read(counts)
        return int(counts[-1])

    def inject(self, fault: str, bubble: int, value: float = 1.0) -> None:
        """Make something of `bubble` fail; a value of 0 mends it. `fault` and what its value means:

        `leak`: RTṁ per Pa gauge, m³/s; 5e-8 takes 1 % of a full bubble's air a second.
        `pop_off`: share of the line's bore that is open, 1 for a bubble that has slipped off its barb.
        `fill_stuck`, `vent_stuck`: 1 stuck open, -1 stuck closed.
        `sensor_stuck`: the count that it sticks at. `sensor_bias`: Pa added to what it sees.
        `sensor_absent`: 1 for a converter input that reads its pull-down, 0 counts.

        Of the reservoir, whatever the `bubble`: `supply_stuck`, `supply_bias`, `supply_absent` the same of its sensor;
        `supply_flat`: Pa that this says, with noise, whatever the pressure; `relief_stuck`: 1 for a relief valve that stays shut.
        `pump_off`: 1 for a pump that brings nothing. `dump_stuck`: 1 for a dump valve stuck open, -1 stuck closed.
        """
        if fault in records.SUPPLY_FAILURES:
            self._air[fault] = value
        elif fault in records.FAILURES:
            self._state[fault][bubble] = value
        else:
            known = ", ".join(records.FAILURES + records.SUPPLY_FAILURES)
            raise InvalidInput(f"no failure is called {fault!r}; choose one of {known}")

    def change(self, figure: str, bubble: int, factor: float) -> None:
        """Let a figure be `factor` times what it was at the start: of `bubble`, or, such as "supply.volume", of the reservoir."""
        section, _, name = figure.rpartition(".")
        now, begin = (self._supply, self._nominal[1]) if section else (self._constants, self._nominal[0])
        place = 0 if section else bubble
        now[name][place] = factor * begin[name][place]

    def says(self, sensor: int) -> int:
        """The count that a bubble's sensor says now, at least 1, or with -1 the reservoir's."""
        counts = np.empty(len(self._state) + 1, np.uint16)
        self.read(counts)
        return max(int(counts[sensor]), 1)

    def rest_at(self, height_mm: ArrayLike) -> None:
        """Put every bubble at rest at `height_mm`, one for all or (n,): valves shut, line at its pressure.

        Real rubber is as after a long time there: relaxed, softened by that height at least.
        """
        s, p = self._state, self.parameters
        s["stretch"] = (np.asarray(height_mm) - 1e3 * self._neck) / (2e3 * p.radius)
        if self._real:
            real_rest.stand(s, p)
        else:
            held = yeoh_pressure(s["stretch"], p.mu, p.c2, p.c3, p.thickness, p.radius)
            s["pressure"] = s["node"] = self._atmosphere + held
        for name in ("fill_energised", "fill_open", "vent_energised", "vent_open"):
            s[name] = False
        self._stand()

    def soften(self, height_mm: ArrayLike) -> None:
        """Let every wall have been stretched to `height_mm` once, one for all or (n,); ideal rubber does not mind."""
        stretch = (np.asarray(height_mm) - 1e3 * self._neck) / (2e3 * self.parameters.radius)
        self._state["largest"] = np.maximum(self._state["largest"], stretch)

    def snapshot(self) -> tuple[Any, ...]:
        """Copy everything that changes, failures and noise generator included, for `restore`."""
        changing = self._state, self._air, self._place, self._constants, self._supply
        return *(array.copy() for array in changing), self.time, self._rng.bit_generator.state

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a `snapshot` of this plant."""
        self._state[:], self._air[:], self._place[:], self._constants[:], self._supply[:] = snapshot[:5]
        self.time, self._rng.bit_generator.state = snapshot[5:]

    @property
    def stretch(self) -> NDArray[np.float64]:
        """λ = R/r0 of each bubble, (n,)."""
        return self._state["stretch"].copy()

    @property
    def largest_stretch(self) -> NDArray[np.float64]:
        """The largest λ that each wall has seen, (n,): what real rubber is softened by."""
        return self._state["largest"].copy()

    @property
    def height_mm(self) -> NDArray[np.float64]:
        """Top of each bubble above the base plane in mm, (n,): z + R, which is `alone_mm` for one that nobody lifts."""
        if len(self._place):
            return np.asarray(1e3 * (self._place[:, 2] + self._place[:, 3]))
        return self.alone_mm

    @property
    def alone_mm(self) -> NDArray[np.float64]:
        """2R of each bubble in mm, (n,), and how high its neck holds it: its height where nobody lifts it."""
        return 2e3 * self.parameters.radius * self._state["stretch"] + 1e3 * self._neck

    @property
    def position_m(self) -> NDArray[np.float64]:
        """Centres x, y, z of the bubbles, (n, 3); no rows without contact."""
        return self._place[:, :3].copy()

    @property
    def pressure_pa(self) -> NDArray[np.float64]:
        """True gauge pressure in each bubble, Pa, (n,)."""
        return self._state["pressure"] - self._atmosphere

    @property
    def node_pa(self) -> NDArray[np.float64]:
        """True gauge pressure at each sensor, between valves and tube, Pa, (n,)."""
        return self._state["node"] - self._atmosphere

    @property
    def supply_pa(self) -> float:
        """True gauge pressure of the reservoir, Pa."""
        return float(self._air["pressure"][0]) - self._atmosphere

    @property
    def air(self) -> NDArray[np.float64]:
        """Air behind each bubble's valves, node, tube and sphere together, in J, (n,): pV, of real gas at 20 °C."""
        p, s = self.parameters, self._state
        if self._real:
            return np.asarray(s["node_air"] + s["line_air"])
        volume = p.tube_volume + 4 / 3 * np.pi * (p.radius * s["stretch"]) ** 3
        return s["node"] * p.node_volume + s["pressure"] * volume

    @property
    def reservoir_air(self) -> float:
        """The same of the reservoir."""
        air = self._air[0]
        return float(air["air"] if self._real else air["pressure"] * self.parameters.supply.volume)

    @property
    def pumped(self) -> float:
        """Air that the pump has brought since the start, in J as `air`."""
        return float(self._air["pumped"][0])

    @property
    def vented(self) -> float:
        """Air lost since the start through vents, dump valve and failures, in J as `air`."""
        return float(self._air["vented"][0])
