"""The planner: which bubbles go first, and to which sizes, so that the array settles in the shape asked for."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from bubbleskin.checks import instance, number, positive
from bubbleskin.contact.continuation import FINE, Resolution
from bubbleskin.contact.model import CompliantContact, balloons_of
from bubbleskin.contact.shape import Shape
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon
from bubbleskin.planner import nearest, robust
from bubbleskin.planner.inverse import GOAL_MM, correct, misfit
from bubbleskin.planner.orders import Order, layers, one_by_one, steps_of, three_groups, two_groups, variants
from bubbleskin.planner.plan import Plan, PlanStep
from bubbleskin.shape.heightfield import Heights, sample

Array = NDArray[np.float64]

LIMIT_MM = 14.0
"""Highest a bubble may be alone: the boards' own limit."""
TOLERANCE_MM = 0.2
"""A bubble within it has the height asked for."""
_CHANGED_MM = 1e-3
"""A bubble whose size changes by more takes part in a step."""
_SCREEN = Resolution(increments=8, move_mm=1.0, halvings=6)  # While many orders are only compared.
_LIKELY, _BRANCHES, _TWOS, _THREES = 3, 60, 160, 200
"""Orders tried at most: before the way in which the sizes were found; for new branches; of two groups; of three."""
_MORE = 240
"""Orders of more groups that are tried, each a change of the best so far."""
_CORRECTED = 8
"""Branches, of those found, whose sizes are sought."""
_UNSURE = 6
"""Paths that end as asked, but not surely, after which no surer one is sought."""
_IMPROVED = 4
"""Starts, of those that end nearest, from which least squares go on."""
_LIFTED_MM = 0.3
"""Branches differ where another bubble is further off the base."""

Progress = Callable[[int, float], None]
"""Called with the number of paths followed so far and the largest error (mm) of the best of them."""


def plan(
    heights_mm: Heights,
    layout: Layout,
    *,
    balloon: YeohBalloon | Sequence[YeohBalloon] | None = None,
    contact: CompliantContact | None = None,
    start: Shape | None = None,
    limit_mm: float = LIMIT_MM,
    tolerance_mm: float = TOLERANCE_MM,
    progress: Progress | None = None,
) -> Plan:
    """Find steps that take the array from `start` (flat without one) to `heights_mm`, surely and in few steps.

    `heights_mm` is what `Skin.show` takes. `contact` is the model, by default the preset with `balloon`; its `doubt` says
    how well the springs are known, which decides what is sure. No bubble gets larger than `limit_mm` high alone. Heights
    below the rest height mean at rest. Where a shape cannot be had, the plan is for the nearest one found, by least
    squares, and names the bubbles that differ.

    Raises `InvalidInput` for heights that are no heights, and for a model of another layout.
    """
    instance("layout", layout, Layout, "a Layout, such as skin.layout or Layout.hexagon()")
    model = _model_of(layout, balloon, contact)
    positive("limit_mm", number("limit_mm", limit_mm), "mm")
    positive("tolerance_mm", number("tolerance_mm", tolerance_mm), "mm")
    rest = np.array([1e3 * balloon.rest_height for balloon in model.balloons])
    asked = np.maximum(sample(heights_mm, layout, 2 * limit_mm), rest)
    if start is not None and len(start) != len(layout):
        raise InvalidInput(f"The shape to start from has {len(start)} bubbles, the layout {len(layout)}.")
    return _Search(_Task(model, asked, start, limit_mm, tolerance_mm), progress).best()


@dataclass(frozen=True, eq=False)
class _Task:
    """What is asked: a shape of `model` from `start` on."""

    model: CompliantContact
    asked: Array
    """mm, (n,)."""
    start: Shape | None
    limit_mm: float
    tolerance_mm: float

    @cached_property
    def rest(self) -> Array:
        """Sizes without pressure, mm, (n,)."""
        return np.asarray(2e3 * self.model.bubbles["outer"])

    @cached_property
    def begin(self) -> Array:
        """Sizes at the start, mm, (n,)."""
        return self.rest if self.start is None else self.start.size_mm

    @cached_property
    def highest(self) -> Array:
        """Largest sizes allowed, mm, (n,)."""
        return np.maximum(self.rest, self.limit_mm)

    @cached_property
    def guess(self) -> Array:
        """Sizes that would do if no bubble touched another, mm, (n,)."""
        return np.minimum(self.asked, self.highest)

    def error(self, shape: Shape) -> float:
        """Largest distance of a height of `shape` from what was asked, mm."""
        return float(np.abs(shape.height_mm - self.asked).max())

    def wrong(self, shape: Shape) -> list[int]:
        """The bubbles of `shape` that do not have the height asked for."""
        return np.flatnonzero(np.abs(shape.height_mm - self.asked) > self.tolerance_mm).tolist()


@dataclass(eq=False)
class _Best:
    """The best path so far: one that ends as asked before all others, a sure one before the others, then the nearest."""

    path: Array
    rank: tuple[bool, bool, float] = (True, True, np.inf)
    """Not as asked, not sure, sum of squares (mm²)."""
    error: float = np.inf
    """Largest distance from what was asked, mm."""
    unsure: int = 0
    """Paths that ended as asked and were not sure."""


class _Search:
    """One search: the best path so far, and how many were followed.

    A path is the sizes of its steps, (k, n) mm. As soon as a shape with the heights asked for is known, however it was come
    by, it is the `target`: which path ends there is then a matter of orders alone.
    """

    def __init__(self, task: _Task, progress: Progress | None) -> None:
        self._task, self._model, self._progress = task, task.model, progress
        self._tried = 0
        self._best = _Best(task.begin[None])
        self._target: Shape | None = None

    def best(self) -> Plan:
        """Try paths from the simplest on, and make a plan of the first good one."""
        task = self._task
        if task.start is not None and task.error(task.start) <= GOAL_MM:
            return self._plan()
        for path in self._paths():
            self._try(path)
            if not self._best.rank[1] or self._best.unsure >= _UNSURE:
                break
        if self._best.rank[0]:
            self._find_nearest()
        return self._plan()

    def _paths(self) -> Iterator[Array]:
        task = self._task
        together = self._follow(task.guess[None])
        yield self._corrected(together).size_mm[None]
        yield from self._branches(together)
        if self._target is not None:
            yield from self._orders(self._target)
        if self._target is not None and self._best.rank[0]:
            yield from self._more_groups(self._target)

    def _branches(self, together: Shape) -> Iterator[Array]:
        """Until the target is known: correct from the end of each order that ends on a new branch."""
        task = self._task
        seen = {tuple(together.lifted_mm > _LIFTED_MM)}
        orders = two_groups(together, task.guess, self._model.layout.neighbours, task.wrong(together))
        for order in islice(orders, _BRANCHES):
            if self._target is not None or len(seen) > _CORRECTED:
                return
            end = self._follow(steps_of(order, task.guess, task.begin), _SCREEN)
            branch = tuple(end.lifted_mm > _LIFTED_MM)
            if branch not in seen:
                seen.add(branch)
                yield steps_of(order, self._corrected(end).size_mm, task.begin)

    def _orders(self, target: Shape) -> Iterator[Array]:
        """Ways to the sizes of `target`: who hangs on whom, two groups, from flat, three groups."""
        task, sizes = self._task, target.size_mm
        yield steps_of(layers(target), sizes, task.begin)
        wrong = task.wrong(self._follow(sizes[None]))
        twos: list[Order] = []
        for order in islice(two_groups(target, sizes, self._model.layout.neighbours, wrong), _TWOS):
            twos.append(order)
            yield steps_of(order, sizes, task.begin)
            if len(twos) == _LIKELY:  # Beyond the orders that one would expect: the way it was found.
                yield np.array([task.guess, sizes])
        if task.start is not None:
            everyone = tuple(range(len(sizes)))
            for order in [(everyone,), *twos]:  # Down first, then as from flat.
                yield np.vstack([task.rest, steps_of(order, sizes, task.rest)])
        for order in islice(three_groups(twos, wrong), _THREES):
            yield steps_of(order, sizes, task.begin)

    def _more_groups(self, target: Shape) -> Iterator[Array]:
        """Orders of as many groups as it takes: from who hangs on whom on, always the change that ends nearest."""
        sizes, count = target.size_mm, 0
        order = one_by_one(layers(target), target.height_mm)
        found = self._off(order, sizes)
        yield steps_of(order, sizes, self._task.begin)
        while count < _MORE:
            wrong = found[1]
            for changed in variants(order, wrong):
                count += 1
                off = self._off(changed, sizes)
                if off[0] < found[0] - 1e-3:
                    order, found = changed, off
                    yield steps_of(order, sizes, self._task.begin)
                    break
                if count >= _MORE:
                    return
            else:
                return

    def _off(self, order: Order, sizes: Array) -> tuple[float, list[int]]:
        """How far `order` ends from what was asked: sum of squares (mm²), and who is wrong."""
        end = self._follow(steps_of(order, sizes, self._task.begin), _SCREEN)
        return misfit(end, self._task.asked), self._task.wrong(end)

    def _find_nearest(self) -> None:
        """Least squares over sizes, all together or in the order of the best path so far."""
        task, found = self._task, self._best.path
        moved = np.array([(np.abs(found[: k + 1] - task.begin) > _CHANGED_MM).any(axis=0) for k in range(len(found))])
        for turns in (np.ones((1, len(task.begin)), bool), moved)[: min(len(found), 2)]:

            def way(sizes: Array, turns: NDArray[np.bool_] = turns) -> Array:
                return np.vstack([np.where(turns[:-1], sizes, task.begin), sizes])

            def off(sizes: Array, way: Callable[[Array], Array] = way) -> float:
                return misfit(self._try(way(sizes)), task.asked)

            begins = [*nearest.starts(self._model, off, task.asked, task.highest), found[-1]]
            ends = [(off(sizes), place) for place, sizes in enumerate(begins)]
            for _, place in sorted(ends)[:_IMPROVED]:
                better = nearest.improve(
                    self._model, lambda sizes: self._follow(way(sizes)), begins[place], task.asked, task.highest
                )
                self._try(way(better))

    def _follow(self, path: Array, resolution: Resolution = FINE) -> Shape:
        self._tried += 1
        if self._progress:
            self._progress(self._tried, self._best.error)
        return self._model.settle_sizes(path, self._task.start, resolution=resolution)

    def _corrected(self, shape: Shape) -> Shape:
        found = correct(self._model, shape, self._task.asked, self._task.highest)
        if self._target is None and self._task.error(found) <= self._task.tolerance_mm:
            self._target = found
        return found

    def _try(self, path: Array) -> Shape:
        """Follow `path`; keep it if it is better than any before."""
        task, best = self._task, self._best
        shape = self._follow(path)
        if not shape.converged:
            return shape
        error = task.error(shape)
        missed, unsure = error > task.tolerance_mm, True
        if not missed:
            unsure = not robust.is_sure(self._model, path, task.start, shape, task.limit_mm)
            best.unsure += unsure
        rank = missed, unsure, misfit(shape, task.asked) if missed else 0.0
        if rank < best.rank:
            best.path, best.rank, best.error = path, rank, error
        return shape

    def _plan(self) -> Plan:
        task, model, path = self._task, self._model, self._best.path
        end = model.settle_sizes(path, task.start)
        steps = tuple(step for step in self._steps() if step.bubbles)
        found = robust.interval(model, path, task.start, end, task.limit_mm)
        return Plan(
            layout=model.layout,
            asked_mm=task.asked,
            steps=steps,
            predicted_mm=end.height_mm,
            low_mm=found.low_mm,
            high_mm=found.high_mm,
            order=tuple(step.bubbles for step in steps),
            unreachable=tuple(task.wrong(end)),
            shape=end,
            limit_mm=task.limit_mm,
            sure=found.sure,
            tried=self._tried,
        )

    def _steps(self) -> Iterator[PlanStep]:
        """The steps of the best path, each followed from the end of the one before."""
        shape, before = self._task.start, self._task.begin
        for sizes in self._best.path:
            shape = self._model.settle_sizes(sizes, shape)
            changed = tuple(np.flatnonzero(np.abs(sizes - before) > _CHANGED_MM).tolist())
            resting = sizes < self._task.rest + _CHANGED_MM
            yield PlanStep(changed, shape.pressure, np.where(resting, 0.0, sizes), shape.height_mm)
            before = sizes


def _model_of(
    layout: Layout, balloon: YeohBalloon | Sequence[YeohBalloon] | None, contact: CompliantContact | None
) -> CompliantContact:
    if contact is None:
        return CompliantContact(layout, balloon)
    if contact.layout != layout:
        raise InvalidInput(f"The contact model is of another layout ({len(contact)} bubbles): make one of this layout.")
    if balloon is not None and balloons_of(balloon, layout) != contact.balloons:
        raise InvalidInput("The contact model has other balloons than those given: give one of the two.")
    return contact
