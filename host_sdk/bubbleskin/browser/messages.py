"""What a browser is told of the array: where its bubbles are, once, and of each state one short message."""

import math
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.layout import Layout

WEB = Path(__file__).parent / "web"
"""What browsers get: `array.js` draws, `array.css` and `palette.css` are its looks."""


def geometry(info: Info, layout: Layout) -> dict[str, Any]:
    """Where bubbles are, mm from their middle, how far apart, and within what heights, mm, and pressures, kPa."""
    centred = layout.positions_mm - layout.positions_mm.mean(axis=0)
    return {
        "positions": centred.round(3).tolist(),
        "pitch": layout.pitch_mm,
        "rest": info.height_rest_mm,
        "max": info.height_max_mm,
        "pressure": info.pressure_max_kpa,
    }


def message(state: State) -> dict[str, Any]:
    """What a page is sent of a state: short names, hundredths of a mm and of a kPa, and only the faults that there are."""
    short: dict[str, Any] = {
        "t": round(state.time, 3),
        "h": _rounded(state.height_mm),
        "a": _rounded(state.alone_mm),
        "g": _rounded(state.target_mm),
        "p": _rounded(state.pressure_kpa),
        "s": state.status,
        "f": {bubble: faults for bubble, faults in enumerate(state.faults) if faults},
    }
    if state.sd_mm is not None:
        short["sd"] = _rounded(state.sd_mm)
    return short


def _rounded(values: NDArray[Any]) -> list[float]:
    """JSON has no nan: what is not known is 0."""
    return [round(value, 2) if math.isfinite(value) else 0.0 for value in values.tolist()]
