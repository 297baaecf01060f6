"""How fast the membrane's mathematics is: inversions, tables, fits."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from bubbleskin.bench.rows import Row
from bubbleskin.membrane import YeohBalloon, build_table, fit_sheet, simulate_sheet

_REPEATS = 3  # the best of them counts: what else the machine does only makes it slower
_PRESSURES = 100_000


def rows() -> list[Row]:
    """All branches of 10⁵ pressures, 19 tables, and the fit of a sheet of seven bubbles."""
    return [*_inversions(), *_tables(), *_fits()]


def _inversions() -> list[Row]:
    found = []
    rng = np.random.default_rng(0)
    for name, balloon, top in (
        ("monotonic", YeohBalloon(), 60e3),
        ("snapping through", YeohBalloon(mu=79.24e3), 60e3),
        ("thick, snapping through", YeohBalloon(mu=79.24e3, wall="thick"), 60e3),
    ):
        pressures = rng.uniform(0, top, _PRESSURES)
        balloon.limit_points()  # found once per balloon, on first use
        spent = _best(partial(balloon.stretches, pressures))
        found.append(Row(f"10⁵ pressures to all stretches, {name}", spent, "s", "< 0.3"))
        if name == "monotonic":
            stretches = balloon.stretches(pressures)[:, 0]
            forward = _best(partial(balloon.pressure, stretches))
            found.append(Row("the same, in evaluations of P(λ)", spent / forward, "×"))
    return found


def _tables() -> list[Row]:
    def nineteen() -> None:
        for k in range(19):
            build_table(YeohBalloon(mu=35e3 + 1e3 * k))

    return [Row("19 tables of 64 knots", _best(nineteen), "s", "< 0.1")]


def _fits() -> list[Row]:
    m, _ = simulate_sheet(7, seed=1)
    spent = _best(lambda: fit_sheet(m.bubble, m.height, m.pressure))
    return [Row(f"fit of a 7-bubble sheet, {len(m)} points", spent, "s", "< 1")]


def _best(run: Callable[[], object]) -> float:
    times = []
    for _ in range(_REPEATS):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)
