"""What is asked of every contender: ways of using a wristband, each a function of contender, kind and random numbers."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.bench.control.contenders import CONTENDERS, Contender
from bubbleskin.bench.control.fill import fastest_fill
from bubbleskin.bench.control.plants import Kind, sheet
from bubbleskin.bench.control.shows import TIMES_S, Show, hold

_SOON_S, _LATER_S, _LATE_S = TIMES_S
_CLEARED_S = 1.1  # of isolation before faults may be cleared
_LONG_SHOWS = 300
_LONG_S = 2.0
_HIGH_MM, _LOW_MM = 12.0, 6.0
_SEARCH_SHOWS, _SEARCH_S = 10, 1.8


class Job(NamedTuple):
    """One contender on one sheet, used in one way."""

    use: str
    contender: str
    kind: Kind
    seed: int


class Outcome(NamedTuple):
    """All shows of a job; `fastest_s` is of those that were filled from rest, (n,) each, else empty."""

    job: Job
    shows: list[Show]
    fastest_s: list[NDArray[np.float64]]


def random_holds(contender: Contender, kind: Kind, rng: np.random.Generator) -> Iterator[Show]:
    """Random shapes, two of them for a minute and eight for ten seconds."""
    for seconds in (_LATE_S, *(_LATER_S,) * 4, _LATE_S, *(_LATER_S,) * 4):
        yield hold(contender, _random(contender, kind, rng), seconds)


def without_a_vent(contender: Contender, kind: Kind, rng: np.random.Generator) -> Iterator[Show]:
    """Three hundred random shapes of two seconds, none of them with a bubble at rest."""
    for _ in range(_LONG_SHOWS):
        yield hold(contender, _random(contender, kind, rng), _LONG_S)


def to_and_fro(contender: Contender, kind: Kind, rng: np.random.Generator) -> Iterator[Show]:
    """Everything to 12 mm, to 6 mm and again, a minute each: what memory of the rubber shows most."""
    for height in (_HIGH_MM, _LOW_MM) * 2:
        yield hold(contender, np.full(len(contender.rest_mm), height), _LATE_S)


def search(contender: Contender, kind: Kind, rng: np.random.Generator) -> Iterator[Show]:
    """Ten short random shows: for faults, vent-locks and limit cycles."""
    for _ in range(_SEARCH_SHOWS):
        yield hold(contender, _random(contender, kind, rng), _SEARCH_S)


def step(contender: Contender, kind: Kind, rng: np.random.Generator) -> Iterator[Show]:
    """From rest to 12 mm."""
    yield hold(contender, np.full(len(contender.rest_mm), _HIGH_MM), _LONG_S)


USES: dict[str, Callable[[Contender, Kind, np.random.Generator], Iterator[Show]]] = {
    "random holds": random_holds,
    "300 shows without a vent": without_a_vent,
    "12 → 6 → 12 → 6 mm": to_and_fro,
    "search": search,
    "5 → 12 mm": step,
}
HOLDS, LONG, TO_AND_FRO, SEARCH, STEP = USES


def run(job: Job) -> Outcome:
    """Do it: the same job gives the same outcome, in whichever process."""
    contender = CONTENDERS[job.contender](sheet(job.kind, job.seed))
    rng = np.random.default_rng((job.seed, *job.use.encode()))
    fastest = [fastest_fill(contender.board, np.full(len(contender.rest_mm), _HIGH_MM))] if job.use == STEP else []
    shows = []
    for show in USES[job.use](contender, job.kind, rng):
        shows.append(show)
        if show.faulty.any():
            contender.run(_CLEARED_S)
            contender.clear_faults()
    return Outcome(job, shows, fastest)


def _random(contender: Contender, kind: Kind, rng: np.random.Generator) -> NDArray[np.float64]:
    return rng.uniform(kind.lowest_mm, kind.highest_mm, len(contender.rest_mm))
