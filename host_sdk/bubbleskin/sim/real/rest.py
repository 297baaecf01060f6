"""Real bubbles at rest: what their state is then."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sim.parameters import PlantParameters
from bubbleskin.sim.pneumatics import LAMINAR_RATIO, REFERENCE_PRESSURE, REFERENCE_TEMPERATURE
from bubbleskin.sim.real import rubber
from bubbleskin.sim.real.gas import HEAT_RATIO
from bubbleskin.sim.records import DRAG

HIGHEST = 60e3
"""Gauge pressure for which steps must be fine enough, Pa: that of the reservoir."""


def _of_each(function: Callable[..., float]) -> Any:
    return np.vectorize(function, otypes=[float])


_energy_density = _of_each(rubber.energy_density)
_elastic_stress = _of_each(rubber.elastic_stress)
_softening = _of_each(rubber.softening)
_wall_pressure = _of_each(rubber.wall_pressure)


def volume(stretch: NDArray[np.float64], parameters: PlantParameters) -> NDArray[np.float64]:
    """Of line and sphere, m³, (n,)."""
    return parameters.tube_volume + 4 / 3 * np.pi * (parameters.radius * stretch) ** 3


def longest_step(parameters: PlantParameters, contact: bool) -> float:
    """Longest step that is stable whatever opens, s: half of the least that explicit steps of node, wall and centres allow.

    Of a node the tube takes p/(R V) per second, a valve whose pressures are nearly equal p_ref C ψ'/V, each times γ; a wall gives
    way with (dP/dλ + dp/dλ)/η, both largest near the rest radius; six neighbours push a centre with 3 kc in any direction.
    """
    p, high = parameters, parameters.supply.atmosphere + HIGHEST
    b = p.critical_ratio
    x = (LAMINAR_RATIO - b) / (1.0 - b)
    slope = np.sqrt(1.0 - x * x) / (1.0 - LAMINAR_RATIO)
    valves = REFERENCE_PRESSURE * (p.fill_conductance + p.vent_conductance) * slope
    node = HEAT_RATIO * (high / p.tube_resistance + valves) / p.node_volume
    wall = 12.0 * p.mu * p.thickness / p.radius * (1.0 + p.quick_strength + p.slow_strength)
    gas = HEAT_RATIO * high * 4 * np.pi * p.radius**3 / volume(np.ones_like(p.radius), p)
    push = 3.0 * p.kc / DRAG if contact else 0.0 * p.kc
    return float(1.0 / np.max([node, (wall + gas) / p.viscosity, push]))


def begin(state: NDArray[Any], air: NDArray[Any], parameters: PlantParameters) -> None:
    """Give walls their history, and every vessel the air that it holds at its pressure and its wall's temperature."""
    supply = parameters.supply
    state["largest"] = np.maximum(parameters.conditioned, state["stretch"])
    air["air"] = air["pressure"] * supply.volume / (supply.temperature / REFERENCE_TEMPERATURE)
    _fill_bubbles(state, parameters)


def _fill_bubbles(state: NDArray[Any], parameters: PlantParameters) -> None:
    p, warm = parameters, parameters.supply.temperature / REFERENCE_TEMPERATURE
    state["node_air"] = state["node"] * p.node_volume / warm
    state["line_air"] = state["pressure"] * volume(state["stretch"], p) / warm


def stand(state: NDArray[Any], parameters: PlantParameters) -> None:
    """Put every bubble at rest at its stretch, as after a long time there: no overstress, all softening that it had."""
    p, stretch = parameters, state["stretch"]
    yeoh = p.mu, p.c2, p.c3
    state["largest"] = np.maximum(state["largest"], stretch)
    state["stress"] = _elastic_stress(stretch, *yeoh)
    worst = _energy_density(state["largest"], *yeoh)
    state["stress"] *= _softening(_energy_density(stretch, *yeoh), worst, p.mullins, p.mullins_width)
    state["quick"] = state["slow"] = 0.0
    state["membrane"] = _wall_pressure(stretch, state["stress"], p.thickness, p.radius)
    state["pressure"] = state["node"] = p.supply.atmosphere + state["membrane"]
    _fill_bubbles(state, p)
