"""Print how well springs are found on wristbands that nobody knows: heights of shapes that were not used for the fit.

python tools/report/contact_fit.py [--sheets 6] [--shapes 6] [--seed 0] [--url sim://wristband7?springs=0.3]

On each sheet five shapes are measured: all apart at 9.5 mm; then a bubble of 12.5 mm goes first and all others go to 11.5 mm, for
four bubbles in turn.
Heights are the simulated truth with 0.05 mm of noise, pressures those that the wristband tells. Springs are fitted to heights, to
both, and to pressures alone; then random plans are played, and the truth is compared with what each model predicts.
"""

import argparse
from collections.abc import Iterator

import numpy as np
from rich.console import Console
from rich.progress import track

import bubbleskin as bs
from bubbleskin.errors import InvalidInput

LAYOUT = bs.Layout.hexagon(1)
LIFTED = (0, 1, 3, 5)
HIGH, LOW, APART, NOISE_MM = 12.5, 11.5, 9.5, 0.05


def held(url: str, steps: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """True heights (mm) and told pressures (Pa) after steps of sizes, (7,) each."""
    with bs.connect(url) as skin:
        skin.play(bs.Sequence([bs.Step(list(step), ramp=1.0, until=bs.After(0.5)) for step in steps]))
        return skin.simulated.height_mm, 1e3 * skin.state().pressure_kpa


def measured(url: str, rng: np.random.Generator) -> Iterator[bs.Measured]:
    ways = [[np.full(7, APART)]]
    for bubble in LIFTED:
        first = np.arange(7) == bubble
        ways.append([np.where(first, HIGH, 5.0), np.where(first, HIGH, LOW)])
    for steps in ways:
        true, pressure = held(url, steps)
        yield bs.Measured(steps, true + rng.normal(0, NOISE_MM, 7), "size", pressure)


def models(shapes: list[bs.Measured]) -> Iterator[tuple[str, bs.ContactFit | str]]:
    bare = [bs.Measured(one.steps, one.height_mm, "size") for one in shapes]
    pressures = [bs.Measured(one.steps, None, "size", one.pressure_pa) for one in shapes]
    for name, given in (("heights", bare), ("heights and pressures", shapes), ("pressures alone", pressures)):
        try:
            yield name, bs.fit_contact(given, LAYOUT, sd_mm=NOISE_MM)
        except InvalidInput as error:
            yield name, str(error)


def unseen(count: int, rng: np.random.Generator) -> list[list[np.ndarray]]:
    """Steps in which contact has a say, and in which sheets that are 30 % off end alike."""
    model = bs.CompliantContact(LAYOUT)
    found = []
    while len(found) < count:
        first = rng.random(7) < 0.4
        sizes = rng.uniform(9.0, 13.0, 7)
        asked = model.settle_sizes([np.where(first, sizes, 5.0), sizes]).height_mm
        plan = bs.plan(asked, LAYOUT, contact=model)
        if plan.sure and plan.shape.lifted_mm.max() > 0.5:
            found.append([step.target_mm for step in plan.steps])
    return found


def report(given: argparse.Namespace) -> Iterator[str]:
    rng = np.random.default_rng(given.seed)
    shapes = unseen(given.shapes, rng)
    off: dict[str, list[float]] = {}
    springs: dict[str, list[np.ndarray]] = {}
    for sheet in track(range(given.sheets), "sheets", console=Console(stderr=True), transient=True):
        url = f"{given.url}&seed={given.seed + sheet}"
        contacts = {"nothing: the preset": bs.CompliantContact(LAYOUT)}
        for name, fit in models(list(measured(url, rng))):
            if isinstance(fit, str):
                yield f"sheet {sheet}, {name}: {fit}"
                continue
            contacts[name] = fit.contact
            springs.setdefault(name, []).append(np.array([*fit.factor, *fit.ratio_factor.values()]))
        for steps in shapes:
            true, _ = held(url, steps)
            for name, contact in contacts.items():
                off.setdefault(name, []).extend(np.abs(contact.settle_sizes(steps).height_mm - true))
    yield "| fitted to | RMS of unseen shapes (mm) | largest | kz, kxy, kc; kz/kxy, kc/kxy known to, median |"
    yield "|---|---|---|---|"
    for name, errors in off.items():
        known = (
            [f"{100 * (f - 1):.0f} %" for f in np.median(springs[name], axis=0)] if name in springs else ["30 %"] * 3
        )
        yield f"| {name} | {np.sqrt(np.mean(np.square(errors))):.3f} | {max(errors):.2f} | {', '.join(known)} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sheets", type=int, default=6)
    parser.add_argument("--shapes", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--url", default="sim://wristband7?springs=0.3")
    for line in report(parser.parse_args()):
        print(line, flush=True)
