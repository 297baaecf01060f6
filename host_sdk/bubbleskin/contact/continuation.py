"""Following an equilibrium while the pressures change: small increments, each from where the last one ended.

The energy has many minima, and which one the bubbles are in is decided by the path alone. So an increment is halved until
no bubble moves further than `MOVE`; where the smallest increment still moves one further, the branch has ended: a snap.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bubbleskin.contact.energy import SPRINGS
from bubbleskin.contact.relax import BURST, CONVERGED, extent, hold, relax

Array = NDArray[np.float64]
Records = NDArray[Any]

MOVE = 0.25e-3
"""m. An increment that moves a bubble further is halved."""
HALVINGS = 10
"""Of an increment, at most: what is not smooth then is a snap."""
TRUST = 0.3e-3
"""m. Longest single Newton step of a bubble: short enough to stay in the valley that it is in."""
TOLERANCE = 1e-7
"""N. Largest force left on any coordinate; against the softest spring that is 10 nm."""
LIMIT = 400
"""Newton steps of one relaxation."""
_LEEWAY = 1.5e-3  # m, how far barbs are looked beyond, at first


class Snap(NamedTuple):
    """A loss of stability: the bubbles left one branch and fell to another."""

    step: int
    """Which of the steps, from 0."""
    fraction: float
    """Where in it, 0 to 1."""
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
    energy: float
    residual: float
    ended: int
    snaps: tuple[Snap, ...]
    increments: int


class PathFollower:
    """A state that is led along pressures; what stays the same on the way: bubbles, springs, pairs, kicks."""

    def __init__(
        self,
        bubbles: Records,
        springs: tuple[float, ...],
        state: Array,
        *,
        kick: float = 0.0,
        seed: int = 0,
        move: float = MOVE,
        halvings: int = HALVINGS,
    ) -> None:
        self.bubbles, self.state = bubbles, state.copy()
        self.springs = np.array([springs], SPRINGS)[0]
        self._barbs = np.column_stack([bubbles["x"], bubbles["y"]])
        self._tree = cKDTree(self._barbs)
        self._move, self._finest = move, 0.5**halvings
        self._kick, self._rng = kick, np.random.default_rng(seed)
        self._trace = np.empty(LIMIT + 1)
        self._leeway = _LEEWAY
        self._reach = 0.0
        self._radius = float(state[:, 3].max())
        self.snaps: list[Snap] = []
        self.increments = 0
        self.residual, self.energy, self.ended = 0.0, 0.0, CONVERGED

    def reach(self, radius: float) -> None:
        """See to it that pairs of bubbles of up to `radius` are known."""
        reach = 2 * (radius + self._leeway)
        if reach > self._reach:
            self._reach = reach
            pairs = self._tree.query_pairs(reach, output_type="ndarray")
            self.pairs = np.ascontiguousarray(pairs[np.lexsort(pairs.T[::-1])], np.int64)

    def step(self, number: int, pressures: Callable[[float], Array], increments: int) -> None:
        """Follow `pressures`, a function of 0 to 1, and append the snaps on the way."""
        t, size, last = 0.0, 1.0 / increments, self.state
        while t < 1.0 - 1e-12:
            to = min(t + size, 1.0)
            if 1.0 - to < 1e-9:
                to = 1.0
            last = self.state
            pressure = pressures(to)
            distance = self._relax(pressure)
            self.increments += 1
            finest = size <= 1.001 * self._finest / increments
            if (distance > self._move or self.ended != CONVERGED) and not finest:
                self.state, size = last, size / 2
                continue
            if distance > self._move and self.ended != BURST:
                self._snapped(number, to, last)
            if self.ended != CONVERGED:
                return
            t = to
            if distance < 0.4 * self._move:
                size = min(2 * size, 1.0 / increments)

    def _relax(self, pressure: Array) -> float:
        """Relax at `pressure`; returns how far that moved a bubble."""
        begin = self.state + self._rng.normal(0.0, self._kick, self.state.shape)
        self.reach(self._radius + self._move)
        for _ in range(8):
            state = begin.copy()
            self.ended, self.residual, steps, _ = relax(
                state, pressure, self.bubbles, self.springs, self.pairs, TRUST, TOLERANCE, LIMIT, self._trace
            )
            self._radius, aside, distance = extent(state, self.state, self.bubbles)
            if aside <= self._leeway and 2 * (self._radius + aside) <= self._reach:
                break
            self._leeway = max(self._leeway, 1.2 * aside)  # too few pairs were looked at: again with more
            self.reach(self._radius)
        self.energy, self._drop = float(self._trace[steps]), float(self._trace[0] - self._trace[steps])
        self.state = state
        return float(distance)

    def _snapped(self, number: int, fraction: float, last: Array) -> None:
        distance = np.sqrt(((self.state - last) ** 2).sum(axis=1))
        bubbles = tuple(np.flatnonzero(distance > distance.max() / 2).tolist())
        before, after = (1e3 * (state[:, 2] + state[:, 3]) for state in (last, self.state))
        self.snaps.append(Snap(number, fraction, bubbles, before, after, self._drop))

    def outcome(self) -> Outcome:
        """Where it is now."""
        return Outcome(self.state, self.energy, self.residual, self.ended, tuple(self.snaps), self.increments)


def ramps(start: Array, steps: Array, radii: Array | None, bubbles: Records) -> Iterator[Callable[[float], Array]]:
    """For each of `steps`, (k, n) Pa, the pressures on the way to it.

    Straight ones, or, with free `radii`, (k + 1, n) m, those that hold radii that go straight.
    """
    for k, target in enumerate(steps):
        begin = start if k == 0 else steps[k - 1]
        if radii is None:

            def straight(t: float, a: Array = begin, b: Array = target) -> Array:
                return a + t * (b - a)

            yield straight
            continue

        def rising(t: float, a: Array = radii[k], b: Array = radii[k + 1], end: Array = target) -> Array:
            if t >= 1.0:
                return end
            out = np.empty(len(a))
            hold(a + t * (b - a), bubbles, out)
            return out

        yield rising
