"""Weighted, robust, bounded regression of the Yeoh constants on points with noise in both axes.

The pressure is linear in θ = (μ, C2, C3), so each pass is a linear least-squares problem. Noise in height
enters by projection: every point is moved to the nearest place η on the curve, near in units of its own
noise, and its pressure is carried there along the tangent (orthogonal distance regression, Boggs and
Rogers 1990, for a model that is linear in its constants). Outliers are weighed down by Tukey's bisquare
around the curve of least median distance, with the noise found there (an MM estimate, Yohai 1987).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import wall as walls
from bubbleskin.membrane.balloon import Surface, Wall, YeohBalloon, yeoh_pressure

HUBER, BISQUARE = 1.345, 4.685
"""Standard deviations: with these the weights are 95 % efficient on clean Gaussian noise."""
LOST = 6e-5
"""Share of good points that is taken for outliers: with many points those beyond 4 standard deviations."""
PASSES = 60
"""Of the iteration, at most."""
SUBSETS = 500
"""Threes of points that are tried: with four of ten points wrong, one of five threes is good."""
LEAST_CHANGE = 1e-7
"""Relative, of θ: a smaller one ends the passes."""

_UNIT = np.eye(3)[:, :, None]  # θ = (1,0,0), (0,1,0), (0,0,1), to broadcast over points


@dataclass(frozen=True)
class Dimensions:
    """What the fit takes as given: the rest sizes of the bubble (m) and the kind of its wall."""

    radius: float
    thickness: float
    wall: Wall
    surface: Surface

    def balloon(self, theta: np.ndarray) -> YeohBalloon:
        """The bubble of these dimensions made of the material ``theta``."""
        mu, c2, c3 = (float(v) for v in theta)
        return YeohBalloon(
            mu=mu, c2=c2, c3=c3, thickness=self.thickness, radius=self.radius, wall=self.wall,
            surface=self.surface,
        )  # fmt: skip

    @property
    def rest_height(self) -> float:
        """Height (m) without pressure."""
        return 2 * walls.rest_radii(self.thickness, self.radius, self.wall, self.surface)[1]

    def at_least(self, height: np.ndarray) -> np.ndarray:
        """Heights moved to where the formulas hold: noise may put a point a little below rest, not into the wall."""
        return np.maximum(height, 0.97 * self.rest_height)

    def basis(self, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """∂P/∂θ and ∂²P/∂θ∂h at ``height`` (m), each (n, 3): the model is P = basis · θ."""
        sizes = (self.thickness, self.radius, self.wall, self.surface)
        x = walls.stretch_of_outer(height / 2, *sizes)
        mu, c2, c3 = _UNIT[:, 0], _UNIT[:, 1], _UNIT[:, 2]
        if self.wall == "thin":
            P = yeoh_pressure(x, mu, c2, c3, self.thickness, self.radius)
        else:
            P = walls.thick_pressure(x, mu, c2, c3, *sizes)
        dP = walls.slope(x, mu, c2, c3, *sizes) / (2 * walls.radius_slope(x, *sizes)[1])
        return P.T, dP.T


@dataclass(frozen=True)
class Points:
    """Measured points of one bubble: height (m), pressure (Pa) and the standard deviation of each."""

    height: np.ndarray
    pressure: np.ndarray
    height_sd: np.ndarray
    pressure_sd: np.ndarray

    def __len__(self) -> int:
        return self.height.size

    def of(self, mask: np.ndarray) -> Points:
        """Those points that ``mask`` marks."""
        return Points(self.height[mask], self.pressure[mask], self.height_sd[mask], self.pressure_sd[mask])


class Linear(NamedTuple):
    """The regression problem as seen from one θ: rows of ``design`` against ``target``, unit noise."""

    design: np.ndarray
    """(n, 3)."""
    target: np.ndarray
    """(n,)."""

    def residuals(self, theta: np.ndarray) -> np.ndarray:
        """Signed distances from the curve in units of the noise."""
        return self.target - (self.design * theta).sum(axis=1)


class Solution(NamedTuple):
    """Where the passes ended."""

    theta: np.ndarray
    """(3,), Pa."""
    linear: Linear
    weights: np.ndarray
    """Of each point, 0 (left out) to 1, (n,)."""
    scale: float
    """Noise found, in units of the noise stated."""


def start(dimensions: Dimensions, points: Points) -> np.ndarray:
    """The paper's material scaled by the median of measured over expected pressure."""
    theta = np.array([YeohBalloon.mu, YeohBalloon.c2, YeohBalloon.c3])
    sunk = points.height < 0.9 * dimensions.rest_height
    if sunk.any():
        k = int(np.argmax(sunk))
        raise InvalidInput(
            f"point {k} is {points.height[k] * 1e3:g} mm tall, but a bubble of this diameter is "
            f"{dimensions.rest_height * 1e3:g} mm tall at rest: check the units, the diameter, and of which surface it is."
        )
    lifted = points.height > 1.05 * dimensions.rest_height
    if not lifted.any():
        raise InvalidInput(
            f"no point is more than 5 % above the rest height of {dimensions.rest_height * 1e3:g} mm: "
            "there is no inflation to fit. Check the units and the diameter."
        )
    expected = dimensions.basis(points.height[lifted])[0] @ theta
    ratio = float(np.median(points.pressure[lifted] / expected))
    if ratio <= 0:
        raise InvalidInput("more than half of the pressures are zero or negative: there is nothing to fit.")
    return theta * ratio


def least_median(dimensions: Dimensions, points: Points, theta: np.ndarray) -> np.ndarray:
    """Of curves through three points each, and ``theta``, the one whose median distance from all points is least.

    Rousseeuw's least median of squares: up to half of the points may be anything. A point of each third of the heights, so
    that the three say something of all constants; drawn by a generator of its own, so that the same points give the same curve.
    """
    third = len(points) // 3
    if third < 2:
        return theta
    order, chance = np.argsort(points.height, kind="stable"), np.random.default_rng(0)
    parts = (order[:third], order[third : 2 * third], order[2 * third :])
    rows = np.stack([chance.choice(part, SUBSETS) for part in parts], axis=1)
    basis, slopes = dimensions.basis(dimensions.at_least(points.height))
    unit = np.abs(basis).mean(axis=0)
    design = basis / unit
    solvable = np.linalg.cond(design[rows]) < 1e6
    found = np.linalg.solve(design[rows[solvable]], points.pressure[rows[solvable], None])[:, :, 0] / unit
    thetas = np.vstack([theta, found[(found[:, 0] > 100) & (found[:, 2] >= 0)]])
    sd = np.hypot(points.pressure_sd, (slopes @ thetas.T).T * points.height_sd)
    distances = np.abs(points.pressure - thetas @ basis.T) / sd
    return np.asarray(thetas[np.argmin(np.median(distances, axis=1))])


def project(dimensions: Dimensions, points: Points, theta: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """The place on the curve nearest to each point, from the guess ``eta``, in heights (m).

    ``theta`` is (3,) for points of one curve, (n, 3) if each point has its own.
    """
    for _ in range(3):
        basis, slopes = dimensions.basis(eta)
        P, dP = (basis * theta).sum(axis=1), (slopes * theta).sum(axis=1)
        gradient = (eta - points.height) / points.height_sd**2 + (P - points.pressure) * dP / points.pressure_sd**2
        curvature = 1 / points.height_sd**2 + (dP / points.pressure_sd) ** 2
        step = np.clip(gradient / curvature, -0.1 * dimensions.rest_height, 0.1 * dimensions.rest_height)
        eta = dimensions.at_least(eta - step)
    return eta


def linearise(dimensions: Dimensions, points: Points, theta: np.ndarray, eta: np.ndarray) -> Linear:
    """The problem with each point carried along the tangent to its place ``eta`` on the curve."""
    basis, slopes = dimensions.basis(eta)
    dP = (slopes * theta).sum(axis=1)
    sd = np.sqrt(points.pressure_sd**2 + (dP * points.height_sd) ** 2)
    return Linear(basis / sd[:, None], (points.pressure + dP * (eta - points.height)) / sd)


def solve_bounded(linear: Linear, weights: np.ndarray) -> np.ndarray:
    """Least squares with C3 ≥ 0, and C2 ≥ 0 where C3 is 0: else the wall would lose its stiffness."""
    X = linear.design * np.sqrt(weights)[:, None]
    A, b = X.T @ X, X.T @ (linear.target * np.sqrt(weights))
    if not (np.all(np.isfinite(A)) and np.all(np.diag(A) > 1e-100)):  # the passes have left all points behind
        raise _no_curve(weights)
    theta = np.zeros(3)
    for free in (3, 2, 1):
        scale = 1 / np.sqrt(np.diag(A)[:free])
        part = np.linalg.lstsq(A[:free, :free] * np.outer(scale, scale), b[:free] * scale, rcond=1e-15)[0]
        theta[:] = 0.0
        theta[:free] = part * scale
        if free == 1 or theta[free - 1] >= 0:
            break
    if theta[0] < 100:
        raise InvalidInput(
            f"the best fit has a shear modulus of {theta[0] / 1e3:.3g} kPa, which no elastomer has: check "
            "that the columns are height and gauge pressure, their units, the diameter and the wall."
        )
    return theta


def _no_curve(weights: np.ndarray) -> InvalidInput:
    return InvalidInput(
        f"only {np.count_nonzero(weights)} of {weights.size} points lie near one curve: check that the columns are height and "
        "gauge pressure, their units, the diameter and the wall."
    )


def median_scale(residuals: np.ndarray, fitted: int = 3) -> float:
    """Standard deviation of the bulk of ``residuals`` by their median absolute value, never quite zero."""
    spare = max(residuals.size - fitted, 1)
    return max(1.4826 * float(np.median(np.abs(residuals))) * np.sqrt(residuals.size / spare), 1e-3)


def least_median_scale(residuals: np.ndarray, fitted: int = 3) -> float:
    """That of residuals whose median has been made as small as it gets: with Rousseeuw and Leroy's factor for few points.

    It stays as it is while the weights move: found anew for each curve, it would shrink around a handful of points.
    """
    few = 1 + 5 / max(residuals.size - fitted, 1)
    return max(1.4826 * few * float(np.median(np.abs(residuals))), 1e-3)


def huber(u: np.ndarray) -> np.ndarray:
    """Huber's weights at residuals ``u`` in units of the scale."""
    return np.minimum(1.0, HUBER / np.maximum(np.abs(u), 1e-300))


def bisquare(u: np.ndarray) -> np.ndarray:
    """Tukey's bisquare weights at residuals ``u`` in units of the scale."""
    return np.clip(1 - (u / BISQUARE) ** 2, 0, None) ** 2


def good_points(residuals: np.ndarray, scale: float, fitted: float = 3) -> np.ndarray:
    """1 for good points, 0 for outliers; at least 4 are good.

    The fewer the points, the less is known of the scale, and the further out a point must be.
    """
    from scipy import stats

    cut = float(stats.t.isf(LOST / 2, max(residuals.size - fitted, 1.0)))
    good = np.abs(residuals) <= cut * scale
    if good.sum() < 4:
        good[np.argsort(np.abs(residuals))[:4]] = True
    return good.astype(float)


def scale_of_good(residuals: np.ndarray, weights: np.ndarray, fitted: float = 3) -> float:
    """Standard deviation of the points that ``weights`` leaves in, for that many constants fitted."""
    return max(float(np.sqrt(np.sum(weights * residuals**2) / max(np.sum(weights) - fitted, 1.0))), 1e-9)


def regress(dimensions: Dimensions, points: Points, *, robust: bool) -> Solution:
    """Fit θ to ``points``: from the least median by bisquare weights, then without the outliers (Yohai's MM estimate)."""
    theta, eta = start(dimensions, points), dimensions.at_least(points.height)
    weights, scale = np.ones(len(points)), 1.0
    if robust:
        theta = least_median(dimensions, points, theta)
        nearest = project(dimensions, points, theta, eta)
        scale = least_median_scale(linearise(dimensions, points, theta, nearest).residuals(theta))
    for stage in ("bisquare", "trim") if robust else ("plain",):
        for _ in range(PASSES):
            eta = project(dimensions, points, theta, eta)
            linear = linearise(dimensions, points, theta, eta)
            residuals = linear.residuals(theta)
            if stage == "bisquare":
                weights = bisquare(residuals / scale)
            elif stage == "trim":
                weights = good_points(residuals, scale)
                scale = scale_of_good(residuals, weights)
            new = solve_bounded(linear, weights)
            change = float(np.max(np.abs(new - theta) / (np.abs(new) + 1e-6 * new[0])))
            theta = new
            if change < (LEAST_CHANGE if stage in ("plain", "trim") else 1e-3):
                break
    eta = project(dimensions, points, theta, eta)
    linear = linearise(dimensions, points, theta, eta)
    if np.mean(weights == 0) > 0.5:
        raise _no_curve(weights)
    return Solution(theta, linear, weights, scale_of_good(linear.residuals(theta), weights))
