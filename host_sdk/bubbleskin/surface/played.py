"""A sequence before it is played: followed as the bubbles will go, and cut where neighbours would lift one past the limit.

What a sequence says is sent as it is, heights of each bubble by itself; so only what it would come to is looked at here.
"""

from collections.abc import Iterator
from collections.abc import Sequence as Items
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.steps import Repeat, Step
from bubbleskin.surface.kept import KeptShape
from bubbleskin.surface.limits import Limits

if TYPE_CHECKING:
    from bubbleskin.contact.held import HeldShape

Array = NDArray[np.float64]

FOLLOWED = 5000
"""Steps that are followed at most; a sequence without end has come back to its beginning long before."""
_TIMES = 2
"""Times that all of it is followed: the second begins where the first ended."""
MANY = 200
"""Of more steps only the likeliest wristband is followed."""
OTHERS = (2, 4)
"""Those of the others in which bubbles are lifted most: softer necks."""
_FINEST_MM = 0.1


def steps_of(sequence: Sequence) -> list[Array]:
    """The heights alone that it asks for, (n,) mm each, in the order in which they are played; 0 where none was asked yet."""
    now = np.zeros(sequence.bubbles)
    found = []
    for index in islice(sequence.unrolled(), min(FOLLOWED, _TIMES * _length(sequence.steps))):
        targets = sequence.each[index].targets_mm
        if targets is not None:
            now = np.array([old if new is None else new for old, new in zip(now, targets, strict=True)])
        found.append(now)
    return found


def highest_cut(sequence: Sequence, kept: KeptShape, limits: Limits) -> float | None:
    """The height in mm at which targets have to be cut so that no lifted top passes the limit; None: they may stay."""
    steps = steps_of(sequence)
    tallest = max(float(step.max()) for step in steps)
    if kept.gaps.apart(np.max(steps, axis=0)) or _stays_below(steps, np.inf, kept, limits):
        return None
    low, high = float(kept.gaps.free_mm.min()), tallest
    while high - low > _FINEST_MM:
        middle = (low + high) / 2
        low, high = (middle, high) if _stays_below(steps, middle, kept, limits) else (low, middle)
    return round(low, 1)


def cut(sequence: Sequence, height_mm: float) -> Sequence:
    """The same with no target above `height_mm`."""

    def lower(parts: Items[Step | Repeat]) -> list[Step | Repeat]:
        return [
            replace(part, targets_mm=_cut(part.targets_mm, height_mm))
            if isinstance(part, Step)
            else replace(part, steps=lower(part.steps))
            for part in parts
        ]

    return Sequence(
        lower(sequence.steps), loops=sequence.loops, name=sequence.name, board=sequence.board, layout=sequence.layout
    )


def _cut(targets: Any, height_mm: float) -> list[float | None] | None:
    return None if targets is None else [None if one is None else min(one, height_mm) for one in targets]


def _stays_below(steps: list[Array], height_mm: float, kept: KeptShape, limits: Limits) -> bool:
    members = list(_followed(kept, len(steps)))
    return all(limits.keeps(members, limits.clip(np.minimum(step, height_mm))) for step in steps)


def _followed(kept: KeptShape, steps: int) -> "Iterator[HeldShape]":
    members = kept.begun()
    yield members[0]
    if steps <= MANY:
        yield from (members[number] for number in OTHERS)


def _length(parts: Items[Step | Repeat]) -> int:
    """Steps of one time through, repeats without end taken twice."""
    return sum(1 if isinstance(part, Step) else (part.times or _TIMES) * _length(part.steps) for part in parts)
