"""What differs between real bubbles and boards, and how much: one table, and the figures drawn from it."""

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

_Figures = TypeVar("_Figures", bound=Any)

SPREAD = 0.1
"""The spread that the table is written for; tolerances are proportional to it."""


@dataclass(frozen=True)
class Tolerance:
    """How far a figure may be from its nominal value at a spread of 0.1, drawn evenly from that range."""

    name: str
    share: float = 0.0
    """Of the nominal value: 0.1 for ± 10 %. Where `factor`, from 1/(1 + share) to 1 + share times."""
    absolute: float = 0.0
    """In the figure's own unit."""
    factor: bool = True
    least: float = -np.inf
    meaning: str = ""


IDEAL = (
    Tolerance("thickness", share=0.10, factor=False, meaning="wall, cast in a mould"),
    Tolerance("mu", share=0.10, factor=False, meaning="cure and batch"),
    Tolerance("fill_conductance", share=0.10, factor=False, meaning="restrictor: 5 % of its bore"),
    Tolerance("vent_conductance", share=0.10, factor=False, meaning="the same of the vent's, drawn by itself"),
    Tolerance("fill_opening", absolute=0.3e-3, least=0.0, meaning="dead times, s, each by itself"),
    Tolerance("fill_closing", absolute=0.3e-3, least=0.0, meaning="the same"),
    Tolerance("vent_opening", absolute=0.3e-3, least=0.0, meaning="the same"),
    Tolerance("vent_closing", absolute=0.3e-3, least=0.0, meaning="the same"),
    Tolerance("sensor_offset", absolute=300.0, meaning="Pa"),
)
"""What differs where the rubber is ideal."""

REAL = (
    Tolerance("c2", share=0.20, meaning="cure and batch"),
    Tolerance("c3", share=0.20, meaning="cure and batch"),
    Tolerance("radius", share=0.02, meaning="mould"),
    Tolerance("neck", absolute=0.05e-3, meaning="m, how it is glued"),
    Tolerance("viscosity", share=0.20, meaning="cure and batch"),
    Tolerance("quick_strength", share=0.20, meaning="memory: each strength and time by itself"),
    Tolerance("quick_time", share=0.30, meaning="the same"),
    Tolerance("slow_strength", share=0.20, meaning="the same"),
    Tolerance("slow_time", share=0.30, meaning="the same"),
    Tolerance("mullins", share=0.20, meaning="filler and cure"),
    Tolerance("mullins_width", share=0.20, meaning="the same"),
    Tolerance("node_volume", share=0.20, meaning="fittings and glue"),
    Tolerance("tube_volume", share=0.20, meaning="length of the tube, and what the neck holds"),
    Tolerance("tube_resistance", share=0.20, meaning="5 % of its bore"),
    Tolerance("critical_ratio", absolute=0.05, least=0.0, meaning="shape of the restrictor's edge"),
    Tolerance(
        "leak",
        absolute=1e-9,
        least=0.0,
        meaning="m³/s; 1e-9 is 0.02 % of a full bubble's air a second, as silicone lets through",
    ),
    Tolerance("sensor_gain", share=0.01, meaning="total error band of a good sensor"),
    Tolerance("sensor_noise", share=0.20, meaning="Pa RMS"),
    Tolerance("heat_time", share=0.20, meaning="shape"),
    Tolerance("node_heat_time", share=0.20, meaning="shape"),
)
"""What differs besides where the rubber is real."""

SPRINGS = tuple(
    Tolerance(name, share=0.10, meaning="neck, base and contact; by `springs=` where that is said")
    for name in ("kz_up", "kz_down", "kxy", "kc")
)

SUPPLY = (
    Tolerance("volume", share=0.05, meaning="reservoir and fittings"),
    Tolerance("pump_free_flow", share=0.10, meaning="wear and voltage"),
    Tolerance("pump_stall", share=0.05, meaning="the same"),
    Tolerance("dump_conductance", share=0.10, meaning="orifice"),
    Tolerance("relief_pressure", share=0.02, meaning="set by its spring"),
    Tolerance("sensor_gain", share=0.01, meaning="as of the bubbles' sensors"),
    Tolerance("sensor_noise", share=0.20, meaning="the same"),
    Tolerance("heat_time", share=0.20, meaning="shape"),
)
"""What differs between supplies where the rubber is real."""

SUPPLY_OFFSET = Tolerance("sensor_offset", absolute=300.0, meaning="Pa")
"""And whatever the rubber."""


def draw(parameters: _Figures, spread: float, seed: int, *, springs: float | None = None) -> _Figures:
    """`parameters` as made by real hands: each figure drawn from its tolerance, which `spread` scales; 0.1 is the table.

    `springs` is the share for the springs, 0.3 for ± 30 %; None leaves them to `spread`. The same seed gives the same
    bubbles. A row that is added, or real rubber for ideal, does not change what the others draw.
    """
    drawn: dict[str, Any] = {}
    supply: dict[str, Any] = {}
    real = parameters.rubber == "real"
    n = len(parameters.mu)
    if spread:
        rng = np.random.default_rng(seed)
        drawn = {row.name: _value(row, getattr(parameters, row.name), spread, rng, n) for row in IDEAL}
        supply["sensor_offset"] = float(_value(SUPPLY_OFFSET, parameters.supply.sensor_offset, spread, rng, None))
    if spread and real:
        for row in REAL:
            drawn[row.name] = _value(row, getattr(parameters, row.name), spread, _stream(seed, row.name), n)
        for row in SUPPLY:
            value = _value(row, getattr(parameters.supply, row.name), spread, _stream(seed, f"supply {row.name}"), None)
            supply[row.name] = float(value)
    share = springs if springs is not None else spread if real else 0.0
    for row in SPRINGS if share else ():
        # Ideal rubber has one set of springs for all bubbles: they are off together.
        drawn[row.name] = _value(
            row, getattr(parameters, row.name), share, _stream(seed, row.name), n if real else None
        )
    return replace(parameters, **drawn, supply=replace(parameters.supply, **supply))


def _stream(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng((seed, *name.encode()))


def _value(row: Tolerance, nominal: Any, spread: float, rng: np.random.Generator, n: int | None) -> Any:
    """The figure of `n` bubbles, or of the one supply. In this order of operations, to the last bit: recorded runs rest on it."""
    if row.absolute:
        whole = round(row.absolute / SPREAD, 15)
        return np.maximum(nominal + spread * rng.uniform(-whole, whole, n), row.least)
    share = spread * (row.share / SPREAD)
    if row.factor:
        return nominal * (1.0 + share) ** rng.uniform(-1, 1, n)
    return nominal * (1.0 + share * rng.uniform(-1, 1, n))
