"""Restrictors compared with one another by what they take from the reservoir.

Alone, a bubble tells its own size badly: with all its volumes a twentieth larger, and its flows too, pressures are the same. But
all fill from one reservoir, whose pressure falls as air is taken and rises as the pump works. So flows are known in a
common measure, whatever reservoir and pump are, and what is known beforehand of each bubble tells of all.

With q the flow into the reservoir over its volume, γ the ratio of heats of air and τ the time in which it takes its wall's
temperature, its pressure is p₀ + ∫ q (1 + (γ − 1) e^(−(t − s)/τ)) ds. The pump works in proportion to what the filtered pressure
is below a threshold, a period later.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Floats = NDArray[np.float64]

_HEAT = 0.4  # γ − 1
_HEAT_S = 1.0
_BAND_PA = 1500.0  # in which the threshold is looked for, about the highest pressure


class Draw(NamedTuple):
    """What one group has taken."""

    tick_s: float
    supply: Floats
    """Readings, Pa."""
    filtered: Floats
    taken: dict[int, Floats]
    """By bubble, µJ in each period, of a restrictor whose flow factor is 1."""


class Flows(NamedTuple):
    """Of each bubble, in a measure of their own."""

    bubbles: tuple[int, ...]
    value: Floats
    covariance: Floats


def compare(draws: Sequence[Draw]) -> Flows:
    """Flow factors of all bubbles, but for one factor that they share."""
    bubbles = tuple(bubble for draw in draws for bubble in draw.taken)
    top = float(np.median([np.percentile(draw.filtered, 80) for draw in draws]))
    measured = np.concatenate([draw.supply for draw in draws])

    def solve(threshold: float, heat_s: float) -> tuple[Floats, Floats, Floats]:
        basis = _basis(draws, bubbles, threshold, heat_s)
        found, *_ = np.linalg.lstsq(basis, measured, rcond=None)
        return basis, found, measured - basis @ found

    def left(at: Floats) -> Floats:
        return solve(top + _BAND_PA * float(at[0]), _HEAT_S * float(np.exp(at[1])))[2]

    best = least_squares(left, np.zeros(2), bounds=([-1.0, -1.0], [1.0, 1.0]), diff_step=np.full(2, 1e-3)).x
    basis, found, off = solve(top + _BAND_PA * float(best[0]), _HEAT_S * float(np.exp(best[1])))
    covariance = float(np.mean(off**2)) * np.linalg.pinv(basis.T @ basis)
    n = len(bubbles)
    return Flows(bubbles, -found[:n], np.asarray(covariance[:n, :n], float))


def _basis(draws: Sequence[Draw], bubbles: Sequence[int], threshold: float, heat_s: float) -> Floats:
    blocks = []
    for number, draw in enumerate(draws):
        columns = np.zeros((len(draw.supply), len(bubbles) + 1 + len(draws)))
        for bubble, taken in draw.taken.items():
            columns[:, bubbles.index(bubble)] = _response(taken, draw.tick_s, heat_s)
        worked = np.concatenate([[0.0], np.maximum(threshold - draw.filtered[:-1], 0.0)])
        columns[:, len(bubbles)] = _response(worked, draw.tick_s, heat_s)
        columns[:, len(bubbles) + 1 + number] = 1.0
        blocks.append(columns)
    return np.concatenate(blocks)


def _response(flow: Floats, tick_s: float, heat_s: float) -> Floats:
    """Pressure at each reading, of what has flowed in the periods before."""
    from scipy.signal import lfilter  # takes a third of a second to import

    before = np.concatenate([[0.0], flow[:-1]])
    kept = float(np.exp(-tick_s / heat_s))
    return np.asarray(np.cumsum(before) + _HEAT * lfilter([1.0], [1.0, -kept], before))
