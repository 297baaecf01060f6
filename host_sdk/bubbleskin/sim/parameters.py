"""The figures of a simulated wristband: membranes, lines, valves and sensors, one entry per bubble."""

import math
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sim.pneumatics import (
    CRITICAL_RATIO,
    LITRE_PER_MINUTE,
    REFERENCE_TEMPERATURE,
    RESTRICTOR,
    tube_resistance,
)
from bubbleskin.sim.tolerances import draw

_Array = NDArray[np.float64]

RUBBERS = ("ideal", "real")
"""`ideal` follows the tables' curve and forgets nothing, its gas has one temperature; `real` is `bubbleskin.sim.real`."""


@dataclass(frozen=True)
class Supply:
    """What all bubbles share: reservoir, pump, dump valve, supply sensor, the gas itself and the air outside. SI units."""

    volume: float = 50e-6
    pump_free_flow: float = 3.0 * LITRE_PER_MINUTE
    """At no pressure, m³/s."""
    pump_stall: float = 120e3
    """Gauge pressure at which the pump brings nothing, Pa."""
    dump_conductance: float = RESTRICTOR * (1.0 / 0.2) ** 2
    """A 1 mm orifice, m³/(s·Pa)."""
    relief_pressure: float = 80e3
    """Gauge pressure at which the relief valve begins to open, Pa; infinite for a reservoir that has none."""
    relief_range: float = 2e3
    """Pressure by which it is open as wide as the dump valve, Pa."""
    polytropic: float = 1.0
    """Exponent n of all gas where the rubber is ideal: 1.0 is isothermal, right for small vessels; 1.4 is adiabatic."""
    critical_ratio: float = CRITICAL_RATIO
    """Of the dump valve."""
    sensor_offset: float = 0.0
    sensor_noise: float = 50.0
    """RMS, Pa."""
    sensor_gain: float = 1.0
    atmosphere: float = 101_325.0
    """Pressure of the air outside, Pa."""
    temperature: float = REFERENCE_TEMPERATURE
    """Of that air and of all walls, K."""
    heat_time: float = 1.0
    """Time constant with which the reservoir's gas takes its wall's temperature, s. Rubber that is real only."""


@dataclass(frozen=True)
class PlantParameters:
    """One array entry per bubble, SI units; `supply` is shared. What only `rubber="real"` has stands last."""

    mu: _Array
    c2: _Array
    c3: _Array
    thickness: _Array
    radius: _Array
    viscosity: _Array
    """Pressure per rate of stretch, Pa·s."""
    fill_conductance: _Array
    vent_conductance: _Array
    """Sonic conductances of the restrictors, m³/(s·Pa)."""
    critical_ratio: _Array
    """Of both."""
    fill_opening: _Array
    fill_closing: _Array
    vent_opening: _Array
    vent_closing: _Array
    """Dead times of the valves, s."""
    node_volume: _Array
    """Between the valves and the tube, where the sensor sits, m³."""
    tube_volume: _Array
    """Lumped on the bubble's side of the tube, m³."""
    tube_resistance: _Array
    """Laminar, Pa·s/m³."""
    leak: _Array
    """RTṁ per Pa gauge, m³/s, as of `Plant.inject`, and beside what is injected."""
    sensor_gain: _Array
    sensor_offset: _Array
    sensor_noise: _Array
    """Offset and RMS noise in Pa."""
    kz_up: _Array
    kz_down: _Array
    kxy: _Array
    """Springs of neck and base, N/m: what holds a centre against being lifted, pushed down and pushed aside."""
    kc: _Array
    """Stiffness of a bubble's side, N/m; two that touch have the mean of both. Ideal rubber takes the mean of each spring."""

    quick_strength: _Array
    quick_time: _Array
    slow_strength: _Array
    slow_time: _Array
    """The two Prony branches: stress that each adds to a sudden stretch, as a share of the lasting one, and for how many s."""
    mullins: _Array
    """Softening of rubber that has been stretched, by at most this share."""
    mullins_width: _Array
    """Share of the largest energy by which the present one must be below it for most of that."""
    conditioned: _Array
    """The largest stretch that each wall has seen before the start; 1 for one that is as it was made."""
    neck: _Array
    """How far above the base plane a bubble's lowest point is that nobody lifts, m."""
    heat_time: _Array
    """Time constant with which a bubble's gas takes the wall's temperature, s, at the rest radius; it grows with its square."""
    node_heat_time: _Array
    """That of the node."""

    supply: Supply
    rubber: str = "ideal"
    """One of `RUBBERS`."""

    @classmethod
    def each(cls) -> list[str]:
        """Names of the figures that each bubble has for itself."""
        return [f.name for f in fields(cls) if f.name not in ("supply", "rubber")]

    @classmethod
    def nominal(cls, n: int) -> Self:
        """`n` bubbles as the board's tables describe them; with `rubber="real"`, typical memory and heat besides.

        Heat: a sphere's slowest mode of conduction, r0²/(π² a) with a = 21 mm²/s of air; a passage of 1 mm bore, d²/(23 a).
        """
        figures: dict[str, Any] = {name: np.full(n, value) for name, value in _NOMINAL.items()}
        return cls(**figures, supply=Supply())

    @classmethod
    def spread(cls, n: int, spread: float, seed: int) -> Self:
        """`n` bubbles of ideal rubber that differ in walls, μ, valves and sensor offsets: `bubbleskin.sim.tolerances`."""
        return draw(cls.nominal(n), spread, seed)


ANY_SIGN = ("sensor_offset", "neck")
MAY_BE_ZERO = (
    "c2",
    "c3",
    "leak",
    "critical_ratio",
    "fill_opening",
    "fill_closing",
    "vent_opening",
    "vent_closing",
    "sensor_noise",
    "fill_conductance",
    "vent_conductance",
    "dump_conductance",
    "pump_free_flow",
    "mullins",
    "quick_strength",
    "slow_strength",
)
"""Figures that may be negative, and those that may be nothing; all others are more than 0."""
BELOW_ONE = ("critical_ratio", "mullins")


def allowed(name: str, value: float) -> str:
    """What the figure `name` may be, as words for a sentence; empty where `value` is that."""
    if name in ANY_SIGN:
        return "" if math.isfinite(value) else "a finite number"
    if name == "relief_pressure" and value == math.inf:
        return ""
    if name in BELOW_ONE:
        return "" if 0 <= value < 1 else "a number from 0 to less than 1"
    if name in MAY_BE_ZERO:
        return "" if math.isfinite(value) and value >= 0 else "a finite number, 0 or more"
    return "" if math.isfinite(value) and value > 0 else "a finite number, more than 0"


_NOMINAL = {
    "mu": 39.62e3,
    "c2": 417.3,
    "c3": 60.65,
    "thickness": 1e-3,
    "radius": 2.5e-3,
    "viscosity": 300.0,
    "fill_conductance": RESTRICTOR,
    "vent_conductance": RESTRICTOR,
    "critical_ratio": CRITICAL_RATIO,
    "fill_opening": 1.2e-3,
    "fill_closing": 1.0e-3,
    "vent_opening": 1.2e-3,
    "vent_closing": 1.0e-3,
    "node_volume": 0.05e-6,
    "tube_volume": 0.15e-6,
    "tube_resistance": tube_resistance(length=0.3, bore=0.8e-3),
    "leak": 0.0,
    "sensor_gain": 1.0,
    "sensor_offset": 0.0,
    "sensor_noise": 50.0,
    "kz_up": 10.0,
    "kz_down": 3000.0,
    "kxy": 50.0,
    "kc": 300.0,
    "quick_strength": 0.05,
    "quick_time": 0.1,
    "slow_strength": 0.05,
    "slow_time": 3.0,
    "mullins": 0.10,
    "mullins_width": 0.5,
    "conditioned": 1.0,
    "neck": 0.0,
    "heat_time": 30e-3,
    "node_heat_time": 2e-3,
}
