"""Bubbles of one sheet: alike, because they share mould and cure, but not equal.

Each bubble's constants θ_b are drawn around the sheet's: θ_b ~ N(m, Σ). The sheet's m and Σ are estimated
from all bubbles together (an empirical-Bayes fit by expectation and maximisation, Dempster et al. 1977),
and every bubble is then a compromise between its own points and its siblings. A bubble measured well keeps
its own values; one with three points borrows the shape of the curve and keeps its own stiffness.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane.balloon import Surface, Wall, YeohBalloon
from bubbleskin.membrane.data import Measurements
from bubbleskin.membrane.fit import (
    LEAST_POINTS,
    IdentifiabilityWarning,
    Noise,
    Parameters,
    UnlikelyFitWarning,
    YeohFit,
    as_points,
    fit_yeoh,
    make_fit,
    many_outliers,
    open_constants,
)
from bubbleskin.membrane.regression import (
    PASSES,
    Dimensions,
    Linear,
    Points,
    Solution,
    bisquare,
    good_points,
    huber,
    linearise,
    median_scale,
    project,
    start,
)

STIFFNESS_SPREAD = 0.10
"""What bubbles of a sheet are first supposed to differ by in wall and cure, all constants together."""

SHAPE_SPREAD = 0.05
"""And each constant by itself. Both only as strong as :data:`SUPPOSED` measured bubbles."""

SUPPOSED = 3.0
"""Measured bubbles that the two spreads above count as."""

MEAN_SPREAD = 1.0
"""The sheet's mean is first supposed to be the paper's material, scaled, within 100 % of each constant."""

STATED = 6.0
"""The stated noise counts as much as this many points do."""


@dataclass(frozen=True)
class SheetFit(Mapping[int, YeohFit]):
    """The fits of a sheet by bubble number, with what the bubbles have in common.

    ``mean`` and ``spread`` (3, 3; a covariance) describe the sheet: a further bubble of it is expected
    within them. Iterating gives the bubble numbers in ascending order.
    """

    fits: Mapping[int, YeohFit]
    mean: Parameters
    spread: np.ndarray
    scale: float

    def __getitem__(self, bubble: int) -> YeohFit:
        return self.fits[bubble]

    def __iter__(self) -> Iterator[int]:
        return iter(self.fits)

    def __len__(self) -> int:
        return len(self.fits)

    @property
    def balloons(self) -> list[YeohBalloon]:
        """The fitted balloons: entry i is bubble i. Raises ``InvalidInput`` where a bubble has not been measured."""
        missing = sorted(set(range(max(self.fits) + 1)) - set(self.fits))
        if missing == [0]:
            raise InvalidInput(
                f"the bubbles measured are numbered 1 to {max(self.fits)}, and bubbles count from 0. If the file counts from 1, "
                "read it with first=1 (--first 1): its bubble 1 is then bubble 0."
            )
        if missing:
            raise InvalidInput(
                f"bubble{'s' * (len(missing) > 1)} {', '.join(map(str, missing))} of {max(self.fits) + 1} "
                f"{'have' if len(missing) > 1 else 'has'} no measurements, and no other can stand in. Measure all, or fit them "
                "--pooled as one curve for all."
            )
        return [fit.balloon for fit in self.fits.values()]

    def report(self) -> str:
        """The fits in one table of text, with units, and what not to trust."""
        lines = [next(iter(self.fits.values())).balloon.describe().split(";")[0]]
        lines.append("bubble   points  out      mu (kPa)           C2 (Pa)            C3 (Pa)")
        for number, fit in self.fits.items():
            half = np.diff(fit.interval(), axis=1)[:, 0] / 2
            mu, c2, c3 = fit.parameters
            lines.append(
                f"{number:6d} {fit.residuals.size:8d} {int(fit.outliers.sum()):4d}  {mu / 1e3:8.3f} ± "
                f"{half[0] / 1e3:5.3f}   {c2:8.1f} ± {half[1]:6.1f}   {c3:8.2f} ± {half[2]:6.2f}"
            )
        lines.append(f"± is half a 95 % interval; noise {self.scale:.2f} times the stated one")
        lines += [f"note: bubble {n}: {note}" for n, fit in self.fits.items() for note in fit.notes]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """The fits as plain numbers with units in their names, for JSON."""
        return {
            "bubbles": {str(number): fit.as_dict() for number, fit in self.fits.items()},
            "mean_pa": list(self.mean),
            "spread_pa2": self.spread.tolist(),
        }


def fit_measurements(
    measurements: Measurements,
    *,
    pooled: bool = False,
    noise: Noise = Noise(),  # noqa: B008 - a tuple does not change
    **options: Any,
) -> YeohFit | SheetFit:
    """Fit what a file holds: one bubble (or all ``pooled`` as one) as such, several as a sheet.

    Standard deviations given in the file go before those of ``noise``; ``options`` are the sizes, as
    :func:`fit_yeoh` has them.
    """
    given, heights, pressures = measurements, measurements.height, measurements.pressure
    noise = Noise(
        noise.height_sd if given.height_sd is None else given.height_sd,
        noise.pressure_sd if given.pressure_sd is None else given.pressure_sd,
        noise.outliers,
    )
    if len(given.bubbles) > 1 and not pooled:
        return fit_sheet(given.bubble, heights, pressures, noise=noise, **options)
    # Steps of different bubbles are different settings.
    step = None if given.step is None else given.step + given.bubble * (int(given.step.max()) + 1)
    return fit_yeoh(heights, pressures, step=step, noise=noise, **options)


def fit_sheet(
    bubble: Any,
    height: Any,
    pressure: Any,
    *,
    radius: float = 2.5e-3,
    thickness: float = 1e-3,
    wall: Wall = "thin",
    surface: Surface = "mid",
    noise: Noise = Noise(),  # noqa: B008 - a tuple does not change
) -> SheetFit:
    """Fit every bubble of a sheet, the prior being what the others say.

    ``bubble`` (n,) are the bubbles' numbers, one per point; the rest is as for :func:`fit_yeoh`. A bubble
    may have as few as one point. Warns :class:`IdentifiabilityWarning` with the numbers of bubbles whose
    curve stays open between 6 and 14 mm, :class:`UnlikelyFitWarning` with those of which more than a fifth of the
    points was left out. Raises ``InvalidInput`` if all together have too few points.
    """
    dimensions = Dimensions(radius, thickness, wall, surface)
    points = as_points(height, pressure, noise)
    number = np.asarray(bubble)
    if number.shape != points.height.shape:
        raise InvalidInput(f"bubble must number each of the {len(points)} points; it has {number.size} entries.")
    if len(points) < LEAST_POINTS:
        raise InvalidInput(f"{len(points)} points on the whole sheet are too few: give at least {LEAST_POINTS}.")
    dimensions.balloon(start(dimensions, points))  # Refuses impossible sizes and pressures.
    numbers, index = np.unique(number, return_inverse=True)
    sheet = _Sheet(dimensions, points, index, robust=noise.outliers)
    sheet.run()
    covariances = sheet.covariances()
    fits = {}
    outlying: dict[int, str] = {}
    left_open: dict[int, str] = {}
    for k, n in enumerate(numbers):
        mine = index == k
        theta = sheet.phi[k] * sheet.unit
        linear = Linear(sheet.linear.design[mine] / sheet.unit, sheet.linear.target[mine])
        solution = Solution(theta, linear, sheet.weights[mine], sheet.scale)
        own = points.of(mine)
        fit = make_fit(dimensions, own, solution, covariances[k], sheet.dof)
        outlying[int(n)], left_open[int(n)] = many_outliers(fit.outliers), open_constants(fit, own)
        fits[int(n)] = replace(fit, notes=tuple(doubt for doubt in (outlying[int(n)], left_open[int(n)]) if doubt))
    _warn(outlying, UnlikelyFitWarning)
    _warn(left_open, IdentifiabilityWarning)
    mean = Parameters(*(float(v) for v in sheet.mean * sheet.unit))
    return SheetFit(fits, mean, sheet.spread * np.outer(sheet.unit, sheet.unit), sheet.scale)


def _warn(doubts: Mapping[int, str], kind: type[UserWarning]) -> None:
    """One warning with the numbers of all bubbles that have a doubt, and the first of these doubts."""
    doubtful = [n for n, doubt in doubts.items() if doubt]
    if doubtful:
        bubbles = f"bubble{'s' * (len(doubtful) > 1)} {', '.join(map(str, doubtful))}"
        warnings.warn(f"{bubbles}: {doubts[doubtful[0]]}", kind, stacklevel=3)


class _Sheet:
    """The iteration: every bubble given the sheet, then the sheet given every bubble.

    All points lie in one array, ``index`` (n,) saying to which of the bubbles each belongs; constants are
    in units of ``unit``, so that the 3 × 3 matrices, one per bubble, are well scaled.
    """

    def __init__(self, dimensions: Dimensions, points: Points, index: np.ndarray, *, robust: bool) -> None:
        self.dimensions, self.points, self.index, self.robust = dimensions, points, index, robust
        self.count = int(index.max()) + 1
        self.of = (index == np.arange(self.count)[:, None]).astype(float)
        self.unit = start(dimensions, points)
        self.eta = dimensions.at_least(points.height)
        self.supposed = np.full((3, 3), STIFFNESS_SPREAD**2) + SHAPE_SPREAD**2 * np.eye(3)
        self.mean, self.spread = np.ones(3), 4 * self.supposed
        self.phi = np.ones((self.count, 3))
        self.fitted, self.scale = 3.0, 1.0
        self.weights = np.ones(len(points))

    def run(self) -> None:
        for k in range(PASSES):
            before = self.phi
            self._see()
            self._weigh(huber if k < 5 else bisquare if k < 10 else None)
            self._each_bubble()
            self._whole_sheet()
            if k > 12 and np.max(np.abs(self.phi - before)) < 1e-5:
                break
        self._see()

    def _see(self) -> None:
        theta = (self.phi * self.unit)[self.index]
        self.eta = project(self.dimensions, self.points, theta, self.eta)
        linear = linearise(self.dimensions, self.points, theta, self.eta)
        self.linear = Linear(linear.design * self.unit, linear.target)
        self.distances = self.linear.residuals(self.phi[self.index])

    def _weigh(self, weigh: Callable[[np.ndarray], np.ndarray] | None) -> None:
        # One noise for the sheet, since a bubble with few points could not tell its own; and the stated
        # noise counts as STATED points, since a sheet with few points could not either.
        r = self.distances
        if self.robust and weigh is not None:
            self.scale = float(np.sqrt((STATED + r.size * median_scale(r, 0) ** 2) / (STATED + r.size)))
            self.weights = weigh(r / self.scale)
        elif self.robust:
            self.weights = good_points(r, self.scale, self.fitted)
        self.dof = STATED + max(float(self.weights.sum()) - self.fitted, 0.0)
        if weigh is None or not self.robust:
            self.scale = float(np.sqrt((STATED + np.sum(self.weights * r**2)) / self.dof))

    def _each_bubble(self) -> None:
        X, y = self.linear
        prior = np.linalg.inv(self.spread)
        A = np.einsum("bn,ni,nj->bij", self.of * self.weights, X, X) / self.scale**2
        b = np.einsum("bn,ni,n->bi", self.of * self.weights, X, y) / self.scale**2
        self.phi = np.linalg.solve(A + prior, (b + prior @ self.mean)[:, :, None])[:, :, 0]
        for k in np.flatnonzero(self.phi[:, 2] < 0):
            self.phi[k] = _without_c3(A[k] + prior, b[k] + prior @ self.mean)
        self.information = A
        self.covariance = np.linalg.inv(self.information + prior)
        self.fitted = float(np.einsum("bij,bji->", self.covariance, self.information)) + 1e-9

    def _whole_sheet(self) -> None:
        weak = np.eye(3) / MEAN_SPREAD**2
        prior = np.linalg.inv(self.spread)
        self.mean = np.linalg.solve(self.count * prior + weak, prior @ self.phi.sum(axis=0) + weak @ np.ones(3))
        off = self.phi - self.mean
        scatter = off.T @ off + self.covariance.sum(axis=0)
        self.spread = (scatter + SUPPOSED * self.supposed) / (self.count + SUPPOSED)

    def covariances(self) -> np.ndarray:
        """Covariance of each bubble's constants (B, 3, 3), Pa²."""
        # The sheet's mean is itself uncertain, and what a bubble takes from it, it inherits.
        prior = np.linalg.inv(self.spread)
        seen = prior - prior @ self.covariance @ prior  # what each bubble says about the mean
        of_mean = np.linalg.inv(seen.sum(axis=0) + np.eye(3) / MEAN_SPREAD**2)
        taken = self.covariance @ prior
        whole = self.covariance + taken @ of_mean @ taken.transpose(0, 2, 1)
        return whole * np.outer(self.unit, self.unit)


def _without_c3(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The minimum with C3 held at 0, and C2 too where it would be negative."""
    phi = np.zeros(3)
    phi[:2] = np.linalg.solve(A[:2, :2], b[:2])
    if phi[1] < 0:
        phi[:2] = b[0] / A[0, 0], 0.0
    return phi
