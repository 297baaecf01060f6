"""How fast the membrane's mathematics is: inversions, tables, fits."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from bubbleskin.bench.rows import REPEATS, Row, fastest, share_of
from bubbleskin.membrane import YeohBalloon, build_table, fit_sheet, simulate_sheet

_PRESSURES = 100_000
_TABLES = 19


def rows(size: float = 1.0) -> Iterator[Row]:
    """All branches of 10⁵ pressures, 19 tables, and the fit of a sheet of seven bubbles."""
    repeats = share_of(REPEATS, size)
    yield from _inversions(share_of(_PRESSURES, size), repeats)
    yield _tables(share_of(_TABLES, size), repeats)
    yield _fit(repeats)


def _inversions(count: int, repeats: int) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    for name, balloon, top in (
        ("monotonic", YeohBalloon(), 60e3),
        ("snapping through", YeohBalloon(mu=79.24e3), 60e3),
        ("thick, snapping through", YeohBalloon(mu=79.24e3, wall="thick"), 60e3),
    ):
        pressures = rng.uniform(0, top, count)
        balloon.limit_points()  # Found once per balloon, on first use.
        spent, _ = fastest(partial(balloon.stretches, pressures), repeats)
        yield Row(f"{count} pressures to all stretches, {name}", spent, "s", "< 0.3")
        if name == "monotonic":
            stretches = balloon.stretches(pressures)[:, 0]
            forward, _ = fastest(partial(balloon.pressure, stretches), repeats)
            yield Row("the same, in evaluations of P(λ)", spent / forward, "×")


def _tables(count: int, repeats: int) -> Row:
    def build() -> None:
        for k in range(count):
            build_table(YeohBalloon(mu=35e3 + 1e3 * k))

    return Row(f"{count} tables of 64 knots", fastest(build, repeats)[0], "s", "< 0.1")


def _fit(repeats: int) -> Row:
    measured, _ = simulate_sheet(7, seed=1)
    spent, _ = fastest(partial(fit_sheet, measured.bubble, measured.height, measured.pressure), repeats)
    return Row(f"fit of a 7-bubble sheet, {len(measured)} points", spent, "s", "< 1")
