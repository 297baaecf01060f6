"""From heights to sizes: Newton on the settled heights.

On one branch heights are a smooth function of the sizes that are held, whose slope the energy's second derivatives give; so
a few steps of Newton find the sizes of a shape. Which branch that is, the path decides.
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
"""A slope is trusted for so much of each bubble's size."""
_ITERATIONS = 15
_WORTH = 0.05
"""An iteration that takes off a smaller share of the squared error is the last."""
_COARSE = Resolution(increments=4, move_mm=0.5, halvings=5)  # A correction is short.


def misfit(shape: Shape, heights_mm: Array) -> float:
    """Sum of the squared distances of the heights from `heights_mm`, (n,), mm²."""
    return float(((heights_mm - shape.height_mm) ** 2).sum())


def correct(model: CompliantContact, shape: Shape, heights_mm: Array, highest_mm: Array) -> Shape:
    """`shape` with sizes changed until its heights are `heights_mm`, (n,), or as near as they get.

    Sizes stay between rest and `highest_mm`, (n,). Least squares where the heights cannot all be met. It keeps to the
    branch that `shape` is on as long as that leads nearer.
    """
    rest = 2e3 * model.bubbles["outer"]
    for _ in range(_ITERATIONS):
        error = heights_mm - shape.height_mm
        if np.abs(error).max() < GOAL_MM or not shape.converged:
            break
        try:
            slope = model.size_slope(shape)
        except NoEquilibrium:
            break
        low = np.minimum(np.maximum(rest - shape.size_mm, -_TRUSTED_MM), 0.0) - 1e-6
        high = np.maximum(np.minimum(highest_mm - shape.size_mm, _TRUSTED_MM), 0.0) + 1e-6
        change = lsq_linear(slope, error, (low, high)).x
        nearer = _nearer(model, shape, heights_mm, change, highest_mm)
        if nearer is None:
            break
        gained = 1 - misfit(nearer, heights_mm) / misfit(shape, heights_mm)
        shape = nearer
        if gained < _WORTH:
            break
    return shape


def _nearer(model: CompliantContact, shape: Shape, heights_mm: Array, change: Array, highest_mm: Array) -> Shape | None:
    """`shape` after as much of `change` as keeps to its branch and comes nearer, or else snaps nearer; None if nothing does."""
    snapped = None
    error = misfit(shape, heights_mm)
    for share in (1.0, 0.4, 0.15, 0.05):
        sizes = np.clip(shape.size_mm + share * change, 0.0, highest_mm)
        if np.abs(sizes - shape.size_mm).max() < 1e-4:
            break
        trial = model.settle_sizes(sizes, shape, resolution=_COARSE)
        if trial.converged and misfit(trial, heights_mm) < error:
            if not trial.snaps:
                return trial
            snapped = snapped or trial
    return snapped
