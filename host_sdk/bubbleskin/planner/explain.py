"""A plan in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from bubbleskin.planner.search import Plan

_LIFTED_MM = 0.2  # less is not worth a sentence
_CHANGED_PA = 300.0  # neither is this


def explain(plan: Plan) -> str:
    """What `plan` does, why in that order, and what it cannot do: sentences, one to a line."""
    if not plan.steps:
        return "The array has this shape already: nothing to do."
    lines = [*_steps(plan), *_reasons(plan), *_corrections(plan), *_snaps(plan), *_misses(plan)]
    if not plan.sure:
        lines.append(
            "Chance has a say: another nudge on the way, or pressures that go straight, end in another shape. "
            "Go slowly, and measure the shape before you rely on it."
        )
    return "\n".join(lines)


def _who(plan: Plan, bubbles: Sequence[int]) -> str:
    if len(bubbles) == len(plan.layout):
        return "all bubbles"
    return plan.layout.names(bubbles)


def _steps(plan: Plan) -> list[str]:
    count = len(plan.steps)
    if count == 1:
        return [f"One step: {_who(plan, plan.steps[0].bubbles)} can go together."]
    lines = [f"{count} steps."]
    done: set[int] = set()
    for k, step in enumerate(plan.steps):
        down = [i for i in step.bubbles if step.pressure[i] == 0]
        new = [i for i in step.bubbles if i not in done and i not in down]
        again = [i for i in step.bubbles if i in done and i not in down]
        done.update(new)
        parts = []
        if down:
            parts.append(
                f"{_who(plan, down)} let their air go" if len(down) > 1 else f"{_who(plan, down)} lets its air go"
            )
        if new:
            parts.append(f"{_who(plan, new)} {'go' if len(new) > 1 else 'goes'}{' first' if not k else ''}")
        if again:
            parts.append(f"{_who(plan, again)} {'are' if len(again) > 1 else 'is'} corrected")
        lines.append(f"{k + 1}. " + ", ".join(parts).capitalize() + ".")
    return lines


def _reasons(plan: Plan) -> list[str]:
    lifted = [i for i in np.argsort(-plan.shape.lifted_mm).tolist() if plan.shape.lifted_mm[i] > _LIFTED_MM]
    lines = []
    when = {i: k for k, group in reversed([*enumerate(plan.order)]) for i in group}
    for i in lifted[:4]:
        pushing = [
            c.second if c.first == i else c.first
            for c in plan.shape.contacts
            if i in (c.first, c.second) and _below(plan, i, c.second if c.first == i else c.first)
        ]
        later = [j for j in pushing if when.get(j, 0) > when.get(i, 0)]
        because = f", which is why {plan.layout.names(later)} must go later" if later else ""
        alone = plan.steps[-1].target_mm[i]
        lines.append(
            f"Bubble {i} ends {plan.predicted_mm[i]:.1f} mm high, alone it would be {max(alone, 5):.1f} mm: "
            f"{plan.layout.names(pushing)} {'lift' if len(pushing) > 1 else 'lifts'} it {plan.shape.lifted_mm[i]:.1f} mm "
            f"off the base{because}."
        )
    if len(lifted) > 4:
        lines.append(f"So are {plan.layout.names(lifted[4:])}.")
    if not plan.shape.contacts:
        lines.append("No two bubbles touch at the end.")
    return lines


def _below(plan: Plan, i: int, j: int) -> bool:
    return bool(plan.shape.position[j, 2] < plan.shape.position[i, 2])


def _corrections(plan: Plan) -> list[str]:
    off = plan.steps[-1].target_mm - plan.asked_mm
    standing = (plan.shape.lifted_mm <= _LIFTED_MM) & (plan.shape.pressure > 0)
    squeezed = np.flatnonzero(standing & (off > 0.1))
    if not squeezed.size:
        return []
    most = int(squeezed[np.argmax(off[squeezed])])
    return [
        f"Neighbours squeeze {plan.layout.names(squeezed.tolist())}, so more pressure than alone is needed, most for "
        f"bubble {most}: {plan.shape.pressure[most] / 1e3:.2f} kPa, which alone would make it "
        f"{plan.steps[-1].target_mm[most]:.2f} mm high instead of {plan.asked_mm[most]:.2f} mm."
    ]


def _snaps(plan: Plan) -> list[str]:
    return [
        f"On the way {plan.layout.names(snap.bubbles)} {'snap' if len(snap.bubbles) > 1 else 'snaps'} in step "
        f"{snap.step + 1}, by up to {np.abs(snap.after_mm - snap.before_mm).max():.1f} mm."
        for snap in plan.shape.snaps
    ]


def _misses(plan: Plan) -> list[str]:
    lines = []
    for i in plan.unreachable:
        if plan.shape.pressure[i] == 0:
            why = "it has no pressure left to let go, its neighbours hold it up"
        elif plan.steps[-1].target_mm[i] > plan.limit_mm - 0.01:
            why = f"it has all the pressure it may have, {plan.limit_mm:g} mm alone"
        else:
            why = "in no order that was tried do its neighbours let it"
        lines.append(
            f"Bubble {i} cannot be {plan.asked_mm[i]:.1f} mm high: the nearest is {plan.predicted_mm[i]:.1f} mm; {why}."
        )
    return lines
