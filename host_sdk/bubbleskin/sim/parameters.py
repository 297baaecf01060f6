"""The figures of a simulated wristband: membranes, lines, valves and sensors, one entry per bubble."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sim.pneumatics import CRITICAL_RATIO, LITRE_PER_MINUTE, RESTRICTOR, tube_resistance

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Supply:
    """What all bubbles share: reservoir, pump, dump valve, supply sensor and the gas itself. SI units."""

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
    """Exponent n of all gas: 1.0 is isothermal, right for small vessels and slow flow; 1.4 is adiabatic."""
    critical_ratio: float = CRITICAL_RATIO
    sensor_offset: float = 0.0
    sensor_noise: float = 50.0
    """RMS, Pa."""


@dataclass(frozen=True)
class PlantParameters:
    """One array entry per bubble, SI units; `supply` is shared."""

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
    sensor_gain: _Array
    sensor_offset: _Array
    sensor_noise: _Array
    """Offset and RMS noise in Pa."""
    supply: Supply

    @classmethod
    def nominal(cls, n: int) -> Self:
        """`n` bubbles as the board's tables describe them."""

        def each(value: float) -> _Array:
            return np.full(n, value)

        return cls(
            mu=each(39.62e3),
            c2=each(417.3),
            c3=each(60.65),
            thickness=each(1e-3),
            radius=each(2.5e-3),
            viscosity=each(300.0),
            fill_conductance=each(RESTRICTOR),
            vent_conductance=each(RESTRICTOR),
            fill_opening=each(1.2e-3),
            fill_closing=each(1.0e-3),
            vent_opening=each(1.2e-3),
            vent_closing=each(1.0e-3),
            node_volume=each(0.05e-6),
            tube_volume=each(0.15e-6),
            tube_resistance=each(tube_resistance(length=0.3, bore=0.8e-3)),
            sensor_gain=each(1.0),
            sensor_offset=each(0.0),
            sensor_noise=each(50.0),
            supply=Supply(),
        )

    @classmethod
    def spread(cls, n: int, spread: float, seed: int) -> Self:
        """`n` bubbles that differ as real ones do, each figure drawn uniformly from its tolerance.

        `spread` 0.1 means wall, μ and conductances ±10 %, dead times ±0.3 ms and sensor offsets ±300 Pa; all
        scale with it. The same seed gives the same bubbles; a spread of 0 gives `nominal(n)` exactly.
        """
        rng = np.random.default_rng(seed)
        p = cls.nominal(n)
        drawn = {name: getattr(p, name) * (1.0 + spread * rng.uniform(-1, 1, n)) for name in _RELATIVE}
        for name in _DEAD_TIMES:
            drawn[name] = np.maximum(getattr(p, name) + spread * rng.uniform(-3e-3, 3e-3, n), 0.0)
        drawn["sensor_offset"] = p.sensor_offset + spread * rng.uniform(-3e3, 3e3, n)
        supply = replace(p.supply, sensor_offset=p.supply.sensor_offset + spread * rng.uniform(-3e3, 3e3))
        return replace(p, **drawn, supply=supply)


_RELATIVE = ("thickness", "mu", "fill_conductance", "vent_conductance")
_DEAD_TIMES = ("fill_opening", "fill_closing", "vent_opening", "vent_closing")
