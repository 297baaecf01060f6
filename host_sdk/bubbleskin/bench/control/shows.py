"""Shows, and what is seen of each: true heights beside what was asked and what was told."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.bench.control.contenders import Contender

TIMES_S = (0.6, 10.0, 60.0)
"""After a request, at which errors are taken."""
SOON_S = TIMES_S[0]
"""From here on a bubble is at rest."""
CYCLE_PULSES = 5.0
"""Per second at rest: more is a limit cycle."""
LOCK_S = 1.0
"""A vent open for so long at a stretch, of a bubble that is asked up, is a vent-lock."""
NEAR_MM = 0.2
"""Within which a bubble is there."""
EMPTY_MM = 0.15
"""Above rest; lower, on its way between two heights, a bubble has been emptied."""


@dataclass(frozen=True)
class Show:
    """One request, held until the next. Arrays by moment, (k, n), are of those of `TIMES_S` that it has lasted."""

    target: NDArray[np.float64]
    seconds: float
    true: NDArray[np.float64]
    told: NDArray[np.float64]
    sd: NDArray[np.float64]
    settled: NDArray[np.bool_]
    faulty: NDArray[np.bool_]
    pulses: NDArray[np.int64]
    """Of each bubble, from `SOON_S` on."""
    locked: NDArray[np.bool_]
    emptied: NDArray[np.bool_]
    """Whether it was emptied on its way, to know its height afresh."""
    arrived_s: NDArray[np.float64]
    """From when on it was within `NEAR_MM`; infinite where that is not so at the end."""
    overshoot_mm: NDArray[np.float64]
    """How far it has gone beyond, until `SOON_S`."""


def hold(contender: Contender, target: NDArray[np.float64], seconds: float) -> Show:
    """Ask for `target`, (n,) mm, and look for so long."""
    board = contender.board
    start = board.alone_mm
    board.begin()
    contender.show(target)
    passed = 0.0
    true, told = [], []
    moments = [moment for moment in TIMES_S if moment <= seconds] or [seconds]
    for moment in moments:
        contender.run(moment - passed)
        passed = moment
        true.append(board.alone_mm)
        told.append(contender.told())
    contender.run(max(seconds - passed, 0.0))
    seen = _of_ticks(*board.seen(), start, target, contender.rest_mm, board.tick_s)
    # A fault after the last look isolates its bubble, which is no vent-lock.
    faulty = contender.told().faulty if seconds > passed else told[-1].faulty
    return Show(
        target=target,
        seconds=seconds,
        true=np.array(true),
        told=np.array([one.height_mm for one in told]),
        sd=np.array([one.sd_mm for one in told]),
        settled=np.array([one.settled for one in told]),
        faulty=faulty,
        **seen,
    )


def _of_ticks(
    heights: NDArray[np.float64],
    energised: NDArray[np.float64],
    start: NDArray[np.float64],
    target: NDArray[np.float64],
    rest: NDArray[np.float64],
    tick: float,
) -> dict[str, Any]:
    """What all ticks say together."""
    soon = round(SOON_S / tick)
    full = energised >= tick * (1 - 1e-9)
    dosed = (energised > 0) & ~full
    away = np.abs(heights - target) > NEAR_MM
    last = len(away) - np.argmax(away[::-1], axis=0)
    beyond = (heights[:soon] - target) * np.sign(target - start)
    return {
        "pulses": dosed[soon:].any(axis=2).sum(axis=0),
        "locked": _longest(full[soon:, :, 1]) * tick > LOCK_S,
        "emptied": (heights.min(axis=0) < rest + EMPTY_MM) & (np.minimum(start, target) > rest + 2 * EMPTY_MM),
        "arrived_s": np.where(away.any(axis=0), np.where(away[-1], np.inf, last * tick), 0.0),
        "overshoot_mm": np.maximum(beyond.max(axis=0, initial=0.0), 0.0),
    }


def _longest(on: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The longest run of True in each column."""
    longest = np.zeros(on.shape[1], int)
    run = np.zeros_like(longest)
    for row in on:
        run = np.where(row, run + 1, 0)
        longest = np.maximum(longest, run)
    return longest
