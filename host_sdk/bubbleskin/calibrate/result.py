"""A calibration: what was measured, what was found of each bubble, whether it is used, and how it goes into a file."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin import checks, files
from bubbleskin.calibrate import archive, device, verdict
from bubbleskin.calibrate.fit import NAMES, UNITS, Estimate
from bubbleskin.calibrate.measure import Measured
from bubbleskin.calibrate.nominal import Nominal
from bubbleskin.calibrate.sheet import Sizes, sized
from bubbleskin.calibrate.sheet import estimate as estimate_sheet
from bubbleskin.calibrate.verdict import Verdict
from bubbleskin.errors import InvalidInput
from bubbleskin.pictured import Pictured

Floats = NDArray[np.float64]

_SIZE_MOST = 1.15
"""Of measured heights to those told."""


@dataclass(frozen=True, eq=False)
class BubbleCalibration:
    """One bubble's."""

    bubble: int
    verdict: Verdict
    estimate: Estimate | None
    """None where there was too little to fit."""
    figures: device.Figures | None
    """What the wristband takes; None where it is not used."""

    @property
    def chi(self) -> float:
        """How far its pressures are from a rubber's, by what is usual; NaN where nothing was fitted."""
        return self.estimate.chi if self.estimate else float("nan")

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Each figure that was fitted, and its standard deviation; units stand in `bubbleskin.calibrate.fit.UNITS`."""
        if self.estimate is None:
            return {}
        sds = self.estimate.sd
        return {name: (float(v), float(sd)) for name, v, sd in zip(NAMES, self.estimate.values, sds, strict=True)}

    def interval(self, name: str) -> tuple[float, float]:
        """Within which a figure is with 95 %."""
        value, sd = self.parameters[name]
        return value - 1.96 * sd, value + 1.96 * sd

    def __repr__(self) -> str:
        why = f": {', '.join(self.verdict.reasons)}" if self.verdict.reasons else ""
        return f"<BubbleCalibration {self.bubble}, {self.verdict.verdict}{why}, χ {self.chi:.2f}>"


@dataclass(frozen=True, eq=False)
class SelfCalibration(Pictured):
    """What `calibrate` returns. `SelfCalibration.load(path)` fits the file's raw data again, with what this version knows."""

    board: str
    nominal: Nominal
    """What its bubbles were taken for."""
    atmosphere_kpa: float
    zero_counts: tuple[int, ...]
    """Of each sensor, as the wristband had them while it measured; (n,)."""
    measured: Measured
    bubbles: tuple[BubbleCalibration, ...]
    sizes: Mapping[int, tuple[float, float]]
    """What measured heights have told, see `refined`: by bubble a factor of heights and its standard deviation."""

    @classmethod
    def of(
        cls,
        board: str,
        nominal: Nominal,
        measured: Measured,
        atmosphere_kpa: float,
        zero_counts: tuple[int, ...],
        sizes: Sizes | None = None,
    ) -> Self:
        """Fit everything."""
        atmosphere = 1e3 * atmosphere_kpa
        estimates, data = estimate_sheet(measured.traces, measured.zero_pa, atmosphere, nominal)
        estimates = sized(estimates, data, nominal, sizes or {})
        lifts = {bubble: one.lift for bubble, one in data.items()}
        found = []
        faulted = sum(len(trace.faults) for trace in measured.traces)
        for trace in measured.traces:
            for bubble in trace.bubbles:
                zero = float(measured.zero_pa[bubble])
                said = verdict.of_other_rubber(bubble, trace, faulted, len(data))
                said = said or verdict.judge(bubble, trace, lifts, zero, estimates, nominal)
                one = estimates.get(bubble)
                used = (
                    device.figures(one, zero, zero_counts[bubble], nominal, atmosphere)
                    if one and said.accepted
                    else None
                )
                found.append(BubbleCalibration(bubble, said, one, used))
        found.sort(key=lambda each: each.bubble)
        return cls(board, nominal, atmosphere_kpa, zero_counts, measured, tuple(found), dict(sizes or {}))

    def __repr__(self) -> str:
        return f"<SelfCalibration of a {self.board}: {len(self.accepted)} of {len(self.bubbles)} bubbles accepted>"

    def __getitem__(self, bubble: int) -> BubbleCalibration:
        for each in self.bubbles:
            if each.bubble == bubble:
                return each
        raise KeyError(f"bubble {bubble} was not measured; {', '.join(str(each.bubble) for each in self.bubbles)} were")

    @property
    def accepted(self) -> tuple[int, ...]:
        """Bubbles whose figures are used."""
        return tuple(each.bubble for each in self.bubbles if each.verdict.accepted)

    @property
    def device_s(self) -> float:
        """How long the wristband was at it."""
        return self.measured.device_s

    def only(self, bubbles: Iterable[int]) -> Self:
        """The part of it that is of these bubbles: `upload_calibration` then leaves all others as they are."""
        return replace(self, bubbles=tuple(self[bubble] for bubble in sorted(set(bubbles))))

    def refined(self, heights_mm: Mapping[int, Sequence[tuple[float, float]]], sd_mm: float = 0.05) -> Self:
        """With what measured heights tell of sizes, which no sensor of the board does: the same, fitted again.

        `heights_mm`: by bubble, pairs of the height that the wristband told (`state().height_mm`) while it used this
        calibration and of the height that was measured, by camera or calliper; heights from 8 mm on tell most. `sd_mm`: of one
        measured height.
        """
        sd = checks.above_zero("sd_mm", sd_mm, 1.0, "mm")
        known = {each.bubble for each in self.bubbles}
        sizes = dict(self.sizes)
        for bubble, pairs in heights_mm.items():
            if bubble not in known:
                raise InvalidInput(f"Bubble {bubble} was not calibrated; {', '.join(map(str, sorted(known)))} were.")
            told = checks.finite("heights_mm", list(pairs))
            if told.ndim != 2 or told.shape[1] != 2 or told.size == 0 or told.min() <= 0:
                raise InvalidInput(
                    f"heights_mm of bubble {bubble} must be pairs of a height told and one measured, in mm."
                )
            weights = told[:, 0] ** 2
            factor = float(np.average(told[:, 1] / told[:, 0], weights=weights))
            if not 1.0 / _SIZE_MOST < factor < _SIZE_MOST:
                raise InvalidInput(
                    f"Bubble {bubble} was measured {factor:.2f} times as high as it told; at most {_SIZE_MOST:g} is a size. "
                    "Look whether heights are those of this bubble, in mm above the base plane."
                )
            before = sizes.get(bubble, (1.0, 0.0))[0]
            sizes[bubble] = before * factor, float(sd / np.sqrt(weights.sum()))
        facts = self.board, self.nominal, self.measured, self.atmosphere_kpa, self.zero_counts
        return type(self).of(*facts, sizes)

    def report(self) -> str:
        """A line for each bubble, and what to do where there is something."""
        lines = [f"{self.board}: {len(self.accepted)} of {len(self.bubbles)} bubbles accepted, {self.device_s:.1f} s"]
        for each in self.bubbles:
            lines.append(f"  bubble {each.bubble}: {each.verdict.verdict}{_found(each)}")
            if each.verdict.advice:
                lines.append(f"    {', '.join(each.verdict.reasons)}: {each.verdict.advice}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """What was found as plain numbers, for JSON."""
        return {
            "board": self.board,
            "device_s": self.device_s,
            "bubbles": [
                {
                    "bubble": each.bubble,
                    "verdict": each.verdict.verdict,
                    "reasons": list(each.verdict.reasons),
                    "advice": each.verdict.advice,
                    "chi": each.chi if each.estimate else None,
                    "parameters": {
                        name: {"value": value, "sd": sd, "unit": unit}
                        for (name, (value, sd)), unit in zip(each.parameters.items(), UNITS, strict=False)
                    },
                }
                for each in self.bubbles
            ],
        }

    def save(self, path: str | Path) -> None:
        """Write the raw data, and what was found for people to read, to the file `path`."""
        facts = self.board, self.nominal, self.atmosphere_kpa, self.zero_counts, self.measured, self.sizes
        files.write_text(path, archive.text(*facts, self.as_dict()["bubbles"]), "the calibration")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote, and fit it; `InvalidInput` says what is wrong with a file."""
        read = archive.read(path)
        return cls.of(read.board, read.nominal, read.measured, read.atmosphere_kpa, read.zero_counts, read.sizes)


def _found(each: BubbleCalibration) -> str:
    if each.estimate is None:
        return ""
    p: Mapping[str, tuple[float, float]] = each.parameters
    leak = 100 * verdict.leak_share(each.estimate)
    return (
        f", χ {each.chi:.2f}; flows {p['fill_flow'][0]:.3f} and {p['vent_flow'][0]:.3f} ± {p['fill_flow'][1]:.3f}, line "
        f"{p['line_mm3'][0]:.0f} mm³, μh0 {p['mu_h0'][0]:.1f} ± {p['mu_h0'][1]:.1f} Pa m, memory "
        f"{100 * (p['quick'][0] + p['slow'][0]):.0f} %, softening {100 * p['softening'][0]:.0f} %, leak {leak:.2f} %/s"
    )
