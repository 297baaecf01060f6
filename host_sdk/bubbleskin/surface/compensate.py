"""From tops that are asked to heights alone that are sent: one step where one does, a plan where order counts.

On one branch tops are a smooth function of the volumes, so a few Newton steps find the volumes of a shape. Whether one way
leads there from the shape that is kept, following it says. What cannot be had becomes the nearest that was found.
"""

from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.surface.limits import Limits

if TYPE_CHECKING:
    from bubbleskin.contact.held import HeldShape

Array = NDArray[np.float64]

SHORT_MM = 0.2
"""A bubble that ends further from what was asked has not got it."""
_PATHS = 20
"""Ways that the planner may follow: shapes that can be had take it a few."""
_SURE_MM = 0.5
"""Shapes that differ by more with other springs and nudges are a matter of chance."""
_GOAL_MM = 0.01
_SAME_MM = 0.05  # two ways that end so near each other end in the same shape
_LONGEST_MM = 1.0  # of one Newton step, of a height alone
_ITERATIONS = 12
_PEAK_MM = 0.3
_FINEST_SHARE = 0.02  # of a way towards what cannot be had
_FAR_MM = 0.8
_LOWERINGS = 3  # tops that are asked lower lead to another shape, in which others may pass
_WORTH = 0.03  # an iteration that takes off less of the squared error is the last


class Answer(NamedTuple):
    """What to send for tops that were asked."""

    steps: tuple[Array, ...]
    """Heights alone, mm, (n,) each, one after the other."""
    predicted_mm: Array
    """The tops that come of it, (n,)."""
    members: "list[HeldShape]"
    """The kept shapes, where that leads them."""

    @property
    def chance_mm(self) -> float:
        """By how much more a top may be elsewhere than springs that nobody has measured explain; 0: that is sure."""
        tops = np.array([member.height_mm for member in self.members])
        explained = _SURE_MM + np.abs(self.members[0].lift_mm)
        return max(float((np.abs(tops - tops[0]) - explained).max()), 0.0)


class Compensation:
    """One question: tops `asked_mm`, (n,), from the shape of `members`, the likeliest first."""

    def __init__(self, members: "list[HeldShape]", asked_mm: Array, limits: Limits):
        self._members, self._limits = members, limits
        self._asked = np.maximum(asked_mm, limits.rest_mm)
        self._had = False  # whether these tops can be had, on whatever way

    def answer(self, *, orders: bool) -> Answer:
        """The nearest that stays within the limits; with `orders`, several steps where one does not do."""
        best: Answer | None = None
        for steps in self._new(self._ways(orders)):
            found = self._follow(steps)
            if found and (best is None or self._worth(found) < self._worth(best)):
                best = found
            if best and self._worth(best) <= _SAME_MM:
                return best
        if best is None or self._worth(best) > SHORT_MM + 0.1:
            return self._within_limits(best, orders)
        return best

    def _within_limits(self, best: Answer | None, orders: bool) -> Answer:
        """The nearest of `best`, of tops asked lower, and, where these are far, of a share of the way."""

        def off_mm(
            found: Answer,
        ) -> float:  # of the worst bubble and of all: else one that is far hides what the others do
            return self._worth(found) + float(np.sqrt(self._misfit_of(found.predicted_mm) / len(self._asked)))

        found = [one for one in (best, self._lowered() if orders else None) if one]
        if not found or min(map(self._worth, found)) > _FAR_MM:
            found.append(self._held_back())
        return min(found, key=off_mm)

    def _new(self, ways: Iterator[tuple[Array, ...]]) -> Iterator[tuple[Array, ...]]:
        """These without steps that lead nowhere, and without what was there before."""
        seen = set()
        for way in ways:
            steps, where = [], self._members[0].alone_mm
            for step in way:
                if np.abs(step - where).max() > _GOAL_MM or step is way[-1]:
                    steps.append(step)
                    where = step
            key = tuple(np.rint(np.concatenate(steps) / _SAME_MM).astype(int).tolist())
            if key not in seen:
                seen.add(key)
                yield tuple(steps)

    def _ways(self, orders: bool) -> Iterator[tuple[Array, ...]]:
        """Ways from the simplest on; the caller ends where one leads to what was asked."""
        now = self._members[0]
        guesses = self._asked - now.lift_mm, self._asked
        found = []
        for guess in guesses[: 1 if np.abs(now.lift_mm).max() < _GOAL_MM else 2]:
            found.append(self._newton(guess))
            yield (found[-1],)
        if not orders:
            return
        for end in found:
            yield from self._orders(end)
        for end in self._branches():
            yield from self._orders(end)
        planned = self._planned() if self._had else None
        if planned:
            yield planned

    def _orders(self, end: Array) -> Iterator[tuple[Array, ...]]:
        """Ways to `end` in two steps: down first; apart first; peaks first, the others so low that none touch; peaks last."""
        now, low = self._members[0].alone_mm, self._limits.gaps.separated(end)
        yield np.minimum(now, end), end
        yield np.minimum(now, low), end
        peaks = self._peaks()
        if peaks.any() and not peaks.all():
            yield np.where(peaks, end, low), end
            yield np.where(peaks, low, end), end

    def _branches(self) -> Iterator[Array]:
        """Ends on other branches: those where the peaks are lifted, and where they are not."""
        peaks = self._peaks()
        if not peaks.any() or peaks.all():
            return
        guess = self._limits.clip(self._asked)
        low = self._limits.gaps.separated(guess)
        yield self._newton(guess, np.where(peaks, guess, low))
        yield self._newton(guess, np.where(peaks, low, guess))

    def _peaks(self) -> NDArray[np.bool_]:
        """The bubbles that are asked to be higher than every neighbour by so much that these may lift them."""
        around = self._members[0].model.layout.neighbours
        return np.array(
            [
                bool(near) and top > self._asked[list(near)].max() + _PEAK_MM
                for top, near in zip(self._asked, around, strict=True)
            ]
        )

    def _newton(self, guess: Array, first: Array | None = None) -> Array:
        """Heights alone with which the tops are as asked, or as near as they come, on the branch where `guess` leads.

        `first`: by way of these.
        """
        shape = self._members[0].copy()
        if first is not None:
            shape.go(first)
        shape.go(self._limits.clip(guess))
        for _ in range(_ITERATIONS):
            missing = self._asked - shape.height_mm
            if np.abs(missing).max() < _GOAL_MM:
                break
            slope = shape.slope()
            if slope is None:
                break
            change = self._bounded(slope, missing, shape.alone_mm)
            nearer = self._nearer(shape, change)
            if nearer is None:
                break
            gained = 1 - self._misfit(nearer) / self._misfit(shape)
            shape = nearer
            if gained < _WORTH:
                break
        self._had = self._had or float(np.abs(self._asked - shape.height_mm).max()) <= SHORT_MM
        return shape.alone_mm

    def _bounded(self, slope: Array, missing: Array, alone_mm: Array) -> Array:
        """The least squares of `slope` change = `missing` within the limits: those at a bound stay there, the others go on."""
        low = np.maximum(self._limits.rest_mm - alone_mm, -_LONGEST_MM)
        high = np.minimum(self._limits.alone_mm - alone_mm, _LONGEST_MM)
        change = np.zeros_like(alone_mm)
        free = np.ones(len(alone_mm), bool)
        while free.any():
            rest = missing - slope[:, ~free] @ change[~free]
            change[free] = np.linalg.lstsq(slope[:, free], rest, rcond=1e-6)[0]
            beyond = free & ((change < low) | (change > high))
            if not beyond.any():
                break
            change = change.clip(low, high)
            free &= ~beyond
        return change

    def _nearer(self, shape: "HeldShape", change: Array) -> "HeldShape | None":
        for share in (1.0, 0.4, 0.15):
            trial = shape.copy()
            trial.go(shape.alone_mm + share * change)
            if self._misfit(trial) < self._misfit(shape):
                return trial
        return None

    def _planned(self) -> tuple[Array, ...] | None:
        """The planner's steps; None where it finds none soon."""
        from bubbleskin.planner.search import plan

        def count(tried: int, _: float) -> None:
            if tried > _PATHS:
                raise _EnoughError

        now, limits = self._members[0], self._limits
        try:
            found = plan(
                self._asked,
                now.model.layout,
                contact=now.model,
                start=now.shape(),
                limit_mm=limits.alone_mm,
                progress=count,
            )
        except _EnoughError:
            return None
        return tuple(limits.clip(step.target_mm) for step in found.steps) or (now.alone_mm,)

    def _follow(self, steps: tuple[Array, ...]) -> Answer | None:
        """Where these steps lead; None where a top would pass its limit on the way, as far as anybody knows."""
        members = [member.copy() for member in self._members]
        for step in steps:
            if not self._limits.keeps(members, step):
                return None
        return Answer(steps, members[0].height_mm, members)

    def _lowered(self) -> Answer | None:
        """With tops asked lower where they would pass their limit, by as much as they do; None where that does not help."""
        asked = self._asked
        for _ in range(_LOWERINGS):
            lower = Compensation(self._members, asked, self._limits)
            end = lower._newton(asked)
            for steps in ((end,), *islice(lower._orders(end), 2)):
                found = lower._follow(steps)
                if found:
                    return found
            passed = self._limits.passed_mm(self._let_go(end).members)
            if not passed.any():
                return None
            asked = asked - passed
        return None

    def _held_back(self) -> Answer:
        """As far towards the asked as the limits let it: from where no two bubbles touch, the best share of the way."""
        high = self._limits.clip(self._asked)
        low = self._limits.gaps.separated(high)
        best = self._follow((low,)) or self._let_go(low)
        share, part = 0.0, 0.5
        while part > _FINEST_SHARE:
            found = self._follow((low + (share + part) * (high - low),))
            if found and self._worth(found) <= self._worth(best):
                share, best = share + part, found
            part /= 2
        return best

    def _let_go(self, alone_mm: Array) -> Answer:
        """To these heights alone, whatever that does on the way."""
        members = [member.copy() for member in self._members]
        for member in members:
            member.go(alone_mm)
        return Answer((alone_mm,), members[0].height_mm, members)

    def _misfit(self, shape: "HeldShape") -> float:
        return self._misfit_of(shape.height_mm)

    def _misfit_of(self, height_mm: Array) -> float:
        return float(((self._asked - height_mm) ** 2).sum())

    def _worth(self, found: Answer) -> float:
        """How far it is from what was asked, mm, chance included: where tops are as asked, that only chooses among ways."""
        off = float(np.abs(self._asked - found.predicted_mm).max())
        if off <= SHORT_MM:
            return off + 0.1 * min(found.chance_mm, 1.0)
        return off + 0.5 * found.chance_mm


class _EnoughError(Exception):
    """The planner has followed as many ways as it may."""
