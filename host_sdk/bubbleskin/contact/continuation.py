"""Following an equilibrium while the pressures change: small increments, each from where the last one ended.

The energy has many minima, and which one the bubbles are in is decided by the path alone. So an increment is halved until
no bubble moves further than `MOVE`; where the smallest increment still moves one further, the branch has ended: a snap.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.contact.energy import SPRINGS
from bubbleskin.contact.relax import BURST, CONVERGED, extent, hold, relax

Array = NDArray[np.float64]
Records = NDArray[Any]

MOVE = 0.25e-3
"""m. An increment that moves a bubble further is halved."""
HALVINGS = 10
"""An increment is halved so often at most: what is not smooth then is a snap."""
INCREMENTS = 25
"""Increments of one step of pressures, before any is halved."""
TRUST = 0.3e-3
"""m. Longest single Newton step of a bubble: short enough to stay in the valley that it is in."""
FORCE_TOLERANCE = 1e-7
"""N. Largest force left on any coordinate; against the softest spring that is 10 nm."""
LIMIT = 400
"""Newton steps of one relaxation."""
_LEEWAY = 1.5e-3  # m. Pairs are sought so far beyond the barbs at first.


@dataclass(frozen=True)
class Resolution:
    """How closely a path is followed: FINE for results, coarser where many paths are only compared."""

    increments: int = INCREMENTS
    """Of each step of pressures, before any is halved."""
    move_mm: float = 1e3 * MOVE
    """An increment that moves a bubble further is halved."""
    halvings: int = HALVINGS
    """Of an increment, at most."""


FINE = Resolution()


class Snap(NamedTuple):
    """A loss of stability: the bubbles left one branch and fell to another."""

    step: int
    """Which of the steps of pressures it happened in, from 0."""
    fraction: float
    """Share of that step that had been done, 0 to 1."""
    bubbles: tuple[int, ...]
    """Those that moved by more than half of the furthest."""
    before_mm: Array
    after_mm: Array
    """Heights of all bubbles, (n,)."""
    energy: float
    """J, set free."""


class Outcome(NamedTuple):
    """Where a path ended."""

    state: Array
    """x, y, z, R of each bubble, (n, 4) m."""
    energy: float
    """J."""
    residual: float
    """Largest force left, N."""
    ended: int
    """`CONVERGED`, or why not: one of the outcomes of `relax`."""
    snaps: tuple[Snap, ...]
    increments: int
    """Relaxations on the way, halved increments included."""


class PathFollower:
    """Leads a state along pressures: holds what stays the same on the way (bubbles, springs) and the pairs known so far.

    `bubbles` is an array of `energy.BUBBLE`, `springs` are those of `energy.SPRINGS` in order (N/m), `state` is (n, 4) m.
    `kick` (m) is the standard deviation of the random nudge before each relaxation, `seed` theirs.
    """

    def __init__(
        self,
        bubbles: Records,
        springs: tuple[float, ...],
        state: Array,
        *,
        kick: float = 0.0,
        seed: int = 0,
        resolution: Resolution = FINE,
    ) -> None:
        from scipy.spatial import cKDTree

        self.bubbles, self.state = bubbles, state.copy()
        self.springs = np.array([springs], SPRINGS)[0]
        self.pairs: NDArray[np.int64] = np.empty((0, 2), np.int64)
        self._tree = cKDTree(np.column_stack([bubbles["x"], bubbles["y"]]))
        self._resolution = resolution
        self._move = 1e-3 * resolution.move_mm
        self._kick, self._rng = kick, np.random.default_rng(seed)
        self._trace = np.empty(LIMIT + 1)
        self._leeway = _LEEWAY
        self._reach = 0.0
        self._radius = float(state[:, 3].max())
        self._snaps: list[Snap] = []
        self._increments = 0
        self._residual, self._energy, self._drop = 0.0, 0.0, 0.0
        self.ended = CONVERGED

    def find_pairs(self, radius: float) -> None:
        """See to it that `pairs` has all bubbles that could touch while none is larger than `radius` (m)."""
        reach = 2 * (radius + self._leeway)
        if reach > self._reach:
            self._reach = reach
            pairs = self._tree.query_pairs(reach, output_type="ndarray")
            self.pairs = np.ascontiguousarray(pairs[np.lexsort(pairs.T[::-1])], np.int64)

    def find_pairs_of_state(self) -> None:
        """See to it that `pairs` has all bubbles that touch in `state`, however far aside of their barbs."""
        aside = np.hypot(self.state[:, 0] - self.bubbles["x"], self.state[:, 1] - self.bubbles["y"]).max()
        self.find_pairs(float(self.state[:, 3].max() + aside))

    def follow(self, step: int, pressures: Callable[[float], Array]) -> None:
        """Follow `pressures`, a function of 0 to 1 that gives (n,) Pa, and note the snaps on the way as of this `step`."""
        increments = self._resolution.increments
        smallest = 1.001 * 0.5**self._resolution.halvings / increments
        done, size = 0.0, 1.0 / increments
        while done < 1.0 - 1e-12:
            to = min(done + size, 1.0)
            if 1.0 - to < 1e-9:
                to = 1.0
            last = self.state
            distance = self._relax(pressures(to))
            self._increments += 1
            if (distance > self._move or self.ended != CONVERGED) and size > smallest:
                self.state, size = last, size / 2
                continue
            if distance > self._move and self.ended != BURST:
                self._note_snap(step, to, last)
            if self.ended != CONVERGED:
                return
            done = to
            if distance < 0.4 * self._move:
                size = min(2 * size, 1.0 / increments)

    def outcome(self) -> Outcome:
        """Where it is now."""
        return Outcome(self.state, self._energy, self._residual, self.ended, tuple(self._snaps), self._increments)

    def _relax(self, pressure: Array) -> float:
        """Relax at `pressure`, (n,) Pa; returns how far (m) that moved a bubble."""
        begin = self.state + self._rng.normal(0.0, self._kick, self.state.shape)
        self.find_pairs(self._radius + self._move)
        for _ in range(8):
            state = begin.copy()
            self.ended, self._residual, steps, _ = relax(
                state, pressure, self.bubbles, self.springs, self.pairs, TRUST, FORCE_TOLERANCE, self._trace
            )
            self._radius, aside, distance = extent(state, self.state, self.bubbles)
            if aside <= self._leeway and 2 * (self._radius + aside) <= self._reach:
                break
            self._leeway = max(self._leeway, 1.2 * aside)  # Too few pairs were looked at: again with more.
            self.find_pairs(self._radius)
        self._energy, self._drop = float(self._trace[steps]), float(self._trace[0] - self._trace[steps])
        self.state = state
        return float(distance)

    def _note_snap(self, step: int, fraction: float, last: Array) -> None:
        distance = np.sqrt(((self.state - last) ** 2).sum(axis=1))
        bubbles = tuple(np.flatnonzero(distance > distance.max() / 2).tolist())
        before, after = (1e3 * (state[:, 2] + state[:, 3]) for state in (last, self.state))
        self._snaps.append(Snap(step, fraction, bubbles, before, after, self._drop))


def ramps(start: Array, steps: Array, radii: Array | None, bubbles: Records) -> Iterator[Callable[[float], Array]]:
    """For each of `steps`, (k, n) Pa, the pressures on the way to it, as a function of 0 to 1; `start` is (n,) Pa.

    Straight ones, or, with free `radii`, (k + 1, n) m, those that hold radii that go straight.
    """
    for k, end in enumerate(steps):
        if radii is None:
            yield partial(_straight, start if k == 0 else steps[k - 1], end)
        else:
            yield partial(_by_radius, radii[k], radii[k + 1], end, bubbles)


def _straight(begin: Array, end: Array, share: float) -> Array:
    return begin + share * (end - begin)


def _by_radius(begin: Array, end: Array, pressure: Array, bubbles: Records, share: float) -> Array:
    if share >= 1.0:
        return pressure
    held = np.empty(len(begin))
    hold(begin + share * (end - begin), bubbles, held)
    return held
