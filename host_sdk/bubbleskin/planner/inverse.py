"""From heights to pressures: Newton on the settled heights, and the orders in which bubbles can be tried.

On one branch heights are a smooth function of the pressures, whose slope the energy's second derivatives give; so a
few steps of Newton find the pressures of a shape. Which branch that is, the path decides: an `Order` is tried as a path.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from bubbleskin.contact.model import CompliantContact, Shape
from bubbleskin.errors import NoEquilibrium

Array = NDArray[np.float64]
Order = tuple[tuple[int, ...], ...]
"""Groups of bubbles, one after the other."""

GOAL_MM = 0.02
"""Newton ends here."""
_STRIDE_MM = 1.0  # of free height: as far as a slope is trusted
_TURNS = 15
_WORTH = 0.05  # of the squared error: a turn that gains less is the last
_COARSE: dict[str, Any] = {"increments": 4, "move_mm": 0.5, "halvings": 5}  # a correction is short


def correct(model: CompliantContact, shape: Shape, heights_mm: Array, highest: Array) -> Shape:
    """Change the pressures of `shape`, in [0, `highest`], until its heights are `heights_mm` or as near as they get.

    Least squares where they cannot all be met. It keeps to the branch that `shape` is on as long as that leads nearer.
    """
    for _ in range(_TURNS):
        error = heights_mm - shape.height_mm
        if np.abs(error).max() < GOAL_MM or not shape.converged:
            break
        try:
            slope = 1e6 * model.height_slope(shape)  # mm per kPa
        except NoEquilibrium:
            break
        alone = 2e3 * model.free_radius(shape.pressure, shape.radius)
        low = np.minimum(model.free_pressure(alone - _STRIDE_MM), shape.pressure)
        high = np.minimum(np.maximum(model.free_pressure(alone + _STRIDE_MM), shape.pressure), highest)
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
        trial = model.settle([pressure], start=shape, **_COARSE)
        if trial.converged and _misfit(trial, heights_mm) < error:
            if not trial.snaps:
                return trial
            snapped = snapped or trial
    return snapped


def steps_of(order: Order, pressure: Array, begin: Array) -> Array:
    """Pressures of each step, (k, n): who has not had its turn stays as in `begin`."""
    now, steps = begin.copy(), []
    for group in order:
        now = now.copy()
        now[list(group)] = pressure[list(group)]
        steps.append(now)
    return np.array(steps)


def pairs(shape: Shape, pressure: Array, neighbours: Sequence[Sequence[int]], wrong: Sequence[int]) -> Iterator[Order]:
    """Orders of two groups, the likeliest first.

    `shape` is one that has the heights, `wrong` the bubbles which end elsewhere when all go together. Those that hang
    between their neighbours first, or last; then by pressure; then, around the wrong ones, every way to choose.
    """
    n = len(pressure)
    everyone = frozenset(range(n))
    seen: set[frozenset[int]] = {frozenset(), everyone}

    def fresh(first: frozenset[int]) -> Iterator[Order]:
        if first not in seen:
            seen.add(first)
            yield _groups(first, everyone - first)

    lifted = frozenset(np.flatnonzero(shape.lifted_mm > 0.1).tolist())
    around = frozenset(j for i in wrong for j in neighbours[i])
    off = frozenset(wrong)
    for first in (lifted, everyone - lifted, lifted & off, everyone - (lifted & off), off, everyone - off):
        yield from fresh(first)
    for one in sorted(off):
        yield from fresh(frozenset([one]))
        yield from fresh(everyone - {one})
        yield from fresh(frozenset(neighbours[one]))
    by_pressure = np.argsort(-pressure, kind="stable").tolist()
    for k in range(1, n):
        yield from fresh(frozenset(by_pressure[:k]))
        yield from fresh(frozenset(by_pressure[k:]))
    near = sorted(off | around, key=lambda i: (i not in off, -pressure[i]))[: 7 if n <= 7 else 6]
    if n <= 7:
        near = list(range(n))
    for size in range(1, len(near) + 1):
        for chosen in combinations(near, size):
            yield from fresh(frozenset(chosen))
            yield from fresh(everyone - frozenset(chosen))


def triples(twos: Sequence[Order], wrong: Sequence[int]) -> Iterator[Order]:
    """Orders of three groups: each of two with one part split, wrong ones against the others, then one by one."""
    seen: set[Order] = set()
    off = frozenset(wrong)
    for first, second in (order for order in twos if len(order) == 2):
        a, b = frozenset(first), frozenset(second)
        splits = [(a, part, b - part) for part in (b & off, b - off, *(frozenset([i]) for i in sorted(b)))]
        splits += [(part, a - part, b) for part in (a & off, a - off, *(frozenset([i]) for i in sorted(a)))]
        for parts in splits:
            order = _groups(*parts)
            if len(order) == 3 and order not in seen:
                seen.add(order)
                yield order


def _groups(*parts: frozenset[int]) -> Order:
    return tuple(tuple(sorted(part)) for part in parts if part)
