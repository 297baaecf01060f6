"""How fast touching bubbles are followed and planned, and how that grows with their number."""

import time
from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bubbleskin.bench.rows import REPEATS, Row, fastest, share_of
from bubbleskin.contact.model import CompliantContact
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon
from bubbleskin.planner.search import plan

_SEED = 1
_RINGS = ((1, "< 0.1"), (2, "< 0.5"), (3, ""), (4, ""), (5, ""))
"""Hexagons that are followed, 7 to 91 bubbles, and their targets in s."""
_PRESSED = 26.69e3
"""Pa; 12 mm alone, at a pitch of 10 mm."""
_PLANS = ((1, 20, "< 1"), (2, 10, "< 10"))
"""Hexagons that are planned for, how often, and their targets in s."""


def rows(size: float = 1.0) -> Iterator[Row]:
    """Paths of 25 increments for 7 to 91 bubbles, plans for 7 and 19."""
    repeats = share_of(REPEATS, size)
    hexagons = _RINGS[: max(2, share_of(len(_RINGS), size))]
    yield from _paths(hexagons, repeats)
    yield _pressed(hexagons[-1][0], repeats)
    for rings, count, target in _PLANS[: share_of(len(_PLANS), size)]:
        yield _plans(rings, share_of(count, size), target)
    yield _unreachable()


def _paths(hexagons: tuple[tuple[int, str], ...], repeats: int) -> Iterator[Row]:
    contacts, spent = [], []
    for rings, target in hexagons:
        model = CompliantContact(Layout.hexagon(rings))
        path = [_pressures(np.random.default_rng(_SEED), len(model))]
        model.settle(path)  # Compiled and cached.
        seconds, shape = fastest(partial(model.settle, path), repeats)
        contacts.append(len(shape.contacts))
        spent.append(seconds)
        name = f"one path of 25 increments, {len(model)} bubbles, {len(shape.contacts)} contacts, {shape.increments} relaxations"
        yield Row(name, seconds, "s", target)
    growth = float(np.polyfit(np.log(contacts), np.log(spent), 1)[0])
    yield Row("growth of a path with its contacts, power", growth, "", "near 1")


def _pressed(rings: int, repeats: int) -> Row:
    model = CompliantContact(Layout.hexagon(rings))
    seconds, shape = fastest(partial(model.settle, [np.full(len(model), _PRESSED)]), repeats)
    came = f"{len(shape.contacts)} contacts, {len(shape.snaps)} snaps, {shape.increments} relaxations"
    return Row(f"{len(model)} bubbles pressed hard: {came}", seconds, "s")


def _pressures(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Those of random heights from 5.5 to 13 mm alone, (n,) Pa."""
    return np.asarray(YeohBalloon().pressure_at_height(rng.uniform(5.5e-3, 13e-3, n)))


def _plans(rings: int, count: int, target: str) -> Row:
    layout = Layout.hexagon(rings)
    model = CompliantContact(layout)
    rng = np.random.default_rng(_SEED)
    longest = 0.0
    for _ in range(count):
        heights = model.settle([_pressures(rng, len(layout))]).height_mm
        begin = time.process_time()
        plan(heights, layout, contact=model)
        longest = max(longest, time.process_time() - begin)
    return Row(f"a plan for {len(layout)} bubbles, longest of {count}", longest, "s", target)


def _unreachable() -> Row:
    """An even hexagon of 13 mm: it buckles in whatever order it is inflated."""
    seconds, _ = fastest(partial(plan, np.full(7, 13.0), Layout.hexagon(1)), 1)
    return Row("the nearest to a shape that 7 bubbles cannot have", seconds, "s", "< 1")
