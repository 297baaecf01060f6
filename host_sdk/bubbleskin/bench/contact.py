"""How fast touching bubbles are followed and planned, and how that grows with their number."""

import time
from collections.abc import Callable

import numpy as np

from bubbleskin.bench.rows import Row
from bubbleskin.contact.model import CompliantContact, Shape
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon
from bubbleskin.planner.search import plan

_REPEATS = 3  # the best of them counts: what else the machine does only makes it slower
_SEED = 1
_PRESSED = 26.69e3  # Pa; 12 mm alone, at a pitch of 10


def rows() -> list[Row]:
    """Paths of 25 increments for 7 to 91 bubbles, plans for 7 and 19."""
    found, size, spent = [], [], []
    for rings, target in ((1, "< 0.1"), (2, "< 0.5"), (3, ""), (4, ""), (5, "")):
        layout = Layout.hexagon(rings)
        model = CompliantContact(layout)
        pressures = _pressures(np.random.default_rng(_SEED), len(layout))
        model.settle([pressures])  # compiled and cached
        seconds, shape = _best(lambda model=model, p=pressures: model.settle([p]))  # type: ignore[misc]
        size.append(len(shape.contacts))
        spent.append(seconds)
        name = f"one path of 25 increments, {len(layout)} bubbles, {len(shape.contacts)} contacts, {shape.increments} relaxations"
        found.append(Row(name, seconds, "s", target))
    growth = float(np.polyfit(np.log(size), np.log(spent), 1)[0])
    found.append(Row("growth of a path with its contacts, power", growth, "", "near 1"))
    pressed = CompliantContact(Layout.hexagon(5))
    seconds, shape = _best(lambda: pressed.settle([np.full(91, _PRESSED)]))
    name = f"91 bubbles pressed hard: {len(shape.contacts)} contacts, {len(shape.snaps)} snaps, {shape.increments} relaxations"
    return [*found, Row(name, seconds, "s"), _plans(1, 20, "< 1"), _unreachable(), _plans(2, 10, "< 10")]


def _pressures(rng: np.random.Generator, n: int) -> np.ndarray:
    """Those of random heights from 5.5 to 13 mm alone."""
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
    """An even hexagon of 13 mm: it buckles, however one goes about it."""
    layout = Layout.hexagon(1)
    begin = time.process_time()
    plan(np.full(7, 13.0), layout)
    return Row("the nearest to a shape that 7 bubbles cannot have", time.process_time() - begin, "s", "< 1")


def _best(work: Callable[[], Shape]) -> tuple[float, Shape]:
    best = np.inf
    for _ in range(_REPEATS):
        begin = time.process_time()
        shape = work()
        best = min(best, time.process_time() - begin)
    return best, shape
