"""Run everything, in processes of their own, and put it into rows."""

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor

from bubbleskin.bench.control import touching
from bubbleskin.bench.control.contenders import CONTENDERS, PRESENT
from bubbleskin.bench.control.figures import WRONG_MM, Figures
from bubbleskin.bench.control.plants import KINDS, REAL, Kind
from bubbleskin.bench.control.runs import HOLDS, LONG, SEARCH, STEP, TO_AND_FRO, Job, Outcome, run
from bubbleskin.bench.control.shows import TIMES_S
from bubbleskin.bench.rows import Row, share_of
from bubbleskin.sweeps.workers import end_with_parent

_SHEETS = {HOLDS: 4, LONG: 2, TO_AND_FRO: 4, STEP: 8, SEARCH: 100}
"""Of each kind at full size, a seed each."""
LONG_GOAL_MM, TO_AND_FRO_GOAL_MM = 0.15, 0.20
FILL_GOAL, OVERSHOOT_GOAL_MM = 1.5, 0.2


def figures(size: float = 1.0, seed: int = 1) -> Iterator[Figures]:
    """All uses of all contenders, one after another, as they are there. `size` is the share of sheets, `seed` the first's."""
    groups = [
        [Job(use, contender, kind, seed + k) for k in range(share_of(_SHEETS[use], size))]
        for use, kind, contender in _asked()
    ]
    # Fresh interpreters: one that was forked from threads may hang.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context, initializer=end_with_parent) as pool:
        waiting: list[list[Future[Outcome]]] = [[pool.submit(run, job) for job in jobs] for jobs in groups]
        for futures in waiting:
            yield Figures.of([future.result() for future in futures])
            futures.clear()  # what a minute of a board has seen is not needed again


def _asked() -> Iterator[tuple[str, Kind, str]]:
    for kind in KINDS:
        for contender in CONTENDERS:
            yield HOLDS, kind, contender
    for use in (LONG, TO_AND_FRO, STEP):
        for contender in CONTENDERS:
            yield use, REAL, contender
    for contender in CONTENDERS:
        yield STEP, KINDS[0], contender
    for kind in KINDS:
        yield SEARCH, kind, PRESENT


COUNT = len(list(_asked()))
"""Of figures that there will be."""


def rows(size: float = 1.0, seed: int = 1) -> Iterator[Row]:
    """Heights that were held, told and missed, of the firmware and of the first law on the same plants."""
    for one in figures(size, seed):
        yield from rows_of(one)
    yield from touching.rows(size, seed)


def rows_of(one: Figures) -> Iterator[Row]:
    """The rows of one contender on one kind of plant."""
    kind = next(kind for kind in KINDS if kind.name == one.plant)
    name = f"{one.plant}, {one.use}, {one.contender}"
    goals = one.contender == PRESENT
    yield from _errors(one, name, _rms_goal(one, kind) if goals else "")
    if one.use in (HOLDS, TO_AND_FRO, LONG):
        at_most = "" if kind.pulses is None or one.use != HOLDS else f"≤ {kind.pulses:g}"
        yield Row(f"{name}: pulses per bubble at rest", one.pulses, "/s", at_most if goals else "")
        if one.within is not None:
            yield Row(f"{name}: told within two standard deviations", 100 * one.within, "%", "90 to 99")
        if one.settled_wrong is not None:
            yield Row(f"{name}: settled, and more than {WRONG_MM:g} mm off", 100 * one.settled_wrong, "%", "≤ 1")
    if one.fill_ratio is not None and one.overshoot_mm is not None:
        yield Row(f"{name}: longest way, by the fastest fill", one.fill_ratio, "×", f"≤ {FILL_GOAL:g}" if goals else "")
        yield Row(f"{name}: overshoot", one.overshoot_mm, "mm", f"≤ {OVERSHOOT_GOAL_MM:g}" if goals else "")
    for what, count in (
        ("vent-locks", one.vent_locks),
        ("false faults", one.faults),
        ("limit cycles", one.limit_cycles),
    ):
        yield Row(f"{name}: {what}", count, "", "0" if goals else "")
    if goals:
        yield Row(f"{name}: emptied on the way", one.emptied, "")


def _errors(one: Figures, name: str, goal: str) -> Iterator[Row]:
    if one.use == LONG:
        yield Row(f"{name}: RMS of the last tenth", one.last_rms_mm, "mm", goal)
    elif one.use != SEARCH:
        for moment, rms, most in zip(TIMES_S, one.rms_mm, one.max_mm, strict=True):
            if rms is not None and most is not None:
                yield Row(f"{name}: RMS at {moment:g} s", rms, "mm", goal)
                yield Row(f"{name}: most at {moment:g} s", most, "mm")


def _rms_goal(one: Figures, kind: Kind) -> str:
    goal = {LONG: LONG_GOAL_MM, TO_AND_FRO: TO_AND_FRO_GOAL_MM, STEP: None}.get(one.use, kind.rms_mm)
    return "" if goal is None else f"≤ {goal:g}"
