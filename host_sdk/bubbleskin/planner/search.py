"""The planner: which bubbles go first, and to which pressures, so that the array settles in the shape asked for."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.checks import number, positive
from bubbleskin.contact.model import CompliantContact, Shape, balloons_of
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon
from bubbleskin.planner.explain import explain
from bubbleskin.planner.inverse import GOAL_MM, Order, correct, pairs, steps_of, triples
from bubbleskin.shape.heightfield import Heights, sample

Array = NDArray[np.float64]

LIMIT_MM = 14.0
"""Highest a bubble may be alone: the boards' own limit."""
TOLERANCE_MM = 0.2
"""A bubble within it has the height asked for."""
_SCREEN: dict[str, Any] = {"increments": 8, "move_mm": 1.0, "halvings": 6}  # while many orders are tried
_FIRST, _BRANCHES, _TWOS, _THREES = 3, 60, 160, 200  # orders tried at most
_CORRECTED = 8  # of those, branches whose pressures are sought
_LIFTED_MM = 0.3


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a plan: all bubbles go to their pressures together, and settle."""

    bubbles: tuple[int, ...]
    """Those that change."""
    pressure: Array
    """Gauge, Pa, (n,)."""
    target_mm: Array
    """What to send: the height that each bubble would have alone at this pressure, (n,); 0 without pressure.

    A device knows nothing of neighbours; a bubble that they lift is higher than its target.
    """
    predicted_mm: Array
    """True heights after it, (n,)."""


@dataclass(frozen=True, eq=False)
class Plan:
    """How to get a shape, and what comes of it."""

    layout: Layout
    asked_mm: Array
    """(n,); a height below a bubble's rest height means at rest."""
    steps: tuple[Step, ...]
    predicted_mm: Array
    """Heights at the end, (n,)."""
    order: Order
    """The bubbles that change, group by group."""
    unreachable: tuple[int, ...]
    """Bubbles that end further than the tolerance from what was asked; `predicted_mm` is then the nearest found."""
    shape: Shape
    """The end, with contacts and snaps."""
    limit_mm: float
    sure: bool
    """Whether it ends there with other nudges and with straight pressures too. If not, chance has a say."""
    tried: int
    """Paths followed to find it."""

    @property
    def error_mm(self) -> float:
        """Largest distance of a height from what was asked."""
        return float(np.abs(self.predicted_mm - self.asked_mm).max())

    @property
    def sequence(self) -> Any:
        """The plan as a `bubbleskin.Sequence`, each step held until it has settled."""
        return self.to_sequence()

    def to_sequence(self, ramp: float = 1.0, tolerance_mm: float = 0.2, timeout_s: float = 3.0) -> Any:
        """As `sequence`: each step ramps for `ramp` seconds and goes on when settled, or after `timeout_s`.

        A slow ramp keeps to the plan: what it predicts is bubbles in equilibrium all the way.
        """
        made = import_module("bubbleskin.sequence.model")
        until = made.Settled(tolerance_mm=tolerance_mm, timeout_s=timeout_s)
        steps = [
            made.Step(step.target_mm.tolist(), ramp=ramp, until=until, name=f"step {k + 1} of {len(self.steps)}")
            for k, step in enumerate(self.steps)
        ]
        return made.Sequence(steps, name="plan", layout=self.layout)

    def explain(self) -> str:
        """The plan in sentences: who goes when and why, what was corrected, what cannot be had."""
        return explain(self)


Progress = Callable[[int, float], None]
"""Called with the number of paths followed so far and the best largest error in mm."""


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
    model = _model(layout, balloon, contact)
    positive("limit_mm", number("limit_mm", limit_mm), "mm")
    positive("tolerance_mm", number("tolerance_mm", tolerance_mm), "mm")
    rest = np.array([1e3 * one.rest_height for one in model.balloons])
    asked = np.maximum(sample(heights_mm, layout, 2 * limit_mm), rest)
    if start is not None and len(start) != len(layout):
        raise InvalidInput(f"The shape to start from has {len(start)} bubbles, the layout {len(layout)}.")
    return _Search(model, asked, start, limit_mm, tolerance_mm, progress).best()


class _Search:
    """One search: the best path so far, and how many were followed."""

    def __init__(
        self,
        model: CompliantContact,
        asked: Array,
        start: Shape | None,
        limit_mm: float,
        tolerance_mm: float,
        progress: Progress | None,
    ) -> None:
        self.model, self.asked, self.start, self.progress = model, asked, start, progress
        self.tolerance, self.limit = tolerance_mm, limit_mm
        self.begin = np.zeros(len(asked)) if start is None else start.pressure
        self.highest = model.free_pressure(limit_mm)
        self.guess = np.minimum(model.free_pressure(asked), self.highest)
        self.tried = 0
        self.error = np.inf
        self.steps: Array = self.begin[None]
        self.target: Shape | None = None  # a shape with the heights, however it was come by

    def best(self) -> Plan:
        """Try paths from the simplest on, and make a plan of the first good one."""
        for paths in (self._together(), self._branches(), self._twos(), self._threes()):
            for steps in paths:
                if self._try(steps):
                    return self._plan()
        return self._plan()

    # What is tried. `target` is a shape with the heights asked for, as soon as one is known; which path ends there is
    # then a matter of orders alone.

    def _together(self) -> Iterator[Array]:
        if self.start is not None and np.abs(self.start.height_mm - self.asked).max() <= GOAL_MM:
            yield self.begin[None]
        self.first = self._follow(self.guess[None])
        yield self._corrected(self.first).pressure[None]

    def _branches(self) -> Iterator[Array]:
        """Where no pressures are known that would do: correct from the end of each order that ends on a new branch."""
        seen = {tuple(self.first.lifted_mm > _LIFTED_MM)}
        wrong = np.flatnonzero(np.abs(self.asked - self.first.height_mm) > self.tolerance).tolist()
        for order in islice(pairs(self.first, self.guess, self.model.layout.neighbours, wrong), _BRANCHES):
            if self.target is not None or len(seen) > _CORRECTED:
                return
            end = self._follow(steps_of(order, self.guess, self.begin), **_SCREEN)
            branch = tuple(end.lifted_mm > _LIFTED_MM)
            if branch not in seen:
                seen.add(branch)
                yield steps_of(order, self._corrected(end).pressure, self.begin)

    def _twos(self) -> Iterator[Array]:
        if self.target is None:
            return
        self.pairs: list[Order] = []
        end = self._follow(self.target.pressure[None])
        self.wrong = np.flatnonzero(np.abs(end.height_mm - self.asked) > self.tolerance).tolist()
        orders = pairs(self.target, self.target.pressure, self.model.layout.neighbours, self.wrong)
        for order in islice(orders, _TWOS):
            self.pairs.append(order)
            yield steps_of(order, self.target.pressure, self.begin)
            if len(self.pairs) == _FIRST:  # beyond the order that one would expect: the way it was found
                yield np.array([self.guess, self.target.pressure])

    def _threes(self) -> Iterator[Array]:
        if self.target is None:
            return
        flat = np.zeros_like(self.begin)
        if self.start is not None:
            for order in [(tuple(range(len(flat))),), *self.pairs]:  # down first, then as from flat
                yield np.vstack([flat, steps_of(order, self.target.pressure, flat)])
        for order in islice(triples(self.pairs, self.wrong), _THREES):
            yield steps_of(order, self.target.pressure, self.begin)

    # How.

    def _off(self, shape: Shape) -> float:
        return float(np.abs(shape.height_mm - self.asked).max())

    def _follow(self, steps: Array, **how: Any) -> Shape:
        self.tried += 1
        if self.progress:
            self.progress(self.tried, self.error)
        return self.model.settle(steps, self.start, ramp="height", **how)

    def _corrected(self, shape: Shape) -> Shape:
        found = correct(self.model, shape, self.asked, self.highest)
        if self._off(found) <= self.tolerance and self.target is None:
            self.target = found
        return found

    def _try(self, steps: Array) -> bool:
        """Follow `steps`; keep them if they end nearer than any before. True if they end where asked."""
        shape = self._follow(steps)
        error = self._off(shape) if shape.converged else np.inf
        if error < self.error:
            self.error, self.steps = error, steps
        return error <= self.tolerance

    def _plan(self) -> Plan:
        model = self.model
        shape, made, before = self.start, [], self.begin
        for pressure in self.steps:
            shape = model.settle([pressure], shape, ramp="height")
            changed = tuple(np.flatnonzero(np.abs(pressure - before) > 1.0).tolist())
            alone = 2e3 * model.free_radius(pressure, shape.radius)
            made.append(Step(changed, pressure, np.where(pressure > 0, alone, 0.0), shape.height_mm))
            before = pressure
        final = model.settle(self.steps, self.start, ramp="height")
        steps = tuple(step for step in made if step.bubbles)
        others = [
            CompliantContact(model.layout, model.balloons, **_figures(model), seed=model.seed + 1).settle(
                self.steps, self.start, ramp=ramp
            )
            for ramp in ("height", "pressure")
        ]
        return Plan(
            layout=model.layout,
            asked_mm=self.asked,
            steps=steps,
            predicted_mm=final.height_mm,
            order=tuple(step.bubbles for step in steps),
            unreachable=tuple(np.flatnonzero(np.abs(final.height_mm - self.asked) > self.tolerance).tolist()),
            shape=final,
            limit_mm=self.limit,
            sure=all(np.abs(other.height_mm - final.height_mm).max() < self.tolerance for other in others),
            tried=self.tried,
        )


def _figures(model: CompliantContact) -> dict[str, Any]:
    return {name: getattr(model, name) for name in ("kz", "kxy", "kc", "kbase", "kick", "increments")}


def _model(
    layout: Layout, balloon: YeohBalloon | Sequence[YeohBalloon] | None, contact: CompliantContact | None
) -> CompliantContact:
    if contact is None:
        return CompliantContact(layout, balloon)
    if contact.layout != layout:
        raise InvalidInput(f"The contact model is of another layout ({len(contact)} bubbles): make one of this layout.")
    if balloon is not None and balloons_of(balloon, layout) != contact.balloons:
        raise InvalidInput("The contact model has other balloons than those given: give one of the two.")
    return contact
