"""Real bubbles at rest: what their state is then."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sim.parameters import PlantParameters
from bubbleskin.sim.pneumatics import REFERENCE_TEMPERATURE
from bubbleskin.sim.real import rubber


def _of_each(function: Callable[..., float]) -> Any:
    return np.vectorize(function, otypes=[float])


_energy_density = _of_each(rubber.energy_density)
_elastic_stress = _of_each(rubber.elastic_stress)
_softening = _of_each(rubber.softening)
_wall_pressure = _of_each(rubber.wall_pressure)


def volume(stretch: NDArray[np.float64], parameters: PlantParameters) -> NDArray[np.float64]:
    """Of line and sphere, m³, (n,)."""
    return parameters.tube_volume + 4 / 3 * np.pi * (parameters.radius * stretch) ** 3


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
