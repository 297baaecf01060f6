"""What the shows of one contender on one kind of plant come to."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin.bench.control.runs import STEP, Outcome
from bubbleskin.bench.control.shows import CYCLE_PULSES, SOON_S, TIMES_S, Show

WRONG_MM = 0.5
"""A bubble that says settled and is further off tells a wrong height."""
_CYCLE_S = 5.0  # a shorter show does not tell a limit cycle from the end of the way


@dataclass(frozen=True)
class Figures:
    """Lengths in mm. Of errors at a time, those of bubbles that were emptied on their way are left out: they come later.

    None where nothing was seen, or where a contender does not say it.
    """

    use: str
    plant: str
    contender: str
    shows: int
    """Shapes, each of all bubbles of a board."""
    rms_mm: tuple[float | None, ...]
    """At each of `TIMES_S`, true heights against those asked."""
    max_mm: tuple[float | None, ...]
    last_rms_mm: float
    """At the last moment looked at, of the last tenth of the shows."""
    pulses: float
    """Shorter than a tick, per bubble and second at rest."""
    within: float | None
    """Share of what is told that is within two told standard deviations of the truth."""
    settled: float
    """Share of bubbles that say settled, at all moments."""
    settled_wrong: float | None
    """Share of those that are more than `WRONG_MM` off."""
    vent_locks: int
    faults: int
    limit_cycles: int
    emptied: int
    """Bubbles emptied on their way, to know their heights afresh."""
    fill_ratio: float | None
    """Longest time from rest until within `NEAR_MM`, by that of the fastest fill; infinite where one never was."""
    overshoot_mm: float | None
    """The most, of those."""

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> Self:
        """Of outcomes that differ in their seeds only."""
        job = outcomes[0].job
        shows = [show for outcome in outcomes for show in outcome.shows]
        errors = [_errors_at(shows, k) for k in range(len(TIMES_S))]
        late = [show for outcome in outcomes for show in outcome.shows[-max(1, len(outcome.shows) // 10) :]]
        last = np.concatenate([(show.true[-1] - show.target)[~show.emptied] for show in late])
        said = np.concatenate([show.settled.ravel() for show in shows])
        wrong = np.concatenate([(np.abs(show.true - show.target) > WRONG_MM).ravel() for show in shows])
        return cls(
            use=job.use,
            plant=job.kind.name,
            contender=job.contender,
            shows=len(shows),
            rms_mm=tuple(_rms(one) for one in errors),
            max_mm=tuple(float(np.abs(one).max()) if len(one) else None for one in errors),
            last_rms_mm=_rms(last) or 0.0,
            pulses=_pulses(shows),
            within=_within(shows),
            settled=float(said.mean()),
            settled_wrong=float(wrong[said].mean()) if said.any() else None,
            vent_locks=_count(show.locked & ~show.faulty for show in shows),
            faults=_count(show.faulty for show in shows),
            limit_cycles=_count(_cycling(show) for show in shows),
            emptied=_count(show.emptied for show in shows),
            fill_ratio=_fill_ratio(outcomes) if job.use == STEP else None,
            overshoot_mm=max(float(show.overshoot_mm.max()) for show in shows) if job.use == STEP else None,
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def _errors_at(shows: Iterable[Show], moment: int) -> NDArray[np.float64]:
    """True heights less those asked, of all shows that have lasted so long."""
    lasted = [show for show in shows if show.seconds >= TIMES_S[moment]]
    return np.concatenate([np.zeros(0)] + [(show.true[moment] - show.target)[~show.emptied] for show in lasted])


def _rms(errors: NDArray[np.float64]) -> float | None:
    return float(np.sqrt(np.mean(errors**2))) if len(errors) else None


def _pulses(shows: Iterable[Show]) -> float:
    counted = [(show.pulses, show.seconds - SOON_S) for show in shows if show.seconds > SOON_S]
    seconds = sum(len(pulses) * at_rest for pulses, at_rest in counted)
    return float(sum(pulses.sum() for pulses, _ in counted) / seconds)


def _within(shows: Iterable[Show]) -> float | None:
    off = np.concatenate([np.abs(show.told - show.true).ravel() for show in shows])
    sd = np.concatenate([show.sd.ravel() for show in shows])
    return None if np.isnan(sd).all() else float((off <= 2 * sd).mean())


def _cycling(show: Show) -> NDArray[np.bool_]:
    if show.seconds < _CYCLE_S:
        return np.zeros(len(show.target), bool)
    return np.asarray(show.pulses > CYCLE_PULSES * (show.seconds - SOON_S))


def _fill_ratio(outcomes: Iterable[Outcome]) -> float:
    return max(
        float(np.max(show.arrived_s / fastest))
        for outcome in outcomes
        for show, fastest in zip(outcome.shows, outcome.fastest_s, strict=True)
    )


def _count(masks: Iterable[NDArray[np.bool_]]) -> int:
    return int(sum(mask.sum() for mask in masks))
