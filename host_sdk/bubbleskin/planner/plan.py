"""A plan: its steps, what comes of them, the sequence that plays it, and its reasons in sentences."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bubbleskin.contact.shape import Shape
from bubbleskin.layout import Layout
from bubbleskin.pictured import Pictured
from bubbleskin.planner.orders import Order
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.steps import Settled, Step

Array = NDArray[np.float64]

_LIFTED_MM = 0.2
"""Less than that is not worth a sentence."""
_NAMED = 4
"""So many lifted bubbles get a sentence each."""


@dataclass(frozen=True, eq=False)
class PlanStep:
    """One step of a plan: all bubbles go to their sizes together, and settle."""

    bubbles: tuple[int, ...]
    """Those that change."""
    pressure: Array
    """What the bubbles hold after it, neighbours' push included: gauge, Pa, (n,)."""
    target_mm: Array
    """What to send: the height that each bubble would have alone with this size, (n,); 0 at rest.

    A device holds sizes and knows nothing of neighbours; a bubble that they lift is higher than its target.
    """
    predicted_mm: Array
    """True heights after it, (n,)."""


@dataclass(frozen=True, eq=False)
class Plan(Pictured):
    """How to get a shape, and what comes of it."""

    layout: Layout
    asked_mm: Array
    """(n,); a height below a bubble's rest height means at rest."""
    steps: tuple[PlanStep, ...]
    predicted_mm: Array
    """Heights at the end, (n,)."""
    low_mm: Array
    high_mm: Array
    """Between which heights each bubble ends on a wristband whose springs, sizes and ways are not known exactly, (n,) each."""
    order: Order
    """The bubbles that change, group by group."""
    unreachable: tuple[int, ...]
    """Bubbles that end further than the tolerance from what was asked; `predicted_mm` is then the nearest found."""
    shape: Shape
    """The end, with contacts and snaps."""
    limit_mm: float
    sure: bool
    """Whether it ends in this shape too where springs, sizes and ways are off as they may be. If not, chance has a say."""
    tried: int
    """Paths followed to find it."""

    def __repr__(self) -> str:
        end = f"{self.layout.names(self.unreachable)} out of reach" if self.unreachable else "all within reach"
        return f"<Plan for {len(self.layout)} bubbles: {len(self.steps)} steps, {end}, off by {self.error_mm:.2f} mm>"

    @property
    def error_mm(self) -> float:
        """Largest distance of a height from what was asked."""
        return float(np.abs(self.predicted_mm - self.asked_mm).max())

    @property
    def rms_mm(self) -> float:
        """Root mean square of the distances from what was asked: what is least for a shape that cannot be had."""
        return float(np.sqrt(((self.predicted_mm - self.asked_mm) ** 2).mean()))

    @property
    def sequence(self) -> Sequence:
        """The plan as a `bubbleskin.Sequence`, each step held until it has settled."""
        return self.to_sequence()

    def to_sequence(self, ramp: float = 1.0, tolerance_mm: float = 0.2, timeout_s: float = 3.0) -> Sequence:
        """As `sequence`: each step ramps for `ramp` seconds and goes on when settled, or after `timeout_s`.

        A slow ramp keeps to the plan: what it predicts is bubbles in equilibrium all the way.
        """
        until = Settled(tolerance_mm=tolerance_mm, timeout_s=timeout_s)
        count = len(self.steps)
        steps = [
            Step(step.target_mm.tolist(), ramp=ramp, until=until, name=f"step {number} of {count}")
            for number, step in enumerate(self.steps, 1)
        ]
        return Sequence(steps, name="plan", layout=self.layout)

    def explain(self) -> str:
        """The plan in sentences, one to a line: who goes when and why, what was corrected, what cannot be had."""
        if not self.steps:
            return "The array has this shape already: nothing to do."
        lines = [*_steps(self), *_reasons(self), *_corrections(self), *_snaps(self), *_misses(self)]
        lines.append(_doubt(self))
        return "\n".join(lines)


def _who(plan: Plan, bubbles: Items[int]) -> str:
    if len(bubbles) == len(plan.layout):
        return "all bubbles"
    return plan.layout.names(bubbles)


def _steps(plan: Plan) -> list[str]:
    count = len(plan.steps)
    if count == 1:
        return [f"One step: {_who(plan, plan.steps[0].bubbles)} can go together."]
    lines = [f"{count} steps."]
    done: set[int] = set()
    for number, step in enumerate(plan.steps, 1):
        down = [i for i in step.bubbles if step.target_mm[i] == 0]
        new = [i for i in step.bubbles if i not in done and i not in down]
        again = [i for i in step.bubbles if i in done and i not in down]
        done.update(new)
        first = " first" if number == 1 else ""
        parts = [
            f"{_who(plan, bubbles)} {many if len(bubbles) > 1 else one}"
            for bubbles, one, many in (
                (down, "lets its air go", "let their air go"),
                (new, f"goes{first}", f"go{first}"),
                (again, "is corrected", "are corrected"),
            )
            if bubbles
        ]
        lines.append(f"{number}. " + ", ".join(parts).capitalize() + ".")
    return lines


def _reasons(plan: Plan) -> list[str]:
    if not plan.shape.contacts:
        return ["No two bubbles touch at the end."]
    lifted_mm = plan.shape.lifted_mm
    lifted = [i for i in np.argsort(-lifted_mm).tolist() if lifted_mm[i] > _LIFTED_MM]
    turn = {i: k for k, group in reversed([*enumerate(plan.order)]) for i in group}
    lines = [_why_lifted(plan, bubble, turn) for bubble in lifted[:_NAMED]]
    if len(lifted) > _NAMED:
        lines.append(f"So are {plan.layout.names(lifted[_NAMED:])}.")
    return lines


def _why_lifted(plan: Plan, bubble: int, turn: dict[int, int]) -> str:
    """Who lifts `bubble` by how much, and who must therefore go later; `turn` is the step in which each first goes."""
    pushing = _lifters(plan.shape, bubble)
    later = [other for other in pushing if turn.get(other, 0) > turn.get(bubble, 0)]
    because = f", which is why {plan.layout.names(later)} must go later" if later else ""
    alone = max(plan.steps[-1].target_mm[bubble], 5)
    return (
        f"Bubble {bubble} ends {plan.predicted_mm[bubble]:.1f} mm high, alone it would be {alone:.1f} mm: "
        f"{plan.layout.names(pushing)} {'lift' if len(pushing) > 1 else 'lifts'} it "
        f"{plan.shape.lifted_mm[bubble]:.1f} mm off the base{because}."
    )


def _lifters(shape: Shape, bubble: int) -> list[int]:
    """The bubbles that touch `bubble` and have their centre below its own."""
    touching = [
        contact.second if contact.first == bubble else contact.first
        for contact in shape.contacts
        if bubble in (contact.first, contact.second)
    ]
    return [other for other in touching if shape.position[other, 2] < shape.position[bubble, 2]]


def _corrections(plan: Plan) -> list[str]:
    held = plan.steps[-1].target_mm
    less = np.flatnonzero((plan.shape.lifted_mm > _LIFTED_MM) & (plan.asked_mm - held > _LIFTED_MM))
    if not less.size:
        return []
    most = int(less[np.argmax((plan.asked_mm - held)[less])])
    return [
        f"Less is sent for {plan.layout.names(less.tolist())} than asked, since neighbours lift: least for bubble {most}, "
        f"{held[most]:.2f} mm instead of {plan.asked_mm[most]:.2f} mm."
    ]


def _doubt(plan: Plan) -> str:
    wide = np.maximum(plan.high_mm - plan.predicted_mm, plan.predicted_mm - plan.low_mm)
    most = int(np.argmax(wide))
    where = f"bubble {most} between {plan.low_mm[most]:.1f} and {plan.high_mm[most]:.1f} mm"
    if plan.sure:
        return f"Sure: with springs, sizes and ways off as they may be it ends in this shape, at the most uncertain {where}."
    return (
        f"Chance has a say: with springs, sizes or ways a little off it can end in another shape, {where}. "
        "It is played with anyway=True; go slowly, and measure the shape before you rely on it."
    )


def _snaps(plan: Plan) -> list[str]:
    return [
        f"On the way {plan.layout.names(snap.bubbles)} {'snap' if len(snap.bubbles) > 1 else 'snaps'} in step "
        f"{snap.step + 1}, by up to {np.abs(snap.after_mm - snap.before_mm).max():.1f} mm."
        for snap in plan.shape.snaps
    ]


def _misses(plan: Plan) -> list[str]:
    off = np.abs(plan.predicted_mm - plan.asked_mm)
    furthest = sorted(plan.unreachable, key=lambda i: -off[i])
    lines = [_why_missed(plan, bubble) for bubble in furthest[:_NAMED]]
    if len(furthest) > _NAMED:
        lines.append(
            f"Nor can {plan.layout.names(sorted(furthest[_NAMED:]))} be as asked. This is the nearest shape that was "
            f"found: {plan.rms_mm:.2f} mm RMS, {plan.error_mm:.2f} mm at most."
        )
    return lines


def _why_missed(plan: Plan, i: int) -> str:
    sent = plan.steps[-1].target_mm[i] if plan.steps else plan.shape.size_mm[i]
    if sent == 0:
        why = "it has no air left to let go, its neighbours hold it up"
    elif sent > plan.limit_mm - 0.01:
        why = f"it has all the air it may have, {plan.limit_mm:g} mm alone"
    else:
        why = "in no order that was tried do its neighbours let it"
    return f"Bubble {i} cannot be {plan.asked_mm[i]:.1f} mm high: the nearest is {plan.predicted_mm[i]:.1f} mm; {why}."
