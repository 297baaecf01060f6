"""Orders in which bubbles can go, and the pressures of each of their steps."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bubbleskin.contact.shape import Shape

Array = NDArray[np.float64]
Group = frozenset[int]
Order = tuple[tuple[int, ...], ...]
"""Groups of bubbles, one after the other."""

_LIFTED_MM = 0.1
"""A bubble further off the base hangs between its neighbours."""
_ALL_CHOSEN = 7
"""In arrays of up to so many bubbles every first group is tried."""
_IN_QUESTION = 6
"""In larger ones every group of so many bubbles, the wrong ones and their neighbours."""


def steps_of(order: Order, pressure: Array, begin: Array) -> Array:
    """Pressures of each step of `order`, (k, n) Pa: a bubble goes from `begin` to `pressure`, (n,) Pa, in its turn."""
    now, steps = begin.copy(), []
    for group in order:
        now = now.copy()
        now[list(group)] = pressure[list(group)]
        steps.append(now)
    return np.array(steps)


def two_groups(
    shape: Shape, pressure: Array, neighbours: Sequence[Sequence[int]], wrong: Sequence[int]
) -> Iterator[Order]:
    """Orders of two groups, each once, the likeliest first.

    `shape` is one that has the heights, at `pressure`, (n,) Pa; `wrong` are the bubbles which end elsewhere when all go
    together. Those that hang between their neighbours first, or last; then by pressure; then, around the wrong ones,
    every way to choose.
    """
    everyone = frozenset(range(len(pressure)))
    seen: set[Group] = {frozenset(), everyone}
    for first in _first_groups(shape, pressure, neighbours, frozenset(wrong)):
        if first not in seen:
            seen.add(first)
            yield _order(first, everyone - first)


def _first_groups(shape: Shape, pressure: Array, neighbours: Sequence[Sequence[int]], wrong: Group) -> Iterator[Group]:
    """Bubbles to go first, the likeliest group first; a group can come more than once."""
    n = len(pressure)
    everyone = frozenset(range(n))
    lifted = frozenset(np.flatnonzero(shape.lifted_mm > _LIFTED_MM).tolist())
    for group in (lifted, lifted & wrong, wrong):
        yield from (group, everyone - group)
    for bubble in sorted(wrong):
        yield from (frozenset([bubble]), everyone - {bubble}, frozenset(neighbours[bubble]))
    by_pressure = np.argsort(-pressure, kind="stable").tolist()
    for k in range(1, n):
        yield from (frozenset(by_pressure[:k]), frozenset(by_pressure[k:]))
    around = frozenset(j for i in wrong for j in neighbours[i])
    in_question = sorted(wrong | around, key=lambda i: (i not in wrong, -pressure[i]))[:_IN_QUESTION]
    if n <= _ALL_CHOSEN:
        in_question = list(range(n))
    for size in range(1, len(in_question) + 1):
        for chosen in combinations(in_question, size):
            yield from (frozenset(chosen), everyone - frozenset(chosen))


def three_groups(orders: Iterable[Order], wrong: Sequence[int]) -> Iterator[Order]:
    """Orders of three groups, each once: those of two with one part split, `wrong` ones against the others, then one by one."""
    seen: set[Order] = set()
    for first, second in (order for order in orders if len(order) == 2):
        early, late = frozenset(first), frozenset(second)
        splits = [(early, part, late - part) for part in _parts(late, frozenset(wrong))]
        splits += [(part, early - part, late) for part in _parts(early, frozenset(wrong))]
        for groups in splits:
            order = _order(*groups)
            if len(order) == 3 and order not in seen:
                seen.add(order)
                yield order


def layers(shape: Shape) -> Order:
    """The order that `shape` itself tells: who hangs on whom was there first, in as many groups as bubbles hang on each other.

    Of two that touch, the one whose centre is higher hangs on the other. A bubble goes one group before all that it hangs on.
    """
    on: dict[int, list[int]] = {bubble: [] for bubble in range(len(shape))}
    height = shape.position[:, 2]
    for contact in shape.contacts:
        upper, lower = contact.first, contact.second
        if height[upper] < height[lower]:
            upper, lower = lower, upper
        if shape.lifted_mm[upper] > _LIFTED_MM and height[upper] - height[lower] > 1e-3 * _LIFTED_MM:
            on[upper].append(lower)
    depth = np.zeros(len(shape), int)
    for bubble in np.argsort(height, kind="stable").tolist():  # Everybody below it has been seen.
        depth[bubble] = max((depth[lower] + 1 for lower in on[bubble]), default=0)
    return tuple(tuple(np.flatnonzero(depth == d).tolist()) for d in range(int(depth.max()), -1, -1))


def one_by_one(order: Order, key: Array) -> Order:
    """`order` with every bubble alone, those of one group by falling `key`, (n,)."""
    return tuple((bubble,) for group in order for bubble in sorted(group, key=lambda i: -key[i]))


def variants(order: Order, bubbles: Sequence[int]) -> Iterator[Order]:
    """`order` with one of `bubbles` in another group, or in a group of its own before, between or after the others."""
    for bubble in bubbles:
        rest = [[i for i in group if i != bubble] for group in order]
        for turn in range(len(rest)):
            if bubble not in order[turn]:
                yield _order(*(frozenset([*g, bubble] if k == turn else g) for k, g in enumerate(rest)))
        for turn in range(len(rest) + 1):
            yield _order(*(frozenset(g) for g in [*rest[:turn], [bubble], *rest[turn:]]))


def _parts(group: Group, wrong: Group) -> list[Group]:
    return [group & wrong, group - wrong, *(frozenset([bubble]) for bubble in sorted(group))]


def _order(*groups: Group) -> Order:
    return tuple(tuple(sorted(group)) for group in groups if group)
