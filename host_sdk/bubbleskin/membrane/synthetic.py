"""Simulated measurements of a sheet: for examples, tests and pictures, and always called simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bubbleskin.membrane.balloon import YeohBalloon
from bubbleskin.membrane.data import Measurements
from bubbleskin.membrane.fit import Noise

HEIGHTS_MM = np.linspace(5.4, 13.0, 14)
"""Where a bubble is measured if nothing else is asked: from just above rest up to where the paper's end."""


def simulate_sheet(
    bubbles: int = 7,
    *,
    balloon: YeohBalloon | None = None,
    spread: float = 0.1,
    heights_mm: Sequence[float] | np.ndarray = HEIGHTS_MM,
    pressures_kpa: Sequence[float] | np.ndarray | None = None,
    repeats: int = 3,
    noise: Noise = Noise(),  # noqa: B008 - a tuple does not change
    seed: int = 0,
) -> tuple[Measurements, list[YeohBalloon]]:
    """Simulate measuring ``bubbles`` bubbles, and return the measurements with the true balloons.

    Wall and μ of each bubble differ from ``balloon`` (the paper's) by a standard deviation of
    ``spread``/2 each, at most twice that. Every bubble is brought to each of ``heights_mm``, or, if
    ``pressures_kpa`` is given, the whole sheet to those pressures, rising; ``repeats`` times. Height and
    pressure are then read with Gaussian ``noise``, without outliers. Whoever fits it knows only the nominal
    wall, and finds the constants scaled by true over nominal thickness.
    """
    rng = np.random.default_rng(seed)
    nominal = balloon or YeohBalloon()
    factors = 1 + np.clip(rng.normal(0, spread / 2, (bubbles, 2)), -spread, spread)
    true = [replace(nominal, mu=nominal.mu * m, thickness=nominal.thickness * w) for m, w in factors]
    readings = []
    for number, one in enumerate(true):
        if pressures_kpa is None:
            exact = np.asarray(heights_mm, dtype=float) * 1e-3
        else:
            exact = one.heights(np.asarray(pressures_kpa, dtype=float) * 1e3)[:, 0]  # Rising: the lowest.
        h = np.repeat(exact, repeats)
        p = one.pressure_at_height(h)
        readings.append(
            (
                np.full(h.size, number),
                np.repeat(np.arange(exact.size), repeats),
                h + rng.normal(0, noise.height_sd, h.size),
                p + rng.normal(0, noise.pressure_sd, h.size),
            )
        )
    bubble, step, height, pressure = (np.concatenate(column) for column in zip(*readings, strict=True))
    source = f"simulated: {bubbles} bubbles, spread {spread:g}, seed {seed}"
    return Measurements(height, pressure, bubble, step, source=source), true
