"""One bubble's figures by least squares: pressures of a quiet line against those that the model gives for the air that is in.

Thirteen unknowns, all but the membrane's with what is known beforehand: restrictors, dead times, line, rest radius as they are
made. Air follows from readings and pulses alone (`metering`), so nothing is integrated but the rubber's memory. A mean counts by
its own noise, by what the air may be off there times the curve's slope, and by how well the model does altogether.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bubbleskin.calibrate import rubber
from bubbleskin.calibrate.data import Data
from bubbleskin.calibrate.nominal import Nominal, height_mm, sphere_mm3
from bubbleskin.calibrate.rubber import Wall

Floats = NDArray[np.float64]

NAMES = (
    "fill_flow", "vent_flow", "fill_late_ms", "vent_late_ms", "line_mm3", "radius_mm",
    "mu_h0", "c2_h0", "c3_h0", "softening", "quick", "slow", "leak",
)  # fmt: skip
UNITS = ("", "", "ms", "ms", "mm³", "mm", "Pa m", "Pa m", "Pa m", "", "", "", "µJ/(s kPa)")
(FILL, VENT, FILL_LATE, VENT_LATE, LINE, RADIUS, MU, C2, C3, SOFTENING, QUICK, SLOW, LEAK) = range(len(NAMES))
_PA_MM = 1e3  # in a Pa m

_FLOW_SHARE = 0.06  # standard deviations of what is known beforehand
_LATE_MS = 0.25
_LINE_SHARE = 0.085
_RADIUS_SHARE = 0.012
_STIFFNESS = (40.0, 0.4, 0.06)  # Pa m, within half and twice of which every silicone for this is
_USUAL_PA = 21e3  # what a bubble of that has on most of its way
_STIFFNESS_SHARE = (0.6, 1.0, 1.0)
_SOFTENING, _SOFTENING_SD = 0.08, 0.06
_MEMORY, _MEMORY_SD = 0.05, 0.03
_LEAK_SD = 50.0

_NOISE_PA = 60.0  # of one reading
_MODEL_PA = 60.0, 15.0, 400.0  # what the model is off at first; at least and at most
_AIR_UJ, _AIR_SHARE = 100.0, 0.0003  # what metered air is off
_CORRELATED = 2.0  # neighbouring means are off alike
MEANS_LEAST = 20


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a fit has found of one bubble."""

    values: Floats
    """By `NAMES`."""
    covariance: Floats
    height_mm: Floats
    """Of each mean that was fitted."""
    pressure_pa: Floats
    model_pa: Floats
    rms_pa: float
    chi: float
    """RMS of what the model is off, by what it usually is: 60 Pa, and what metered air is off where the curve is steep."""
    largest_mm: float
    """As high as it has been."""
    lift: float
    """Pa per µJ/ms, what a line's pressure rises by while air flows in."""

    @property
    def sd(self) -> Floats:
        """Standard deviations, by `NAMES`."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    @property
    def wall(self) -> Wall:
        """Its wall."""
        return wall_of(self.values)

    def curve(self, heights_mm: Floats) -> Floats:
        """Pressure at heights, Pa: relaxed, of rubber that has been stretched as it was."""
        return rubber.relaxed(heights_mm, self.largest_mm, self.wall)


def wall_of(values: Floats) -> Wall:
    """The wall among all values."""
    mu, c2, c3 = (float(values[k]) * _PA_MM for k in (MU, C2, C3))
    return Wall(mu, c2, c3, float(values[RADIUS]), float(values[SOFTENING]), float(values[QUICK]), float(values[SLOW]))


def air(values: Floats, data: Data) -> Floats:
    """µJ in bubble and line at each tick."""
    moved = values[FILL] * (data.fill.air - values[FILL_LATE] * data.fill.late)
    moved = moved - values[VENT] * (data.vent.air - values[VENT_LATE] * data.vent.late)
    moved = data.since(moved - values[LEAK] * data.kpa_seconds)
    empty = 1e-3 * data.atmosphere * (values[LINE] + sphere_mm3(2.0 * values[RADIUS]))
    return np.asarray(empty + moved)


def heights(values: Floats, data: Data) -> Floats:
    """mm at each tick: the sphere of what the gas law leaves beside the line."""
    volume = air(values, data) / (1e-3 * (data.atmosphere + data.pressure)) - values[LINE]
    return height_mm(np.maximum(volume, 0.3 * sphere_mm3(2.0 * values[RADIUS])))


def model(values: Floats, data: Data) -> tuple[Floats, Floats]:
    """Pressures and heights of each mean."""
    height = heights(values, data)
    stretch = height / (2.0 * values[RADIUS])
    return data.mean(rubber.history(stretch, data.tick_s, wall_of(values))), data.mean(height)


def beforehand(nominal: Nominal) -> tuple[Floats, Floats]:
    """What is known before anything is measured: values and standard deviations, by `NAMES`."""
    radius = 0.5 * nominal.rest_mm
    values = (1.0, 1.0, 0.0, 0.0, nominal.line_mm3, radius, *_STIFFNESS, _SOFTENING, _MEMORY, _MEMORY, 0.0)
    stiffness = [value * share for value, share in zip(_STIFFNESS, _STIFFNESS_SHARE, strict=True)]
    sds = (
        *(_FLOW_SHARE, _FLOW_SHARE, _LATE_MS, _LATE_MS, _LINE_SHARE * nominal.line_mm3, _RADIUS_SHARE * radius),
        *(*stiffness, _SOFTENING_SD, _MEMORY_SD, _MEMORY_SD, _LEAK_SD),
    )
    return np.array(values), np.array(sds)


_NOT_BELOW_ZERO = (MU, C2, C3, SOFTENING, QUICK, SLOW)


def fit(
    data: Data, nominal: Nominal, flow: tuple[float, float] | None = None, start: Estimate | None = None
) -> Estimate:
    """Fit all unknowns. `flow`: what others tell of the fill valve's flow factor, and its standard deviation. `start`: a fit
    without that.

    There must be `MEANS_LEAST` means.
    """
    prior, prior_sd = beforehand(nominal)
    measured = data.mean(data.pressure)
    for k in (MU, C2, C3):
        prior[k] *= float(np.median(measured)) / _USUAL_PA
    if flow is not None:
        prior[FILL], prior_sd[FILL] = _together((prior[FILL], prior_sd[FILL]), flow)
    low = np.full(len(prior), -np.inf)
    low[list(_NOT_BELOW_ZERO)] = 0.0
    values = start.values.copy() if start else prior.copy()
    off = _off(start.pressure_pa - start.model_pa) if start else _MODEL_PA[0]
    for _ in range(1 if start else 3):
        sd = _deviations(values, data, off)

        def residuals(now: Floats, sd: Floats = sd) -> Floats:
            return np.concatenate([_robust((measured - model(now, data)[0]) / sd), (now - prior) / prior_sd])

        first = np.maximum(values, low + 1e-6 * prior_sd)
        solved = least_squares(residuals, first, bounds=(low, np.inf), x_scale=prior_sd, xtol=1e-6, ftol=1e-6)
        values = solved.x
        expected, height = model(values, data)
        off = _off(measured - expected)
    slopes = np.asarray(solved.jac)
    covariance = np.linalg.pinv(slopes.T @ slopes)
    return Estimate(
        values=values,
        covariance=covariance,
        height_mm=height,
        pressure_pa=measured,
        model_pa=expected,
        rms_pa=float(np.sqrt(np.mean((measured - expected) ** 2))),
        chi=float(np.sqrt(np.mean(((measured - expected) / _deviations(values, data, _MODEL_PA[0])) ** 2))),
        largest_mm=float(heights(values, data).max()),
        lift=data.lift,
    )


def _off(left: Floats) -> float:
    """What the model is off by, Pa, from what it leaves: half of all is less than 0.67 standard deviations."""
    return float(np.clip(_CORRELATED * 1.48 * float(np.median(np.abs(left))), *_MODEL_PA[1:]))


def _together(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Two independent values of one figure, each with its standard deviation, as one."""
    weights = one[1] ** -2.0, other[1] ** -2.0
    mean = (weights[0] * one[0] + weights[1] * other[0]) / sum(weights)
    return mean, sum(weights) ** -0.5


def _deviations(values: Floats, data: Data, off: float) -> Floats:
    """Of each mean's pressure, Pa."""
    wall = wall_of(values)
    height = model(values, data)[1]
    step = 0.02
    slope = (rubber.relaxed(height + step, 0.0, wall) - rubber.relaxed(height - step, 0.0, wall)) / (2.0 * step)
    moved = data.mean(data.since(data.fill.air) + data.since(data.vent.air))
    volume = (_AIR_UJ + _AIR_SHARE * moved) / (1e-3 * (data.atmosphere + data.mean(data.pressure)))
    by_air = slope * volume / (0.5 * np.pi * height**2)
    return np.asarray(np.sqrt(off**2 + _NOISE_PA**2 / data.count + by_air**2))


def _robust(shares: Floats) -> Floats:
    """Residuals of which few are far off: beyond one standard deviation they count by their size, not its square."""
    return np.asarray(np.sign(shares) * np.sqrt(2.0 * (np.sqrt(1.0 + shares * shares) - 1.0)))
