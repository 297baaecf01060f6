"""Whether what was found of a bubble can be used, and if not, what is wrong: each a name and a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bubbleskin.calibrate.fit import FILL, LEAK, RADIUS, VENT, Estimate
from bubbleskin.calibrate.nominal import Nominal
from bubbleskin.calibrate.trace import SOME_PA, Trace

Floats = NDArray[np.float64]

ACCEPTED, REDO, OUT_OF_FAMILY = "accepted", "redo", "out of family"

CHI_MOST = 4.0
LEAK_UNIT = 53.0
"""µJ/(s kPa) with which a bubble of 12 mm loses 1 % of its air in a second."""
LEAK_MOST = 0.005
"""Of its air a second, of a bubble at 12 mm: what silicone lets through is a twentieth of that."""
LEAK_SURE = 4.0
LIFT_USUAL, LIFT_MOST = 7.0, 14.0
LIFT_TIMES = 1.6
"""Pa per µJ/ms, of a whole tube and usual rubber, and the most, where it is so much more than the middle one's: viscous rubber
holds back as a tube does, but all of a sheet. Half the bore makes sixteen times the resistance.
"""
FLOW_MOST = 1.25
STIFFNESS_MOST = 1.35
"""Of the middle one's of its sheet: walls and rubber of one sheet differ by a fifth."""
COMPARED_MM = 9.0
ENOUGH = 3
"""Bubbles, where one is compared with most others."""
RADIUS_MOST = 0.04
HEIGHT_LEAST_MM = 11.0
ZERO_MOST_PA = 1500.0


@dataclass(frozen=True)
class Verdict:
    """What becomes of one bubble's figures."""

    verdict: str
    """`accepted`, `redo` or `out of family`."""
    reasons: tuple[str, ...] = ()
    """Names: lost telemetry, faulted, too little data, bad fit, leaking, kinked tube, restrictor, wrong bubble, sensor zero,
    swapped."""
    advice: str = ""
    """A sentence or more."""

    @property
    def accepted(self) -> bool:
        """Whether its figures are used."""
        return self.verdict == ACCEPTED


_BY_FAULT = {
    "leak": (
        "leaking",
        "It reported a leak on its way. Clear it and repeat; if it does so again, look at barb, tube and rubber.",
    ),
    "overpressure": (
        "kinked tube",
        "Its pressure went beyond the limit while it filled: its tube is kinked or blocked, or it is much stiffer. Mend "
        "it, clear the fault and repeat.",
    ),
}
_OTHER_RUBBER = Verdict(
    REDO,
    ("other rubber",),
    "It reported {}, as most others did: the sheet is of another rubber than the tables. Upload tables that are nearer, such as "
    "`bubbleskin table --preset ecoflex-00-30 --upload`, and repeat.",
)


def of_other_rubber(bubble: int, trace: Trace, faulted: int, all_of_them: int) -> Verdict | None:
    """The verdict on a bubble that faulted as more than half of `all_of_them` did: tables far from the rubber, not bubbles, are
    what that comes from.
    """
    faults = trace.faults.get(bubble)
    if not faults or all_of_them < ENOUGH or 2 * faulted <= all_of_them:
        return None
    return replace(_OTHER_RUBBER, advice=_OTHER_RUBBER.advice.format(", ".join(faults)))


def judge(
    bubble: int,
    trace: Trace,
    lifts: Mapping[int, float],
    zero_pa: float,
    estimates: Mapping[int, Estimate],
    nominal: Nominal,
) -> Verdict:
    """The verdict on one bubble among those that were fitted; `lifts` are those of all lines."""
    redo = _not_measured(bubble, trace, estimates.get(bubble))
    odd: list[tuple[str, str]] = []
    if abs(zero_pa) > ZERO_MOST_PA:
        odd.append(("sensor zero", f"Its sensor says {zero_pa / 1e3:.2f} kPa without pressure: replace it."))
    usual = float(np.median(list(lifts.values()))) if len(lifts) >= ENOUGH else LIFT_USUAL
    times = lifts[bubble] / usual
    if lifts[bubble] > LIFT_MOST and times > LIFT_TIMES:
        said = f"Its tube holds back {times:.1f} times as much as usual: straighten it, or look for dirt."
        odd.append(("kinked tube", said))
    if (estimate := estimates.get(bubble)) is not None:
        odd += _odd(bubble, estimate, estimates, nominal)
    for other, pressure in trace.others_pa.items():
        if not _rose(bubble, trace):
            said = f"The sensor of bubble {other} rose to {pressure / 1e3:.1f} kPa while it was filled and its own did not: "
            odd.append(("swapped", said + "see which tube is whose."))
    if odd:
        return Verdict(OUT_OF_FAMILY, tuple(name for name, _ in odd), " ".join(said for _, said in odd))
    if redo:
        return Verdict(REDO, tuple(name for name, _ in redo), " ".join(said for _, said in redo))
    return Verdict(ACCEPTED)


def _rose(bubble: int, trace: Trace) -> bool:
    return float(np.percentile(trace.pressure_pa[:, trace.column(bubble)], 90)) > SOME_PA


def leak_share(estimate: Estimate) -> float:
    """Of its air, what a bubble at 12 mm loses in a second."""
    return 0.01 * float(estimate.values[LEAK]) / LEAK_UNIT


def _not_measured(bubble: int, trace: Trace, estimate: Estimate | None) -> list[tuple[str, str]]:
    faults = trace.faults.get(bubble, ())
    found = [_BY_FAULT[fault] for fault in faults if fault in _BY_FAULT]
    if faults and not found:
        said = f"It reported {', '.join(faults)} on its way: see `fault_log()`, clear it and repeat."
        found.append(("faulted", said))
    if trace.lost:
        found.append(("lost telemetry", f"{trace.lost} readings have not come: look at the link's cable and repeat."))
    if estimate is None and not faults:
        found.append(("too little data", "Its line was quiet too seldom to measure: look whether it rises at all."))
    elif estimate and estimate.largest_mm < HEIGHT_LEAST_MM:
        found.append(
            ("too little data", f"It rose to {estimate.largest_mm:.1f} mm only: see the supply in `health()`.")
        )
    elif estimate and estimate.chi > CHI_MOST:
        found.append(
            ("bad fit", f"Its pressures are {estimate.rms_pa:.0f} Pa off every rubber: leave it alone and repeat.")
        )
    return found


def _odd(bubble: int, estimate: Estimate, estimates: Mapping[int, Estimate], nominal: Nominal) -> list[tuple[str, str]]:
    found = []
    v, sd = estimate.values, estimate.sd
    leak = leak_share(estimate)
    if leak > LEAK_MOST and v[LEAK] > LEAK_SURE * sd[LEAK]:
        found.append(
            ("leaking", f"At 12 mm it loses {100 * leak:.1f} % of its air a second: look at barb, tube and rubber.")
        )
    for name, at in (("fill", FILL), ("vent", VENT)):
        if not 1.0 / FLOW_MOST < v[at] < FLOW_MOST:
            found.append(
                ("restrictor", f"Its {name} valve lets {v[at]:.2f} times the usual through: look for dirt in it.")
            )
    held = {key: float(one.curve(np.array([COMPARED_MM]))[0]) for key, one in estimates.items()}
    share = held[bubble] / float(np.median(list(held.values())))
    if not 1.0 / STIFFNESS_MOST < share < STIFFNESS_MOST:
        found.append(
            ("wrong bubble", f"It is {share:.2f} times as stiff as the middle one of its sheet: look which it is.")
        )
    if abs(v[RADIUS] / (0.5 * nominal.rest_mm) - 1.0) > RADIUS_MOST:
        found.append(
            (
                "wrong bubble",
                f"At rest it is {2 * v[RADIUS]:.2f} mm high and not {nominal.rest_mm:g}: look which it is.",
            )
        )
    return found
