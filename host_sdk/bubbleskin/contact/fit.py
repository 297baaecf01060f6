"""Springs from measured shapes: what necks and contact must be like for the heights and pressures that were found."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from os import PathLike

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from bubbleskin.checks import number, positive
from bubbleskin.contact.measured import Checked, Measured, checked, read_shapes
from bubbleskin.contact.model import KBASE, KC, KXY, KZ, CompliantContact
from bubbleskin.contact.shape import Shape
from bubbleskin.errors import InvalidInput
from bubbleskin.files import write_text
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon

Array = NDArray[np.float64]

SPRINGS = ("kz", "kxy", "kc")
_PRIOR = np.log(10.0)
"""The preset counts as known to a factor of ten: what the measurements leave open stays near it."""
_WALL_SHARE = 0.1
"""Standard deviation of a bubble's pressure alone, of what its balloon says: a factor for each is found beside the springs."""
_STARTS = (0.5, 1.0, 2.0)
_STEP = 2e-3
_GOOD = 3.0  # standard deviations: a fit that leaves less has found the branches
_TELLS = 2.0  # standard deviations by which twice a spring must change something to be found by itself
_OPEN = 2.0
"""A spring that is not known to this factor is open: next to nothing is known of it."""
_LEAST_DOUBT, _MOST_DOUBT = np.log(1.02), np.log(2.0)
"""Logarithms. Spheres, linear springs, one set for all bubbles: no sheet is known better than the first. What is open is
drawn up to the other."""


@dataclass(frozen=True, eq=False)
class ContactFit:
    """Springs in N/m with what is known of them."""

    kz: float
    kxy: float
    kc: float
    covariance: Array
    """Of the logarithms of `kz`, `kxy`, `kc`, (3, 3)."""
    residual_mm: Array
    """Model less measurement, one entry per height."""
    residual_pa: Array
    """The same of pressures; what a bubble's wall explains is taken out."""
    change: Array
    """By how many standard deviations twice the spring would change the measurement that tells most of it, (3,)."""
    contact: CompliantContact
    """The model with these springs, and `doubt` as they are known."""

    @property
    def factor(self) -> Array:
        """By which `kz`, `kxy`, `kc` may be off, one standard deviation, (3,): 1.1 is 10 %, 10 is not known at all."""
        return np.exp(np.sqrt(np.diag(self.covariance)))

    @property
    def ratio_factor(self) -> dict[str, float]:
        """The same of `kz` and `kc` in parts of `kxy`: all that heights tell where sizes were held."""
        C = self.covariance
        return {f"{SPRINGS[k]}/kxy": float(np.exp(np.sqrt(C[k, k] + C[1, 1] - 2 * C[k, 1]))) for k in (0, 2)}

    @property
    def open(self) -> tuple[str, ...]:
        """The springs that the measurements say next to nothing of (not known to a factor of 2)."""
        return tuple(name for name, off in zip(SPRINGS, self.factor, strict=True) if off > _OPEN)

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """Between which each spring is with 95 %, N/m."""
        return {name: (k / f**1.96, k * f**1.96) for name, k, f in zip(SPRINGS, self._values, self.factor, strict=True)}

    @property
    def _values(self) -> tuple[float, float, float]:
        return self.kz, self.kxy, self.kc

    def report(self) -> str:
        """The springs with intervals, what is left, and of each that is open why, in lines."""
        meaning = ("a neck, upwards", "a neck, sideways", "the contact of two bubbles")
        lines = []
        for name, what, value, changed in zip(SPRINGS, meaning, self._values, self.change, strict=True):
            low, high = self.interval[name]
            if name in self.open:
                lines.append(_why_open(name, what, changed, self))
            else:
                lines.append(f"{name}, {what}: {value:.4g} N/m, with 95 % between {low:.4g} and {high:.4g}.")
        ratios = {name: off for name, off in self.ratio_factor.items() if off <= _OPEN}
        if self.open and ratios:
            lines.append(
                "Heights of held sizes tell ratios of springs, and heights follow from these: "
                + ", ".join(f"{name} to {100 * (off - 1):.0f} %" for name, off in ratios.items())
                + ". Pressures tell the rest."
            )
        if self.residual_mm.size:
            lines.append(f"{_left(self.residual_mm)} mm of {self.residual_mm.size} heights are left.")
        if self.residual_pa.size:
            lines.append(f"{_left(self.residual_pa)} Pa of {self.residual_pa.size} pressures are left.")
        return "\n".join(lines)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the springs to a JSON file that `CompliantContact.from_file` and `bubbleskin plan --contact` read."""
        write_text(path, json.dumps(self.as_dict(), indent=2) + "\n", "the file of springs")

    def as_dict(self) -> dict[str, object]:
        """For JSON: springs in N/m with intervals, and what is left."""
        return {
            **{name: float(value) for name, value in zip(SPRINGS, self._values, strict=True)},
            "kbase": self.contact.kbase,
            "doubt": self.contact.doubt.round(4).tolist(),
            "interval": {name: list(ends) for name, ends in self.interval.items()},
            "ratio_factor": self.ratio_factor,
            "open": list(self.open),
            "residual_mm": self.residual_mm.round(4).tolist(),
            "residual_pa": self.residual_pa.round(1).tolist(),
        }


def _why_open(name: str, what: str, changed: float, fit: ContactFit) -> str:
    known = f"{name}, {what}, is open, known to a factor of {fit.factor[SPRINGS.index(name)]:.1f} only: "
    if changed < _TELLS:
        return f"{known}twice that spring changes no measurement by more than {changed:.1f} standard deviations. {_ADVICE[name]}"
    return f"{known}what it changes, up to {changed:.0f} standard deviations, other springs change alike."


_ADVICE = {
    "kz": "Measure the top of a bubble that others lift, such as one of 12 mm after which its neighbours go to 12 mm.",
    "kxy": "Measure two bubbles of 12 mm that push each other aside, or one that others lift.",
    "kc": "Measure bubbles that press each other hard, from several sides, and their pressures.",
}


def _left(residual: Array) -> str:
    return f"{np.sqrt((residual**2).mean()):.3g}"


def fit_contact(
    measurements: Iterable[Measured] | str | PathLike[str],
    layout: Layout,
    balloon: YeohBalloon | Sequence[YeohBalloon] | None = None,
    *,
    sd_mm: float = 0.05,
    sd_pa: float = 50.0,
    kbase: float = KBASE,
    seed: int = 0,
) -> ContactFit:
    """Find `kz`, `kxy` and `kc` with which the model has what was measured, by least squares of their logarithms.

    `measurements` are shapes, or the file of a table of them (`docs/contact.md`). Heights of bubbles that touch nobody say
    nothing of springs; at least one shape should have a bubble lifted, and one a bubble squeezed. Where sizes were held,
    pressures count too: neighbours that press raise them. What a bubble's wall adds to its pressure is `balloon`'s, times
    a factor for each bubble that is found beside the springs. `sd_mm` and `sd_pa` are the measurements' standard
    deviations; intervals are wider where more than that is left. Several starts, since which branch a path ends on jumps
    with the springs.

    Raises `InvalidInput` for measurements that do not fit the layout, and for such as tell nothing of any spring.
    """
    positive("sd_mm", number("sd_mm", sd_mm), "mm")
    positive("sd_pa", number("sd_pa", sd_pa), "Pa")
    if isinstance(measurements, str | PathLike):
        measurements = read_shapes(measurements, layout)
    shapes = [checked(one, layout) for one in measurements]
    if not shapes:
        raise InvalidInput("No measurements: give at least one shape, with what was held on the way to it.")
    start = CompliantContact(layout, balloon, kbase=kbase, seed=seed)
    return _Fit(start, shapes, sd_mm, sd_pa).found()


class _Fit:
    """One fit: `x` are the logarithms of the springs, (3,)."""

    def __init__(self, start: CompliantContact, shapes: list[Checked], sd_mm: float, sd_pa: float) -> None:
        self._start, self._shapes, self._sd_mm, self._sd_pa = start, shapes, sd_mm, sd_pa
        self._middle = np.log([KZ, KXY, KC])

    def found(self) -> ContactFit:
        """The best of the starts, with its intervals."""
        tries = [self._from(self._middle)]
        if float(np.abs(tries[0].fun).max()) > _GOOD:  # another branch somewhere: the best of some other starts
            starts = [self._middle + np.log(factors) for factors in product(_STARTS, repeat=3)]
            tries += [self._from(x) for x in sorted(starts, key=lambda x: float((self._residuals(x) ** 2).sum()))[:2]]
        best = min(tries, key=lambda one: float(one.cost))
        told = self._slope(best.x)[:-3]
        self._refuse_nothing(told)
        count = len(told)
        chi2 = float((np.asarray(best.fun)[:-3] ** 2).sum()) / max(count - 3, 1)
        # More left than the measurements' deviation: the model is not that good, and the intervals say so.
        covariance = np.linalg.inv(told.T @ told / max(chi2, 1.0) + np.eye(3) / _PRIOR**2)
        contact = self._model(best.x)
        # Twice the standard deviation along each axis of the covariance: ratios can be known better than springs.
        variance, axes = np.linalg.eigh(covariance)
        doubt = (axes * np.clip(2 * np.sqrt(variance), _LEAST_DOUBT, _MOST_DOUBT)).T
        mm, pa = self._off(best.x)
        return ContactFit(
            contact.kz,
            contact.kxy,
            contact.kc,
            covariance,
            mm,
            pa,
            np.log(2.0) * np.abs(told).max(axis=0),
            contact.with_doubt(doubt),
        )

    def _slope(self, x: Array) -> Array:
        """∂residuals/∂x, (m, 3): of the differences to either side the smaller, since the other can be across a jump."""
        here = self._residuals(x)
        columns = []
        for one in _STEP * np.eye(3):
            more, less = (self._residuals(x + one) - here) / _STEP, (here - self._residuals(x - one)) / _STEP
            columns.append(np.where(np.abs(more) < np.abs(less), more, less))
        return np.array(columns).T

    def _refuse_nothing(self, told: Array) -> None:
        """Raise where twice any spring would change no measurement by half a standard deviation."""
        if np.log(2.0) * np.abs(told).max(initial=0.0) >= 0.5:
            return
        touching = sum(len(shape.contacts) for shape in self._settled(self._middle))
        why = (
            "no two bubbles touch in any of them"
            if not touching
            else "what touches changes them by less than their noise"
        )
        raise InvalidInput(
            f"These {len(self._shapes)} shapes say nothing of necks and contact: {why}. Measure one in which bubbles press "
            "each other, such as a bubble of 12 mm after which all others go to 12 mm. Pressures count only beside those of "
            "the same bubbles alone, such as all at 9 mm."
        )

    def _from(self, x: Array) -> OptimizeResult:
        wide = (self._middle - np.log(100), self._middle + np.log(100))
        return least_squares(self._residuals, x, bounds=wide, diff_step=np.full(3, _STEP), xtol=1e-6)

    def _model(self, x: Array) -> CompliantContact:
        return self._start.with_springs(np.exp(x - self._middle), self._start.kick, self._start.seed)

    def _settled(self, x: Array) -> list[Shape]:
        model = self._model(x)
        return [one.settled(model) for one in self._shapes]

    def _residuals(self, x: Array) -> Array:
        mm, pa = self._off(x)
        return np.concatenate([mm / self._sd_mm, pa / self._sd_pa, (x - self._middle) / _PRIOR])

    def _off(self, x: Array) -> tuple[Array, Array]:
        """Model less measurement: of heights in mm, and of pressures in Pa with each bubble's wall as fits best."""
        settled = self._settled(x)
        mm = np.concatenate([shape.height_mm - one.height_mm for shape, one in zip(settled, self._shapes, strict=True)])
        told = np.array([one.pressure_pa for one in self._shapes])
        alone = np.array([self._start.free_pressure(shape.size_mm) for shape in settled])
        pressed = np.array([shape.pressure for shape in settled]) - alone
        known = ~np.isnan(told)
        wall, rest = np.where(known, alone, 0.0), np.where(known, told - pressed, 0.0)
        # The factor of each bubble's wall, least squares about 1: linear, so found at once for given springs.
        about = (self._sd_pa / _WALL_SHARE) ** 2
        factor = ((wall * rest).sum(axis=0) + about) / ((wall**2).sum(axis=0) + about)
        pa = (wall * factor - rest)[known]
        return mm[~np.isnan(mm)], pa
