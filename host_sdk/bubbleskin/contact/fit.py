"""Springs from measured shapes: what necks and contact must be like for the heights that were seen."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares

from bubbleskin.checks import finite, number, positive
from bubbleskin.contact.model import KBASE, KC, KXY, KZ, CompliantContact
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon

Array = NDArray[np.float64]

_PRIOR = np.log(10.0)
"""The preset counts as known to a factor of ten: what the measurements leave open stays near it."""
_STARTS = (0.5, 1.0, 2.0)
_STEP = 2e-3
_GOOD = 3.0  # standard deviations: a fit that leaves less has found the branches


@dataclass(frozen=True, eq=False)
class Measured:
    """A shape that was measured: the pressures that led there, (k, n) Pa, and the heights found, (n,) mm, nan for none."""

    steps: ArrayLike
    height_mm: ArrayLike


@dataclass(frozen=True, eq=False)
class ContactFit:
    """Springs in N/m with what is known of them."""

    kz: float
    kxy: float
    kc: float
    factor: Array
    """By which `kz`, `kxy`, `kc` may be off, one standard deviation, (3,): 1.1 is 10 %, 10 is not known at all."""
    residual_mm: Array
    """Model less measurement, one entry per height."""
    contact: CompliantContact
    """The model with these springs."""

    @property
    def open(self) -> tuple[str, ...]:
        """The springs that the measurements say next to nothing of (not known to a factor of 2)."""
        return tuple(name for name, off in zip(("kz", "kxy", "kc"), self.factor, strict=True) if off > 2)


def fit_contact(
    measurements: Iterable[Measured],
    layout: Layout,
    balloon: YeohBalloon | Sequence[YeohBalloon] | None = None,
    *,
    sd_mm: float = 0.05,
    kbase: float = KBASE,
    seed: int = 0,
) -> ContactFit:
    """Find `kz`, `kxy` and `kc` with which the model has the measured heights, by least squares of their logarithms.

    Heights of bubbles that touch nobody say nothing of springs; at least one shape should have a bubble lifted, and
    one a bubble squeezed. `sd_mm` is the measurements' standard deviation. Several starts, since which branch a path
    ends on jumps with the springs. Raises `InvalidInput` for measurements that do not fit the layout.
    """
    positive("sd_mm", number("sd_mm", sd_mm), "mm")
    shapes = [_checked(one, layout) for one in measurements]
    if not shapes:
        raise InvalidInput("No measurements: give at least one shape with its pressures.")
    middle = np.log([KZ, KXY, KC])

    def model(x: Array) -> CompliantContact:
        kz, kxy, kc = np.exp(x)
        return CompliantContact(layout, balloon, kz=kz, kxy=kxy, kc=kc, kbase=kbase, seed=seed)

    def off(x: Array) -> Array:
        made = model(x)
        return np.concatenate([(made.settle(steps).height_mm - h)[~np.isnan(h)] for steps, h in shapes])

    def residuals(x: Array) -> Array:
        return np.concatenate([off(x) / sd_mm, (x - middle) / _PRIOR])

    def found_from(x: Array) -> OptimizeResult:
        return least_squares(residuals, x, bounds=wide, diff_step=np.full(3, _STEP), xtol=1e-6)

    wide = (middle - np.log(100), middle + np.log(100))
    tries = [found_from(middle)]
    if float(np.abs(tries[0].fun).max()) > _GOOD:  # another branch somewhere: the best of some other starts
        starts = [middle + np.log(factors) for factors in product(_STARTS, repeat=3)]
        tries += [found_from(x) for x in sorted(starts, key=lambda x: float((residuals(x) ** 2).sum()))[:2]]
    found = min(tries, key=lambda one: float(one.cost))
    slope = np.asarray(found.jac)
    covariance = np.linalg.inv(slope.T @ slope)
    kz, kxy, kc = np.exp(found.x)
    return ContactFit(
        float(kz), float(kxy), float(kc), np.exp(np.sqrt(np.diag(covariance))), off(found.x), model(found.x)
    )


def _checked(one: Measured, layout: Layout) -> tuple[Array, Array]:
    steps = np.atleast_2d(finite("steps", one.steps))
    try:
        heights = np.asarray(one.height_mm, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(
            f"Heights must be numbers of mm, nan where none was measured, not {one.height_mm!r}."
        ) from None
    if steps.shape[1] != len(layout) or heights.shape != (len(layout),):
        raise InvalidInput(
            f"A measurement of this layout has steps of {len(layout)} pressures and {len(layout)} heights; "
            f"one has {steps.shape[1]} and {heights.size}."
        )
    if np.isnan(heights).all() or np.isinf(heights).any():
        raise InvalidInput("A measurement needs at least one height, and none may be infinite.")
    return steps, heights
