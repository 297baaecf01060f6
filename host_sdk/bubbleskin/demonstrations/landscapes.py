"""Terrains that come with the SDK, made by formula: elevations from 0 to 1, row 0 at the lowest y."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_CELLS = 161
_HILLS = (
    (0.25, 0.30, 0.12, 1.0),
    (0.68, 0.25, 0.06, 0.7),
    (0.72, 0.62, 0.15, 0.9),
    (0.35, 0.75, 0.08, 0.8),
    (0.52, 0.48, 0.04, 0.5),
)
"""Of the islands: x, y, standard deviation and height, all but the last as shares of the terrain's width."""
_SEA = 0.12
_WIDEST, _NARROWEST = 0.40, 0.10
"""Wavelengths of the ridges at either end, as shares of the terrain's width: 64 and 16 mm of 160."""


def volcano() -> NDArray[np.float64]:
    """One cone with a crater, and valleys down its sides."""
    x, y = _plane()
    away, angle = np.hypot(x - 0.5, y - 0.5), np.arctan2(y - 0.5, x - 0.5)
    cone = np.exp(-((away / 0.28) ** 2))
    crater = 0.55 * np.exp(-((away / 0.09) ** 2))
    valleys = 0.12 * np.cos(5 * angle) * cone * (1 - np.exp(-((away / 0.15) ** 2)))
    return _from_0_to_1(cone - crater + valleys)


def islands() -> NDArray[np.float64]:
    """Five hills of different widths, each alone in a flat sea."""
    x, y = _plane()
    land = sum(height * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * sd**2)) for a, b, sd, height in _HILLS)
    return _from_0_to_1(np.maximum(land - _SEA, 0.0))


def ridges() -> NDArray[np.float64]:
    """Ridges that stand closer and closer from left to right: one finds by hand where the bubbles cannot follow any more."""
    x, _ = _plane()
    turns = -np.log1p(x * (_NARROWEST / _WIDEST - 1)) / (_WIDEST - _NARROWEST)  # its slope is 1 / wavelength
    return _from_0_to_1(1 - np.cos(2 * np.pi * turns))


LANDSCAPES: dict[str, Callable[[], NDArray[np.float64]]] = {"volcano": volcano, "islands": islands, "ridges": ridges}
"""By the names that the command line knows them by."""


def _plane() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x and y of every cell, from 0 to 1."""
    y, x = np.mgrid[0:_CELLS, 0:_CELLS] / (_CELLS - 1)
    return x, y


def _from_0_to_1(field: NDArray[np.float64]) -> NDArray[np.float64]:
    return (field - field.min()) / np.ptp(field)
