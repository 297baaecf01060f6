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


def fill(state: NDArray[Any], air: NDArray[Any], parameters: PlantParameters) -> None:
    """Give every vessel the air that it holds at its pressure and its wall's temperature."""
    p, warm = parameters, parameters.supply.temperature / REFERENCE_TEMPERATURE
    state["node_air"] = state["node"] * p.node_volume / warm
    state["line_air"] = state["pressure"] * volume(state["stretch"], p) / warm
    air["air"] = air["pressure"] * p.supply.volume / warm


def stand(state: NDArray[Any], parameters: PlantParameters) -> None:
    """Put every bubble at rest at its stretch, as after a long time there: no overstress, all softening that it had."""
    p, stretch, warm = parameters, state["stretch"], parameters.supply.temperature / REFERENCE_TEMPERATURE
    energy = _energy_density(stretch, p.mu, p.c2, p.c3)
    state["worst"] = np.maximum(state["worst"], energy)
    state["stress"] = _elastic_stress(stretch, p.mu, p.c2, p.c3)
    state["stress"] *= _softening(energy, state["worst"], p.mullins, p.mullins_width)
    state["quick"] = state["slow"] = 0.0
    state["membrane"] = _wall_pressure(stretch, state["stress"], p.thickness, p.radius)
    state["pressure"] = state["node"] = p.supply.atmosphere + state["membrane"]
    state["node_air"] = state["node"] * p.node_volume / warm
    state["line_air"] = state["pressure"] * volume(stretch, p) / warm


def soften(state: NDArray[Any], parameters: PlantParameters, stretch: NDArray[np.float64]) -> None:
    """Let every wall have been stretched as far as `stretch` once."""
    p = parameters
    state["worst"] = np.maximum(state["worst"], _energy_density(stretch, p.mu, p.c2, p.c3))
