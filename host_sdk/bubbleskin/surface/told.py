"""From what a device believes of each bubble by itself to what is told: tops, how sure, and whether that is what was asked."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bubbleskin.device.state import State
from bubbleskin.surface.kept import STIR_MM, KeptShape

Array = NDArray[np.float64]

TOLERANCE_MM = 0.5
"""A bubble is settled where its top is so near the height asked, with 95 % by its standard deviation."""
_SIGMAS = 2.0
_AT_REST = ("settled", "unsure")


def told(state: State, kept: KeptShape, asked_mm: Array, *, on_the_way: bool) -> State:
    """`state`, of bubbles by themselves, as of the surface that is `kept`; `asked_mm`, (n,), are the tops asked.

    `on_the_way`: whether other steps follow before these are meant to be there.
    """
    alone = state.alone_mm
    height = alone + kept.lift_mm
    sd = None if state.sd_mm is None else kept.sd_mm(state.sd_mm)
    judged = (np.abs(kept.lift_mm) > STIR_MM) | (np.abs(asked_mm - state.target_mm) > STIR_MM)
    if not kept.known:
        judged |= kept.gaps.touching(alone)
    off = np.abs(height - asked_mm)
    status = tuple(
        _status(one, off[bubble], np.inf if sd is None else sd[bubble], on_the_way) if judged[bubble] else one
        for bubble, one in enumerate(state.status)
    )
    return replace(state, height_mm=height, sd_mm=sd, target_mm=asked_mm, status=status)


def _status(device: str, off: float, sd: float, on_the_way: bool) -> str:
    """What a bubble does, whose neighbours or limits have a say, where the `device` finds it so."""
    if device not in _AT_REST:
        return device
    if on_the_way:
        return "moving"
    if np.isnan(sd):
        return "unsure"
    if off > TOLERANCE_MM:
        return "missed"
    return "settled" if off + _SIGMAS * sd <= TOLERANCE_MM else "unsure"
