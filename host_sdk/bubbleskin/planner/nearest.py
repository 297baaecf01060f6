"""The nearest to a shape that cannot be had: least squares over the sizes within their bounds, from several starts.

The misfit is what counts: heights after following the whole path, not those of a branch that may not be reached. So it
jumps where a path snaps, and a start decides on which side. Each start is improved by `scipy.optimize.least_squares` (trust
region within bounds), whose slope is that of the settled end; a step that is not nearer is not taken. What is found is
therefore never further than any start.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar

from bubbleskin.contact.model import CompliantContact
from bubbleskin.contact.rigid import RigidContact
from bubbleskin.contact.shape import Shape
from bubbleskin.errors import NoEquilibrium
from bubbleskin.planner.inverse import misfit

Array = NDArray[np.float64]
Follow = Callable[[Array], Shape]
"""Sizes at the end, (n,) mm, to the shape that a path leads to."""

_LEAST = 0.5
"""Of the rise that is asked, the least share that is tried: the same shape, lower."""
_SHARES = 21
"""Shares tried, before the best of them is looked at more closely."""
_CLOSER = 8
_EVALUATIONS = 12
"""Paths followed to improve one start."""


def starts(model: CompliantContact, off: Callable[[Array], float], asked: Array, highest: Array) -> Iterator[Array]:
    """Sizes to begin with, (n,) mm: the asked shape itself, lower ones, one size for all, and what rigid bubbles could have.

    `off` tells how far (mm²) sizes lead from what was asked. Of the lower ones and of one size for all, those are given
    that are nearest: by steps, and then within the best step.
    """
    rest = 2e3 * model.bubbles["outer"]
    tall = float(min(np.median(asked), highest.min()))
    yield np.minimum(asked, highest)
    yield _lower(lambda share: np.minimum(rest + share * (asked - rest), highest), off)
    if np.ptp(asked) > 0:
        yield _lower(lambda share: np.maximum(rest, share * tall), off)
    yield np.clip(RigidContact(model.layout, float(rest.min()) / 2).inflate(asked / 2).height_mm, rest, highest)


def _lower(sizes: Callable[[float], Array], off: Callable[[Array], float]) -> Array:
    """The nearest of `sizes` of a share up to 1."""
    shares = np.linspace(1.0, _LEAST, _SHARES)
    ends = [off(sizes(share)) for share in shares]
    best, step = float(shares[int(np.argmin(ends))]), (1.0 - _LEAST) / (_SHARES - 1)
    closer = minimize_scalar(
        lambda share: off(sizes(share)),
        bounds=(best - step, min(best + step, 1.0)),
        method="bounded",
        options={"maxiter": _CLOSER},
    )
    return sizes(float(closer.x) if closer.fun < min(ends) else best)


def improve(model: CompliantContact, follow: Follow, sizes: Array, asked: Array, highest: Array) -> Array:
    """`sizes`, (n,) mm, changed until the end of the path is as near to `asked` as it gets from there."""
    rest = 2e3 * model.bubbles["outer"]
    best = _Best(follow, asked)
    room = highest - rest > 1e-6

    def whole(part: Array) -> Array:
        every = np.where(room, 0.0, rest)
        every[room] = part
        return every

    def slope(part: Array) -> Array:
        try:
            return model.size_slope(best.shape_of(whole(part)))[:, room]
        except NoEquilibrium:
            return np.eye(len(rest))[:, room]

    def missing(part: Array) -> Array:
        return best.shape_of(whole(part)).height_mm - asked

    inside = np.clip(sizes, rest + 1e-6, highest - 1e-6)[room]
    best.shape_of(sizes)
    least_squares(
        missing,
        inside,
        jac=slope,
        bounds=(rest[room], highest[room]),
        x_scale=1.0,
        max_nfev=_EVALUATIONS,
        xtol=1e-3,
        ftol=1e-3,
    )
    return best.sizes


class _Best:
    """The nearest of all sizes that were tried."""

    def __init__(self, follow: Follow, asked: Array) -> None:
        self._follow, self._asked = follow, asked
        self._last: tuple[Array, Shape] | None = None
        self._error = np.inf
        self.sizes: Array

    def shape_of(self, sizes: Array) -> Shape:
        """What `sizes`, (n,), lead to; followed once where they are asked for again."""
        if self._last is None or not np.array_equal(self._last[0], sizes):
            shape = self._follow(sizes)
            self._last = sizes.copy(), shape
            error = misfit(shape, self._asked) if shape.converged else np.inf
            if error < self._error or not np.isfinite(self._error):
                self._error, self.sizes = error, sizes.copy()
        return self._last[1]
