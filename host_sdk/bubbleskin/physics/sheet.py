"""Bubbles of one sheet: alike, because they share mould and cure, but not equal.

Each bubble's constants θ_b are drawn around the sheet's: θ_b ~ N(m, Σ). The sheet's m and Σ are estimated
from all bubbles together (an empirical-Bayes fit by expectation and maximisation, Dempster et al. 1977),
and every bubble is then a compromise between its own points and its siblings. A bubble measured well keeps
its own values; one with three points borrows the shape of the curve and keeps its own stiffness.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from bubbleskin.errors import InvalidInput
from bubbleskin.physics.balloon import Surface, Wall, YeohBalloon
from bubbleskin.physics.fit import (
    HEIGHT_SD,
    LEAST_POINTS,
    PRESSURE_SD,
    IdentifiabilityWarning,
    Parameters,
    YeohFit,
    as_points,
    finish,
    fit_yeoh,
    inverse,
)
from bubbleskin.physics.regression import (
    Linear,
    Points,
    Prior,
    Shape,
    Solution,
    bisquare,
    linearise,
    median_scale,
    noise_variance,
    project,
    solve_bounded,
)

STIFFNESS_SPREAD = 0.10
"""What bubbles of a sheet are first supposed to differ by in wall and cure, all constants together."""

SHAPE_SPREAD = 0.05
"""And each constant by itself. Both only as strong as :data:`SUPPOSED` measured bubbles."""

SUPPOSED = 3.0
PASSES = 40


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
        """The fitted balloons in the order of the bubble numbers."""
        return [fit.balloon for fit in self.fits.values()]


def fit_sheet(
    bubble: Any,
    height: Any,
    pressure: Any,
    *,
    radius: float = 2.5e-3,
    thickness: float = 1e-3,
    wall: Wall = "thin",
    surface: Surface = "mid",
    height_sd: Any = HEIGHT_SD,
    pressure_sd: Any = PRESSURE_SD,
    robust: bool = True,
) -> SheetFit:
    """Fit every bubble of a sheet, the prior being what the others say.

    ``bubble`` (n,) are the bubbles' numbers, one per point; the rest is as for :func:`fit_yeoh`. A bubble
    may have as few as one point. Raises ``InvalidInput`` if all bubbles together have too few.
    """
    shape = Shape(radius, thickness, wall, surface)
    points = as_points(height, pressure, height_sd, pressure_sd)
    number = np.asarray(bubble)
    if number.shape != points.height.shape:
        raise InvalidInput(f"bubble must number each of the {len(points)} points; it has {number.size} entries.")
    if len(points) < LEAST_POINTS:
        raise InvalidInput(f"{len(points)} points on the whole sheet are too few: give at least {LEAST_POINTS}.")
    members = {int(n): _subset(points, number == n) for n in np.unique(number)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pooled bubbles differ, so its own doubts mean nothing here
        pooled = fit_yeoh(
            points.height, points.pressure, radius=radius, thickness=thickness, wall=wall, surface=surface,
            height_sd=points.height_sd, pressure_sd=points.pressure_sd, robust=robust,
        )  # fmt: skip
    state = _Sheet(shape, members, np.array(pooled.parameters), robust=robust)
    state.run()
    return state.result()


class _Sheet:
    """The iteration: every bubble given the sheet, the sheet given every bubble."""

    def __init__(
        self, shape: Shape, members: dict[int, Points], pooled: np.ndarray, *, robust: bool
    ) -> None:
        self.shape, self.members, self.robust = shape, members, robust
        unit = np.maximum(pooled, [0.0, 0.1 * pooled[0] / 100, pooled[0] / 5000])
        self.supposed = STIFFNESS_SPREAD**2 * np.outer(unit, unit) + SHAPE_SPREAD**2 * np.diag(unit**2)
        self.mean, self.spread = pooled, 4 * self.supposed
        self.theta = {n: pooled for n in members}
        self.eta = {n: points.height for n, points in members.items()}
        self.weights = {n: np.ones(len(points)) for n, points in members.items()}
        self.linear: dict[int, Linear] = {}
        self.covariance: dict[int, np.ndarray] = {}
        self.scale, self.variance = 1.0, 1.0

    def run(self) -> None:
        for k in range(PASSES):
            before = np.concatenate(list(self.theta.values()))
            self._see()
            self._weigh(hold=k > PASSES // 2)
            self._each_bubble()
            self._whole_sheet()
            after = np.concatenate(list(self.theta.values()))
            if k > 3 and np.max(np.abs(after - before) / np.tile(self.theta_unit, len(self.theta))) < 1e-5:
                break

    @property
    def theta_unit(self) -> np.ndarray:
        return np.sqrt(np.diag(self.supposed))

    def _see(self) -> None:
        for n, points in self.members.items():
            self.eta[n] = project(self.shape, points, self.theta[n], self.eta[n])
            self.linear[n] = linearise(self.shape, points, self.theta[n], self.eta[n])

    def _weigh(self, *, hold: bool) -> None:
        # One noise for the sheet: a bubble with few points could not tell its own.
        residuals = {n: self.linear[n].residuals(self.theta[n]) for n in self.members}
        every = np.concatenate(list(residuals.values()))
        fitted = min(3.0 * len(self.members), every.size / 2)
        if self.robust:
            if not hold:
                self.scale = median_scale(every, int(fitted))
            self.weights = {n: bisquare(r / self.scale) for n, r in residuals.items()}
        else:
            self.scale = float(np.sqrt(np.sum(every**2) / max(every.size - fitted, 1)))
        self.variance = noise_variance(every, self.scale, robust=self.robust, fitted=fitted)
        self.dof = max(every.size - fitted, 1.0)

    def _each_bubble(self) -> None:
        prior = Prior(self.mean, inverse(self.spread))
        for n in self.members:
            X, y = self.linear[n]
            noise = np.sqrt(self.variance)
            self.theta[n] = solve_bounded(Linear(X / noise, y / noise), self.weights[n], prior)
            kept = X * (self.weights[n] > 0)[:, None] / noise
            self.covariance[n] = inverse(kept.T @ kept + prior.precision)

    def _whole_sheet(self) -> None:
        thetas = np.array(list(self.theta.values()))
        self.mean = thetas.mean(axis=0)
        off = thetas - self.mean
        scatter = off.T @ off + sum(self.covariance.values())
        self.spread = (scatter + SUPPOSED * self.supposed) / (len(thetas) + SUPPOSED)

    def result(self) -> SheetFit:
        self._see()
        count = len(self.members)
        prior = inverse(self.spread)
        fits = {}
        for n, points in self.members.items():
            # The sheet's mean is itself uncertain; what a bubble takes from it, it inherits.
            taken = self.covariance[n] @ prior
            covariance = self.covariance[n] + taken @ (self.spread / count) @ taken.T
            distances = self.linear[n].residuals(self.theta[n])
            solution = Solution(self.theta[n], self.linear[n], self.weights[n], self.scale)
            fits[n] = finish(self.shape, points, self.theta[n], covariance, distances, solution, self.dof)
        mean = Parameters(*(float(v) for v in self.mean))
        return SheetFit(fits, mean, self.spread, self.scale)


def _subset(points: Points, mask: np.ndarray) -> Points:
    return Points(points.height[mask], points.pressure[mask], points.height_sd[mask], points.pressure_sd[mask])
