"""Print how well contact and planner do: the paper's three heights, and plans for shapes that can be had.

python tools/report/contact.py [--shapes7 200] [--shapes19 50] [--seed 0]

A shape that can be had is made, not drawn: random heights from 5.5 to 13 mm alone, their pressures given in one to three
random groups one after the other, and the model's heights after that.
"""

import argparse
import time
from collections import Counter
from itertools import product

import numpy as np
from rich.console import Console
from rich.progress import track

import bubbleskin as bs
from bubbleskin.planner.orders import steps_of

WITHIN_MM = 0.3
FULL = 26.69e3  # Pa; 12.00 mm alone


def paper() -> list[str]:
    model = bs.CompliantContact(bs.Layout.hexagon(1))
    everyone = np.full(7, FULL)
    centre = np.where(np.arange(7) == 0, FULL, 0.0)
    lines = ["| all at 26.69 kPa | centre (mm) | ring (mm) |", "|---|---|---|"]
    for name, steps in {
        "alone": [centre],
        "ring first, then the centre": [everyone - centre, everyone],
        "together": [everyone],
        "centre first, then the ring": [centre, everyone],
    }.items():
        height = model.settle(steps, strict=True).height_mm
        ring = ", ".join(f"{h:.2f}" for h in np.unique(height[1:].round(2)))
        lines.append(f"| {name} | {height[0]:.2f} | {ring} |")
    return lines


def random_shape(model: bs.CompliantContact, rng: np.random.Generator) -> np.ndarray:
    n = len(model)
    pressure = bs.YeohBalloon().pressure_at_height(rng.uniform(5.5e-3, 13e-3, n))
    group = rng.integers(0, rng.integers(1, 4), n)
    order = [tuple(np.flatnonzero(group == g)) for g in range(group.max() + 1) if (group == g).any()]
    return model.settle(steps_of(tuple(order), pressure, np.zeros(n)), strict=True).height_mm


def fewest(plan: bs.Plan, model: bs.CompliantContact) -> int:
    """Fewest steps of any order in up to three groups, of all 7 bubbles, at the plan's pressures."""
    for steps in (1, 2, 3):
        for group in product(range(steps), repeat=7):
            if len(set(group)) < steps:
                continue
            order = tuple(tuple(np.flatnonzero(np.array(group) == g)) for g in range(steps))
            shape = model.settle(steps_of(order, plan.shape.pressure, np.zeros(7)), ramp="height")
            if np.abs(shape.height_mm - plan.asked_mm).max() < WITHIN_MM:
                return steps
    return 99


def plans(rings: int, count: int, seed: int) -> list[str]:
    model = bs.CompliantContact(bs.Layout.hexagon(rings))
    rng = np.random.default_rng(seed)
    reached, sure, longest, worst = 0, 0, 0.0, 0.0
    steps: Counter[int] = Counter()
    above: Counter[int] = Counter()
    for _ in track(range(count), f"{len(model)} bubbles", console=Console(stderr=True), transient=True):
        asked = random_shape(model, rng)
        begin = time.process_time()
        found = bs.plan(asked, model.layout, contact=model)
        longest = max(longest, time.process_time() - begin)
        good = found.error_mm <= WITHIN_MM
        reached += good
        sure += found.sure
        steps[len(found.steps)] += 1
        if good:
            worst = max(worst, found.error_mm)
        if len(model) == 7 and good and len(found.steps) > 2:  # two are at most one too many
            above[len(found.steps) - fewest(found, model)] += 1
    lines = [
        f"{len(model)} bubbles: {reached} of {count} shapes reached within {WITHIN_MM} mm, largest error of those "
        f"{worst:.3f} mm; {sure} sure; longest search {longest:.2f} s",
        "  steps: " + ", ".join(f"{n} plans of {k}" for k, n in sorted(steps.items())),
    ]
    if len(model) == 7:
        lines.append(
            "  above the exhaustive best: "
            + (", ".join(f"{n} plans by {k}" for k, n in sorted(above.items())) or "no plan has more than two steps")
        )
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--shapes7", type=int, default=200)
    parser.add_argument("--shapes19", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for line in [*paper(), *plans(1, given.shapes7, given.seed), *plans(2, given.shapes19, given.seed)]:
        print(line)
