"""The fastest that a bubble can be filled: its fill valve open until the air is in, then shut."""

import numpy as np
from numpy.typing import NDArray

from bubbleskin.bench.control.contenders import Watched
from bubbleskin.bench.control.shows import NEAR_MM

_STEP_S = 1e-3
_LOOK_S = 1.0
_HALVINGS = 14
_LONGEST_S = 0.6


def fastest_fill(board: Watched, target_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Seconds from now until each bubble is within `NEAR_MM` of its target and stays there, (n,).

    The plant's own valves, tubes and reservoir, with the pump at its utmost; by halving the time for which each fill valve has
    current. All bubbles are filled at once, as a show does. The plant is left as it is found.
    """
    plant = board.plant
    before = plant.snapshot()
    low = np.zeros(len(target_mm))
    high = np.full(len(target_mm), _LONGEST_S)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        heights = _heights(board, middle)
        plant.restore(before)
        short = heights[-1] < target_mm
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    heights = _heights(board, high)
    plant.restore(before)
    away = np.abs(heights - target_mm) > NEAR_MM
    return np.asarray((len(away) - np.argmax(away[::-1], axis=0)) * _STEP_S)


def _heights(board: Watched, open_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights after each step of `_STEP_S`, of valves that have current for `open_s`."""
    plant = board.plant
    heights = []
    for k in range(round(_LOOK_S / _STEP_S)):
        left = np.clip(open_s - k * _STEP_S, 0.0, _STEP_S)
        plant.advance(_STEP_S, left, 0.0, pump=1.0)
        heights.append(plant.alone_mm)
    return np.array(heights)
