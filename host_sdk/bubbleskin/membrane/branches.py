"""Curves that go up, down and up again: their turning points and all their inverses, vectorised."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

Function = Callable[[Any], Any]  # of arrays and of single numbers

SCAN = 600  # points of the search for turning points, even in log λ
GRID = 400  # points per piece from which Newton starts
SMALL = 1e-11  # relative step after which a solution is done
ITERATIONS = 100  # Newton needs 3 to 5; halving, its fallback, at most 60


def turning_points(slope: Function, low: float, high: float) -> list[float]:
    """Where ``slope`` changes sign between ``low`` and ``high``, ascending, to rounding error.

    A pair of turning points closer than the scan's step is found too: wherever the slope dips towards
    zero between two scanned points, its minimum is sought first.
    """
    from scipy.optimize import brentq, minimize_scalar

    x = np.geomspace(low, high, SCAN)
    s = slope(x)
    dips = np.flatnonzero((s[1:-1] > 0) & (s[1:-1] <= s[:-2]) & (s[1:-1] <= s[2:])) + 1
    bottoms = [
        minimize_scalar(
            lambda v: float(slope(v)), bounds=(x[i - 1], x[i + 1]), method="bounded",
            options={"xatol": 1e-9},
        ).x
        for i in dips
    ]  # fmt: skip
    x = np.sort(np.concatenate([x, bottoms]))
    s = slope(x)
    crossings = np.flatnonzero(np.sign(s[:-1]) * np.sign(s[1:]) < 0)
    return [float(brentq(lambda v: float(slope(v)), x[i], x[i + 1], xtol=1e-15, rtol=1e-15)) for i in crossings]


class Piece(NamedTuple):
    """A monotone stretch of the curve with the grid that starts Newton on it."""

    x: np.ndarray
    y: np.ndarray  # ascending or descending

    @property
    def rising(self) -> bool:
        """Whether y grows with x."""
        return bool(self.y[-1] > self.y[0])


class MonotonePieces:
    """A curve y(x) cut at its turning points, so that each piece has one inverse."""

    def __init__(self, function: Function, slope: Function, low: float, high: float) -> None:
        self.function, self.slope = function, slope
        self.turns = turning_points(slope, low, high)
        grids = [np.linspace(a, b, GRID) for a, b in pairwise([low, *self.turns, high])]
        self.pieces = [Piece(x, function(x)) for x in grids]
        self.highest = max(float(piece.y.max()) for piece in self.pieces)

    def solve(self, y: np.ndarray) -> np.ndarray:
        """All x with y(x) = ``y``, ascending along a new last axis; nan behind the last one."""
        found = np.full((*y.shape, len(self.pieces)), np.nan)
        for k, piece in enumerate(self.pieces):
            ends = piece.y[[0, -1]]
            # A turning point belongs to the rising piece beside it, so that it is counted once.
            inside = (ends.min() < y) & (y < ends.max()) | (y == ends.max() if piece.rising else False)
            inside |= (y == ends.min()) if piece.rising else False
            if inside.any():
                found[inside, k] = self._invert(piece, y[inside])
        found.sort(axis=-1)
        return found

    def _invert(self, piece: Piece, y: np.ndarray) -> np.ndarray:
        sign = 1.0 if piece.rising else -1.0
        grid, values = (piece.x, piece.y) if piece.rising else (piece.x[::-1], piece.y[::-1])
        cell = np.clip(np.searchsorted(values, y), 1, len(values) - 1)
        x = np.interp(y, values, grid)
        low = np.minimum(grid[cell - 1], grid[cell])
        high = np.maximum(grid[cell - 1], grid[cell])
        active = np.arange(y.size)
        for _ in range(ITERATIONS):
            xa = x[active]
            error = sign * (self.function(xa) - y[active])
            high[active] = np.where(error > 0, xa, high[active])
            low[active] = np.where(error < 0, xa, low[active])
            with np.errstate(divide="ignore", invalid="ignore"):
                step = error / (sign * self.slope(xa))
            new = xa - step
            bad = ~((new >= low[active]) & (new <= high[active]))  # nan is bad too
            new[bad] = (low[active][bad] + high[active][bad]) / 2
            new[error == 0] = xa[error == 0]
            x[active] = new
            active = active[np.abs(new - xa) > SMALL * xa]  # Newton doubles the digits: the rest is rounding
            if not active.size:
                break
        return x
