"""The planner: which bubbles go first, and to which pressures, so that the array settles in the shape asked for."""

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
from bubbleskin.planner.inverse import GOAL_MM, correct
from bubbleskin.planner.orders import Order, steps_of, three_groups, two_groups
from bubbleskin.planner.plan import Plan, PlanStep
from bubbleskin.shape.heightfield import Heights, sample

Array = NDArray[np.float64]

LIMIT_MM = 14.0
"""Highest a bubble may be alone: the boards' own limit."""
TOLERANCE_MM = 0.2
"""A bubble within it has the height asked for."""
_CHANGED_PA = 1.0
"""A bubble whose pressure changes by more takes part in a step."""
_SCREEN = Resolution(increments=8, move_mm=1.0, halvings=6)  # While many orders are only compared.
_LIKELY, _BRANCHES, _TWOS, _THREES = 3, 60, 160, 200
"""Orders tried at most: before the way in which the pressures were found; for new branches; of two groups; of three."""
_CORRECTED = 8
"""Branches, of those found, whose pressures are sought."""
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
    """Find steps that take the array from `start` (flat without one) to `heights_mm`, in as few as can be found.

    `heights_mm` is what `Skin.show` takes. `contact` is the model, by default the preset with `balloon`. No bubble
    gets more pressure than makes it `limit_mm` high alone. Heights below the rest height mean at rest. Where a shape
    cannot be had, the plan is for the nearest one found and names the bubbles that differ.

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
    def begin(self) -> Array:
        """Pressures at the start, Pa, (n,)."""
        return np.zeros(len(self.asked)) if self.start is None else self.start.pressure

    @cached_property
    def highest(self) -> Array:
        """Highest pressures allowed, Pa, (n,)."""
        return self.model.free_pressure(self.limit_mm)

    @cached_property
    def guess(self) -> Array:
        """Pressures that would do if no bubble touched another, Pa, (n,)."""
        return np.minimum(self.model.free_pressure(self.asked), self.highest)

    def error(self, shape: Shape) -> float:
        """Largest distance of a height of `shape` from what was asked, mm."""
        return float(np.abs(shape.height_mm - self.asked).max())

    def wrong(self, shape: Shape) -> list[int]:
        """The bubbles of `shape` that do not have the height asked for."""
        return np.flatnonzero(np.abs(shape.height_mm - self.asked) > self.tolerance_mm).tolist()


class _Search:
    """One search: the best path so far, and how many were followed.

    A path is the pressures of its steps, (k, n) Pa. As soon as a shape with the heights asked for is known, however it
    was come by, it is the `target`: which path ends there is then a matter of orders alone.
    """

    def __init__(self, task: _Task, progress: Progress | None) -> None:
        self._task, self._model, self._progress = task, task.model, progress
        self._tried = 0
        self._error = np.inf
        self._best: Array = task.begin[None]
        self._target: Shape | None = None

    def best(self) -> Plan:
        """Try paths from the simplest on, and make a plan of the first good one."""
        for path in self._paths():
            if self._try(path):
                break
        return self._plan()

    def _paths(self) -> Iterator[Array]:
        task = self._task
        if task.start is not None and task.error(task.start) <= GOAL_MM:
            yield task.begin[None]
        together = self._follow(task.guess[None])
        yield self._corrected(together).pressure[None]
        yield from self._branches(together)
        if self._target is not None:
            yield from self._orders(self._target)

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
                yield steps_of(order, self._corrected(end).pressure, task.begin)

    def _orders(self, target: Shape) -> Iterator[Array]:
        """Ways to the pressures of `target`: in two groups, from flat, in three groups."""
        task = self._task
        wrong = task.wrong(self._follow(target.pressure[None]))
        twos: list[Order] = []
        for order in islice(two_groups(target, target.pressure, self._model.layout.neighbours, wrong), _TWOS):
            twos.append(order)
            yield steps_of(order, target.pressure, task.begin)
            if len(twos) == _LIKELY:  # Beyond the orders that one would expect: the way it was found.
                yield np.array([task.guess, target.pressure])
        if task.start is not None:
            flat = np.zeros_like(task.begin)
            everyone = tuple(range(len(flat)))
            for order in [(everyone,), *twos]:  # Down first, then as from flat.
                yield np.vstack([flat, steps_of(order, target.pressure, flat)])
        for order in islice(three_groups(twos, wrong), _THREES):
            yield steps_of(order, target.pressure, task.begin)

    def _follow(self, path: Array, resolution: Resolution = FINE) -> Shape:
        self._tried += 1
        if self._progress:
            self._progress(self._tried, self._error)
        return self._model.settle(path, self._task.start, ramp="height", resolution=resolution)

    def _corrected(self, shape: Shape) -> Shape:
        found = correct(self._model, shape, self._task.asked, self._task.highest)
        if self._target is None and self._task.error(found) <= self._task.tolerance_mm:
            self._target = found
        return found

    def _try(self, path: Array) -> bool:
        """Follow `path`; keep it if it ends nearer than any before. True if it ends where asked."""
        shape = self._follow(path)
        error = self._task.error(shape) if shape.converged else np.inf
        if error < self._error:
            self._error, self._best = error, path
        return error <= self._task.tolerance_mm

    def _plan(self) -> Plan:
        task, model = self._task, self._model
        end = model.settle(self._best, task.start, ramp="height")
        steps = tuple(step for step in self._steps() if step.bubbles)
        return Plan(
            layout=model.layout,
            asked_mm=task.asked,
            steps=steps,
            predicted_mm=end.height_mm,
            order=tuple(step.bubbles for step in steps),
            unreachable=tuple(task.wrong(end)),
            shape=end,
            limit_mm=task.limit_mm,
            sure=self._is_sure(end),
            tried=self._tried,
        )

    def _steps(self) -> Iterator[PlanStep]:
        """The steps of the best path, each followed from the end of the one before."""
        shape, before = self._task.start, self._task.begin
        for pressure in self._best:
            shape = self._model.settle([pressure], shape, ramp="height")
            changed = tuple(np.flatnonzero(np.abs(pressure - before) > _CHANGED_PA).tolist())
            alone = 2e3 * self._model.free_radius(pressure, shape.radius)
            yield PlanStep(changed, pressure, np.where(pressure > 0, alone, 0.0), shape.height_mm)
            before = pressure

    def _is_sure(self, end: Shape) -> bool:
        """Whether the best path ends as in `end` with other nudges too, its pressures going either way."""
        other = self._model.with_seed(self._model.seed ^ 1)
        ends = (other.settle(self._best, self._task.start, ramp=ramp) for ramp in ("height", "pressure"))
        return all(np.abs(shape.height_mm - end.height_mm).max() < self._task.tolerance_mm for shape in ends)


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
