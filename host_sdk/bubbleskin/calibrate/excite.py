"""What is played so that every unknown of a bubble shows: which bubbles together, and the heights one after another.

Neighbours that touch would press on each other, so bubbles rise in groups of which no two are neighbours, the others vented.
Each group is stretched once as far as it will be, then goes down by steps, while rubber relaxes upwards, and up again, while it
relaxes downwards. The same heights on both ways tell memory from stiffness and one valve from the other; the time between
tells a leak.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from bubbleskin.layout import Layout

REST_S = 0.6
"""At the beginning, everything vented: zeros."""
GAP_S = 0.5
"""Between two groups, in which the first goes down far enough."""
BEFORE_S = 0.15
"""At rest, of each group: what it starts from."""
STRETCH_MM = (8.0, 10.5, 12.0, 12.6)
STRETCH_S = 0.15
TOP_MM, TOP_S = 13.1, 0.35
# Below 6 mm gas that cools and rubber that relaxes look like a leak or a stuck valve to firmware that nobody has calibrated: not
# lower than 7 mm, where a vent valve may be 10 % off and the air by more, and from rest past that at once.
DOWN_MM = (11.6, 10.2, 8.9, 7.8, 7.0)
DOWN_S = 0.25
EMPTY_S = 0.45
"""Between both ways: its air is known anew."""
LOW_MM, LOW_S = 6.2, 1.0
"""The step that is held longer: where pressure is steep, a leak shows."""
UP_MM = (LOW_MM, 6.7, 7.3, 8.0, 8.8, 9.7, 10.6, 11.5, 12.3, 13.0)
UP_S = 0.20
SLOWER = 1.8
"""By what all this takes longer where a tick is longer than `QUICK_TICK_S`: two readings make one of theirs."""
QUICK_TICK_S = 0.0075
PRESSURE_SHARE = 0.8
"""Of the board's greatest pressure: with more, a bubble goes no higher."""


class Step(NamedTuple):
    """A height asked of all bubbles of a group, for so long."""

    height_mm: float
    seconds: float
    stretching: bool
    """Whether this is the first way up, of rubber as it was made: it is not fitted."""


def steps(tick_s: float) -> Iterator[Step]:
    """The steps of one group."""
    times = 1.0 if tick_s < QUICK_TICK_S else SLOWER
    yield Step(0.0, BEFORE_S, True)
    for height in STRETCH_MM:
        yield Step(height, times * STRETCH_S, True)
    yield Step(TOP_MM, times * TOP_S, True)
    for height in DOWN_MM:
        yield Step(height, times * DOWN_S, False)
    yield Step(0.0, EMPTY_S, False)
    for height in UP_MM:
        yield Step(height, times * (LOW_S if height == LOW_MM else UP_S), False)


def phase(bubbles: int, tick_s: float) -> float:
    """By how much later the last bubble of a group does what the first does, and a bubble more would."""
    return (UP_S if tick_s < QUICK_TICK_S else SLOWER * UP_S) if bubbles > 1 else 0.0


def device_seconds(groups: int, tick_s: float) -> float:
    """How long it takes, vented again at the end."""
    each = sum(step.seconds for step in steps(tick_s))
    return REST_S + groups * (each + phase(2, tick_s) + GAP_S)


def groups(layout: Layout, bubbles: Iterable[int]) -> list[list[int]]:
    """`bubbles` in groups of which no two are neighbours: those with most neighbours choose first."""
    near = [set(pair) for pair in layout.neighbours]
    wanted = sorted(set(bubbles), key=lambda bubble: (-len(near[bubble]), bubble))
    found: list[list[int]] = []
    for bubble in wanted:
        for group in found:
            if not near[bubble] & set(group):
                group.append(bubble)
                break
        else:
            found.append([bubble])
    return [sorted(group) for group in found]
