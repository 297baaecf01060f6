"""From measured heights and pressures to a material, and how far to trust it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from bubbleskin.checks import Numbers, finite, like, positive
from bubbleskin.errors import InvalidInput
from bubbleskin.membrane.balloon import Surface, Wall, YeohBalloon
from bubbleskin.membrane.regression import Dimensions, Points, Solution, regress
from bubbleskin.pictured import Pictured

HEIGHT_SD = 0.05e-3
"""Standard deviation (m) assumed of a height when none is given."""

PRESSURE_SD = 150.0
"""Standard deviation (Pa) assumed of a pressure when none is given."""

LEAST_POINTS = 4
CONDITION_LIMIT = 30.0
"""Of the design matrix: data over 5-14 mm has 10 to 20, data from the plateau alone 35 to 60."""
WIDTH_LIMIT = 0.05
"""Share of the pressure: a wider 95 % band somewhere in 6-14 mm is worth a warning."""
LACK_OF_FIT_LEVEL = 0.01
"""Repeats that agree so improbably well speak against the model."""


OUTLIERS_LIMIT = 0.2
"""Share of the points that is worth a warning. So many may be anything; of more, it depends on where they stand."""
STIFFNESS = (3e3, 5e6)
"""Shear moduli (Pa) of silicone rubbers, from the softest gels to hard ones."""


class Noise(NamedTuple):
    """What is known beforehand of the errors of measured points; scalars or one entry per point, (n,)."""

    height_sd: Any = HEIGHT_SD
    """Standard deviation, m."""
    pressure_sd: Any = PRESSURE_SD
    """Standard deviation, Pa."""
    outliers: bool = True
    """Whether some points may be far off; they are then found and left out."""


class IdentifiabilityWarning(UserWarning):
    """The data does not determine all three constants."""


class LackOfFitWarning(UserWarning):
    """Repeated measurements agree with each other much better than with the model."""


class UnlikelyFitWarning(UserWarning):
    """The constants are those of no rubber, or much of the data was left out."""


class Parameters(NamedTuple):
    """The constants of the Yeoh energy, Pa."""

    mu: float
    c2: float
    c3: float


class Repeats(NamedTuple):
    """What repeated settings (triplicates) say about the noise; see :func:`fit_yeoh`."""

    height_sd: float
    """m, between repeats of one setting."""
    pressure_sd: float
    """Pa, between repeats of one setting."""
    settings: int
    """How many there are."""
    p_value: float
    """Of the settings' means lying where the model says; small means that they do not."""


@dataclass(frozen=True)
class YeohFit(Pictured):
    """A fitted bubble with its uncertainty.

    ``parameters`` (μ, C2, C3) in Pa and their ``covariance`` (3, 3); ``residuals`` (n,) in Pa, measured
    minus model at the measured height; ``distances`` (n,) from the curve in units of the noise that was
    stated; ``outliers`` (n,), which points were left out; ``scale``, the noise found in units of the noise
    stated; ``dof`` degrees of freedom behind it; ``notes``, sentences about what not to trust.
    """

    balloon: YeohBalloon
    parameters: Parameters
    covariance: np.ndarray
    residuals: np.ndarray
    distances: np.ndarray
    outliers: np.ndarray
    scale: float
    dof: float
    repeats: Repeats | None = None
    notes: tuple[str, ...] = ()
    dimensions: Dimensions = field(repr=False, kw_only=True)

    @property
    def balloons(self) -> list[YeohBalloon]:
        """The fitted balloon in a list, as a sheet's fit has several."""
        return [self.balloon]

    def __repr__(self) -> str:
        mu, c2, c3 = self.parameters
        return f"<YeohFit of {self.residuals.size} points: mu {mu / 1e3:.4g} kPa, C2 {c2:.4g} Pa, C3 {c3:.4g} Pa>"

    def interval(self, level: float = 0.95) -> np.ndarray:
        """Confidence interval of each constant, (3, 2) in Pa; C3's is cut off at 0."""
        half = self._quantile(level) * np.sqrt(np.diag(self.covariance))
        ends = np.stack([np.array(self.parameters) - half, np.array(self.parameters) + half], axis=1)
        ends[2] = np.maximum(ends[2], 0.0)
        return ends

    def pressure_sd(self, height: Numbers) -> Numbers:
        """Standard deviation (Pa) of the model's pressure at ``height`` (m)."""
        h = positive("height", height, "m")
        basis, _ = self.dimensions.basis(np.atleast_1d(h).ravel())
        sd = np.sqrt(np.einsum("ij,jk,ik->i", basis, self.covariance, basis)).reshape(np.shape(h))
        return like(height, sd)

    def pressure_band(self, height: Numbers, level: float = 0.95) -> tuple[Numbers, Numbers]:
        """Lowest and highest pressure (Pa) of the model at ``height`` (m) that the data allows."""
        middle = self.balloon.pressure_at_height(height)
        half = self._quantile(level) * self.pressure_sd(height)
        return middle - half, middle + half

    def height_band(self, pressure: Numbers, level: float = 0.95, *, up_to: float = 0.0) -> tuple[Numbers, Numbers]:
        """Lowest and highest height (m) at ``pressure`` (Pa) that the data allows.

        All heights whose pressure band holds the pressure are allowed, so on a plateau, or across a snap,
        the band is as wide as the ignorance really is. Looked for from rest to ``up_to`` (else three
        times the rest height); the ends of that range are the answer where nothing narrower is known.
        """
        p = finite("pressure", pressure)
        top = max(up_to, 3 * self.balloon.rest_height)
        h = np.linspace(self.balloon.rest_height, top, 4000)
        low, high = self.pressure_band(h, level)
        # The first height whose upper end reaches p, and the last whose lower end is still below p.
        reach = np.maximum.accumulate(high)
        still = np.minimum.accumulate(low[::-1])[::-1]
        return like(pressure, np.interp(p, reach, h)), like(pressure, np.interp(p, still, h))

    def report(self) -> str:
        """The fit in a few lines of text, with units."""
        ends = self.interval()
        lines = [self.balloon.describe()]
        for name, value, (low, high) in zip(("mu", "C2", "C3"), self.parameters, ends, strict=True):
            lines.append(f"  {name} = {value:.5g} Pa   95 % interval {low:.5g} to {high:.5g} Pa")
        lines.append(
            f"  {self.residuals.size} points, {int(self.outliers.sum())} taken as outliers; "
            f"noise {self.scale:.2f} times the stated one"
        )
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """The fit as plain numbers with units in their names, for JSON."""
        ends = self.interval()
        return {
            **{f"{name}_pa": value for name, value in self.parameters._asdict().items()},
            **{f"{name}_95_pa": list(map(float, ends[k])) for k, name in enumerate(Parameters._fields)},
            "covariance_pa2": self.covariance.tolist(),
            "thickness_mm": self.dimensions.thickness * 1e3,
            "diameter_mm": self.dimensions.radius * 2e3,
            "diameter_is": self.dimensions.surface,
            "wall": self.dimensions.wall,
            "points": int(self.residuals.size),
            "outliers": np.flatnonzero(self.outliers).tolist(),
            "noise_found_over_stated": self.scale,
            "limit_points_kpa": [point.pressure / 1e3 for point in self.balloon.limit_points()],
            "notes": list(self.notes),
        }

    def _quantile(self, level: float) -> float:
        from scipy import stats

        if not 0 < level < 1:
            raise InvalidInput(f"level is {level:g}, but a confidence level lies between 0 and 1 (0.95).")
        return float(stats.t.ppf((1 + level) / 2, self.dof))


def fit_yeoh(
    height: Any,
    pressure: Any,
    *,
    radius: float = 2.5e-3,
    thickness: float = 1e-3,
    wall: Wall = "thin",
    surface: Surface = "mid",
    noise: Noise = Noise(),  # noqa: B008 - a tuple does not change
    step: Any = None,
) -> YeohFit:
    """Fit μ, C2, C3 to points (``height`` m, ``pressure`` Pa gauge), (n,) each, n ≥ 4.

    The points may come from one bubble or, pooled, from many; :func:`fit_sheet` fits each by itself.
    ``radius``, ``thickness``, ``wall`` and ``surface`` are taken as given, as :class:`YeohBalloon` has them.
    Noise is in both axes; only the ratio of its two standard deviations matters, for its size is found from
    the residuals. Outliers are points that noise would put so far off the curve once in 16000 times. A fifth of
    the points may be anything. C3 stays ≥ 0.

    ``step`` (n,) names the setting of each point, and points of one setting are repeats (triplicates).
    If they agree with each other much better than with the model, the model is at fault, not the noise:
    a note says so and the covariance is widened to cover it.

    Warns :class:`IdentifiabilityWarning` when the data (all on the plateau, say) leaves the curve between
    6 and 14 mm open, and :class:`UnlikelyFitWarning` where more than a fifth of the points was left out. Raises
    ``InvalidInput`` for too few or impossible points, and where most lie near no curve.
    """
    dimensions = Dimensions(radius, thickness, wall, surface)
    dimensions.balloon(np.array([YeohBalloon.mu, YeohBalloon.c2, YeohBalloon.c3]))  # Refuses impossible sizes.
    points = as_points(height, pressure, noise)
    if len(points) < LEAST_POINTS:
        raise InvalidInput(
            f"{len(points)} points cannot fix three constants and their uncertainty: give at least "
            f"{LEAST_POINTS}, better 12 or more from just above rest up to 12 mm."
        )
    solution = regress(dimensions, points, robust=noise.outliers)
    linear = solution.linear
    distances = linear.residuals(solution.theta)
    variance = solution.scale**2
    dof = max(float(solution.weights.sum()) - 3.0, 1.0)
    notes: list[str] = []
    repeats = None
    if step is not None:
        repeats, between = _repeats(points, solution, distances, np.asarray(step))
        if repeats is not None and repeats.p_value < LACK_OF_FIT_LEVEL and between > variance:
            variance, dof = between, float(repeats.settings - 3)
            note = (
                f"repeats agree within {repeats.height_sd * 1e3:.3f} mm, but the settings miss the curve by "
                f"{np.sqrt(between):.1f} times the stated noise: model, wall or calibration is off. The "
                "intervals are widened to cover it."
            )
            notes.append(note)
            warnings.warn(note, LackOfFitWarning, stacklevel=2)
    for doubt in (_unlikely_units(float(solution.theta[0])), many_outliers(solution.weights == 0)):
        if doubt:
            notes.append(doubt)
            warnings.warn(doubt, UnlikelyFitWarning, stacklevel=2)
    covariance = variance * inverse(linear.design.T @ (linear.design * solution.weights[:, None]))
    fit = replace(make_fit(dimensions, points, solution, covariance, dof), repeats=repeats, notes=tuple(notes))
    condition = float(np.linalg.cond(linear.design / np.linalg.norm(linear.design, axis=0)))
    doubt = open_constants(fit, points, condition)
    if doubt:
        warnings.warn(doubt, IdentifiabilityWarning, stacklevel=2)
        fit = replace(fit, notes=(*fit.notes, doubt))
    return fit


def _unlikely_units(mu: float) -> str:
    """A sentence where μ is no rubber's, with what was probably meant."""
    if STIFFNESS[0] <= mu <= STIFFNESS[1]:
        return ""
    meant = [unit for unit, factor in (("mbar", 100), ("kPa", 1000), ("MPa", 1e6)) if 1e4 <= mu * factor <= 1e6]
    guess = f"if they were {meant[0]}, say so or convert them" if meant and mu < STIFFNESS[0] else "look at their units"
    return (
        f"mu = {mu:.3g} Pa is the shear modulus of no silicone rubber (some kPa to some MPa). Pressures are taken in Pa and "
        f"heights in m: {guess}."
    )


def many_outliers(outliers: np.ndarray) -> str:
    """A sentence where more points were left out, of ``outliers`` (n,), than are sure to be the wrong ones."""
    share = float(np.mean(outliers))
    if share <= OUTLIERS_LIMIT:
        return ""
    return (
        f"{100 * share:.0f} % of the points were left out as outliers. Above {100 * OUTLIERS_LIMIT:.0f} % they may be the good "
        "ones, where the others agree on something else: look at the picture (bubbleskin plot fit)."
    )


def as_points(height: Any, pressure: Any, noise: Noise) -> Points:
    """Check measured points and give each its own noise."""
    h, p = np.atleast_1d(positive("height", height, "m")), np.atleast_1d(finite("pressure", pressure))
    if h.ndim != 1 or h.shape != p.shape:
        raise InvalidInput(
            f"height and pressure must be two lists of equal length, not of shapes {h.shape} and {p.shape}."
        )
    if h.size and np.median(h) > 0.5:
        raise InvalidInput(
            f"the heights (median {np.median(h):g}) are in metres here, and no bubble is that tall: divide "
            "mm by 1000, or read the file with read_csv, which knows units."
        )
    sds = []
    for name, value, unit in (("height_sd", noise.height_sd, "m"), ("pressure_sd", noise.pressure_sd, "Pa")):
        sd = positive(name, value, unit)
        if sd.ndim and sd.shape != h.shape:
            raise InvalidInput(f"{name} must be one number or one per point ({h.size}), not {sd.size}.")
        sds.append(np.broadcast_to(sd, h.shape).astype(float))
    low = p < -5 * sds[1]
    if low.any():
        k = int(np.argmax(low))
        raise InvalidInput(
            f"point {k} has a gauge pressure of {p[k]:g} Pa: that is suction, not inflation. Subtract the "
            "ambient pressure correctly, or leave the point out."
        )
    return Points(h, p, sds[0], sds[1])


def make_fit(dimensions: Dimensions, points: Points, solution: Solution, covariance: np.ndarray, dof: float) -> YeohFit:
    """What is known about one fitted bubble: ``covariance`` (3, 3) in Pa² of its constants, with ``dof`` degrees of freedom."""
    theta = solution.theta
    return YeohFit(
        dimensions.balloon(theta),
        Parameters(*(float(value) for value in theta)),
        covariance,
        points.pressure - dimensions.basis(dimensions.at_least(points.height))[0] @ theta,
        solution.linear.residuals(theta),
        solution.weights == 0,
        solution.scale,
        dof,
        dimensions=dimensions,
    )


def inverse(A: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric matrix whose rows differ by many orders of magnitude."""
    scale = 1 / np.sqrt(np.maximum(np.diag(A), 1e-300))
    return np.linalg.pinv(A * np.outer(scale, scale), rcond=1e-14, hermitian=True) * np.outer(scale, scale)


def _repeats(
    points: Points, solution: Solution, distances: np.ndarray, step: np.ndarray
) -> tuple[Repeats | None, float]:
    """Noise between repeats, and the variance of the settings' means about the curve per repeat."""
    from scipy import stats

    if step.shape != distances.shape:
        raise InvalidInput(f"step must name the setting of each of the {distances.size} points.")
    good = solution.weights > 0
    _, group = np.unique(step[good], return_inverse=True)
    count = np.bincount(group)
    inner = int(good.sum() - count.size)
    if count.size <= 3 or inner < count.size // 2:
        return None, 0.0

    def scatter(values: np.ndarray) -> float:
        deviation = values - (np.bincount(group, values) / count)[group]
        return float(np.sum(deviation**2) / inner)

    means = np.bincount(group, distances[good]) / count
    between = float(np.sum(count * means**2) / (count.size - 3))
    within = max(scatter(distances[good]), 1e-12)
    p_value = float(stats.f.sf(between / within, count.size - 3, inner))
    spread = np.sqrt(scatter(points.height[good])), np.sqrt(scatter(points.pressure[good]))
    return Repeats(float(spread[0]), float(spread[1]), int(count.size), p_value), between


def open_constants(fit: YeohFit, points: Points, condition: float = 0.0) -> str:
    """A sentence if the data leaves the curve open, else nothing.

    ``condition`` is that of the design matrix with columns of unit length.
    """
    checked = np.linspace(1.2, 2.8, 33) * fit.balloon.rest_height
    low, high = fit.pressure_band(checked)
    width = (high - low) / 2 / fit.balloon.pressure_at_height(checked)
    if condition < CONDITION_LIMIT and width.max() < WIDTH_LIMIT:
        return ""
    worst = checked[np.argmax(width)] * 1e3
    half = (fit.interval()[:, 1] - fit.interval()[:, 0]) / 2
    rest = fit.balloon.rest_height * 1e3
    lowest, highest = points.height.min() * 1e3, points.height.max() * 1e3
    missing = []
    if lowest > 1.3 * rest:
        missing.append(f"below {1.3 * rest:.1f} mm")
    if highest < 2.1 * rest:
        missing.append(f"above {2.1 * rest:.1f} mm")
    advice = f"Measure {' and '.join(missing)} as well, off the plateau." if missing else "Measure more points."
    names = ", ".join(f"{name} by {h:.3g} Pa" for name, h in zip(("mu", "C2", "C3"), half, strict=True))
    return (
        f"the heights measured ({lowest:.1f} to {highest:.1f} mm) do not "
        f"determine all three constants: they are open {names}, and the pressure at {worst:.0f} mm by "
        f"{100 * width.max():.0f} %. {advice}"
    )
