"""Print how well contact and planner do: the paper's three heights, and plans for shapes that can be had.

python tools/report/contact.py [--shapes7 200] [--shapes19 50] [--shapes37 10] [--irregular 20] [--played 200] [--seed 0]

A shape that can be had is made, not drawn: random sizes from 5.5 to 13 mm, given in one to five random groups one after the
other, and the model's heights after that. Plans that are played run on simulated wristbands whose springs differ by up to
30 % from what the planner takes them to be; heights there are the simulated truth.
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterable, Iterator
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
    sizes = rng.uniform(5.5, 13.0, n)
    group = rng.integers(0, rng.integers(1, 6), n)
    order = [tuple(np.flatnonzero(group == g)) for g in range(group.max() + 1) if (group == g).any()]
    return model.settle_sizes(steps_of(tuple(order), sizes, np.full(n, 5.0))).height_mm


def scattered(bubbles: int, rng: np.random.Generator) -> bs.Layout:
    """Bubbles at random places, no two nearer than 9 mm, about as dense as a hexagon."""
    places: list[np.ndarray] = []
    side = np.sqrt(95.0 * bubbles)
    while len(places) < bubbles:
        place = rng.uniform(0, side, 2)
        if all(np.hypot(*(place - other)) > 9.0 for other in places):
            places.append(place)
    return bs.Layout(np.array(places), 10.0)


def fewest(plan: bs.Plan, model: bs.CompliantContact) -> int:
    """Fewest steps of any order in up to three groups, of all 7 bubbles, at the plan's pressures."""
    for steps in (1, 2, 3):
        for group in product(range(steps), repeat=7):
            if len(set(group)) < steps:
                continue
            order = tuple(tuple(np.flatnonzero(np.array(group) == g)) for g in range(steps))
            shape = model.settle_sizes(steps_of(order, plan.steps[-1].target_mm, np.full(7, 5.0)))
            if np.abs(shape.height_mm - plan.asked_mm).max() < WITHIN_MM:
                return steps
    return 99


def plans(layout: bs.Layout, count: int, seed: int) -> list[str]:
    model = bs.CompliantContact(layout)
    rng = np.random.default_rng(seed)
    reached, sure, worst = 0, 0, 0.0
    spent: list[float] = []
    steps: Counter[int] = Counter()
    above: Counter[int] = Counter()
    for _ in watched(count, f"{len(model)} bubbles"):
        asked = random_shape(model, rng)
        begin = time.process_time()
        found = bs.plan(asked, model.layout, contact=model)
        spent.append(time.process_time() - begin)
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
        f"{worst:.3f} mm; {sure} sure; search {np.median(spent):.2f} s, longest {max(spent):.2f} s of CPU",
        "  steps: " + ", ".join(f"{n} plans of {k}" for k, n in sorted(steps.items())),
    ]
    if len(model) == 7:
        lines.append(
            "  above the exhaustive best of up to three: "
            + (", ".join(f"{n} plans by {k}" for k, n in sorted(above.items())) or "no plan has more than two steps")
        )
    return lines


def flat_tops() -> list[str]:
    """12 mm everywhere, which no array can have: the nearest, beside the best that one size for all reaches."""
    lines = [
        "| 12 mm everywhere | largest error (mm) | RMS | one size for all: largest, RMS | CPU (s) |",
        "|---|---|---|---|---|",
    ]
    for rings in (1, 2, 3):
        model = bs.CompliantContact(bs.Layout.hexagon(rings))
        asked = np.full(len(model), 12.0)
        begin = time.process_time()
        found = bs.plan(asked, model.layout, contact=model)
        spent = time.process_time() - begin
        off = np.array(
            [model.settle_sizes(np.full(len(model), u)).height_mm - asked for u in np.arange(9, 12.01, 0.05)]
        )
        largest, rms = np.abs(off).max(axis=1).min(), np.sqrt((off**2).mean(axis=1)).min()
        lines.append(
            f"| {len(model)} bubbles | {found.error_mm:.2f} | {found.rms_mm:.2f} | {largest:.2f}, {rms:.2f} | {spent:.1f} |"
        )
    return lines


def played(count: int, seed: int) -> list[str]:
    """Plans on plants whose springs the planner does not know: heights within the interval, and shapes that came out."""
    layout = bs.Layout.hexagon(1)
    model = bs.CompliantContact(layout)
    rng = np.random.default_rng(seed + 100)
    tally = {True: [0, 0, 0], False: [0, 0, 0]}
    off: list[float] = []
    for number in watched(count, "played"):
        found = bs.plan(random_shape(model, rng), layout, contact=model)
        with bs.connect(f"sim://wristband7?springs=0.3&seed={seed + number}") as skin:
            if found.steps:
                skin.play(found.sequence)
            skin.sleep(0.5)
            true = skin.simulated.height_mm
        within = bool(((true >= found.low_mm) & (true <= found.high_mm)).all())
        near = bool((np.abs(true - found.predicted_mm) <= 0.5).all())
        for k, yes in enumerate((True, within, near)):
            tally[found.sure][k] += yes
        if found.sure:
            off.extend(np.abs(true - found.predicted_mm))
    lines = [
        f"{'sure' if sure else 'not sure'}: {total} plans, {within} with every bubble in its interval, "
        f"{near} with every bubble within 0.5 mm of what was predicted"
        for sure, (total, within, near) in tally.items()
    ]
    return [
        *lines,
        f"true less predicted, sure plans: {np.sqrt(np.mean(np.square(off))):.3f} mm RMS, largest {max(off):.2f} mm",
    ]


def watched(count: int, what: str) -> Iterable[int]:
    return track(range(count), what, console=Console(stderr=True), transient=True)


def report(given: argparse.Namespace) -> Iterator[str]:
    yield from paper()
    for rings, count in ((1, given.shapes7), (2, given.shapes19), (3, given.shapes37)):
        if count:
            yield from plans(bs.Layout.hexagon(rings), count, given.seed)
    if given.irregular:
        yield "irregular:"
        yield from plans(scattered(12, np.random.default_rng(given.seed)), given.irregular, given.seed)
    if given.flat:
        yield from flat_tops()
    if given.played:
        yield from played(given.played, given.seed)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    for name, count in (("shapes7", 200), ("shapes19", 50), ("shapes37", 10), ("irregular", 20), ("played", 200)):
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--flat", type=int, default=1, help="12 mm everywhere; 0: not")
    parser.add_argument("--seed", type=int, default=0)
    for line in report(parser.parse_args()):
        print(line, flush=True)
