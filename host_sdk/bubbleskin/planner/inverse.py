"""From heights to pressures: Newton on the settled heights.

On one branch heights are a smooth function of the pressures, whose slope the energy's second derivatives give; so a
few steps of Newton find the pressures of a shape. Which branch that is, the path decides.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from bubbleskin.contact.continuation import Resolution
from bubbleskin.contact.model import CompliantContact
from bubbleskin.contact.shape import Shape
from bubbleskin.errors import NoEquilibrium

Array = NDArray[np.float64]

GOAL_MM = 0.02
"""Newton ends where every height is within it of what was asked."""
_TRUSTED_MM = 1.0
"""A slope is trusted for so much of each bubble's height alone."""
_ITERATIONS = 15
_WORTH = 0.05
"""An iteration that takes off a smaller share of the squared error is the last."""
_COARSE = Resolution(increments=4, move_mm=0.5, halvings=5)  # A correction is short.


def correct(model: CompliantContact, shape: Shape, heights_mm: Array, highest: Array) -> Shape:
    """`shape` with pressures changed until its heights are `heights_mm`, (n,), or as near as they get.

    Pressures stay between 0 and `highest`, (n,) Pa. Least squares where the heights cannot all be met. It keeps to the
    branch that `shape` is on as long as that leads nearer.
    """
    for _ in range(_ITERATIONS):
        error = heights_mm - shape.height_mm
        if np.abs(error).max() < GOAL_MM or not shape.converged:
            break
        try:
            slope = 1e6 * model.height_slope(shape)  # mm per kPa
        except NoEquilibrium:
            break
        alone = 2e3 * model.free_radius(shape.pressure, shape.radius)
        low = np.minimum(model.free_pressure(alone - _TRUSTED_MM), shape.pressure)
        high = np.minimum(np.maximum(model.free_pressure(alone + _TRUSTED_MM), shape.pressure), highest)
        bounds = (1e-3 * (low - shape.pressure) - 1e-6, 1e-3 * np.maximum(high - shape.pressure, 0.0) + 1e-6)
        change = 1e3 * lsq_linear(slope, error, bounds).x
        nearer = _nearer(model, shape, heights_mm, change, highest)
        if nearer is None:
            break
        gained = 1 - _misfit(nearer, heights_mm) / _misfit(shape, heights_mm)
        shape = nearer
        if gained < _WORTH:
            break
    return shape


def _misfit(shape: Shape, heights_mm: Array) -> float:
    return float(((heights_mm - shape.height_mm) ** 2).sum())


def _nearer(model: CompliantContact, shape: Shape, heights_mm: Array, change: Array, highest: Array) -> Shape | None:
    """`shape` after as much of `change` as keeps to its branch and comes nearer, or else snaps nearer; None if nothing does."""
    snapped = None
    error = _misfit(shape, heights_mm)
    for share in (1.0, 0.4, 0.15, 0.05):
        pressure = np.clip(shape.pressure + share * change, 0.0, highest)
        if np.abs(pressure - shape.pressure).max() < 0.1:
            break
        trial = model.settle([pressure], start=shape, resolution=_COARSE)
        if trial.converged and _misfit(trial, heights_mm) < error:
            if not trial.snaps:
                return trial
            snapped = snapped or trial
    return snapped
