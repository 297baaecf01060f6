"""From heights over time to a sequence: as few keyframes as it takes to stay close."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.steps import SECONDS_MAX, Repeat, Step

LEAD_S = 1.0
"""In which the bubbles go to where the pattern begins."""
LENGTH_MAX = 600.0
"""s: a step every 10 ms would be 60,000 of the 65,535 that a sequence may have. Longer ones repeat."""
_GRID_MS = 10
"""Between moments that are looked at, and the least of a ramp: the tick of a wristband of nineteen, two of one of seven."""
_ROUNDING_MM = 0.001
"""Targets are whole µm."""
_NAME_MAX = 60


def keyframes(
    heights: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    layout: Layout,
    seconds: float,
    within_mm: float,
    loops: int,
    name: str,
) -> Sequence:
    """`heights` of k moments, (k, n), as a sequence whose ramps are within `within_mm` of them every 10 ms."""
    checks.instance("layout", layout, Layout, "a Layout, such as skin.layout")
    within = checks.number("within_mm", within_mm, 2 * _ROUNDING_MM, unit="mm")
    ticks = round(checks.number("seconds", seconds, _GRID_MS / 1000, LENGTH_MAX, "s") * 1000 / _GRID_MS)
    shapes = heights(np.arange(ticks + 1, dtype=np.float64) * _GRID_MS / 1000)
    jump = float(np.abs(shapes[-1] - shapes[0]).max())
    if loops != 1 and jump > within:
        raise InvalidInput(
            f"After {seconds:g} s the pattern is up to {jump:.2f} mm from where it began, and a repeat would jump. "
            "Give seconds that are whole periods of it, or loops=1."
        )
    ends = _ends(shapes, within - _ROUNDING_MM)
    targets = np.round(shapes, 3)
    steps = [
        Step(targets[end].tolist(), (end - begin) * _GRID_MS / 1000)
        for begin, end in zip([0, *ends[:-1]], ends, strict=True)
    ]
    lead = Step(targets[0].tolist(), LEAD_S, "smooth", name="to its beginning")
    short = name if len(name) <= _NAME_MAX else f"{name[: _NAME_MAX - 1]}…"
    return Sequence([lead, Repeat(steps, loops)], name=short, layout=layout)


def _ends(shapes: NDArray[np.float64], within: float) -> list[int]:
    """Where each ramp ends: from its beginning the longest that is found to stay `within`, by doubling and then halving."""
    last, longest = len(shapes) - 1, int(SECONDS_MAX) * 1000 // _GRID_MS
    ends, begin = [], 0
    while begin < last:
        most = min(last, begin + longest)
        good, step = begin + 1, 2
        while begin + step < most and _close(shapes[begin : begin + step + 1], within):
            good, step = begin + step, 2 * step
        bad = min(begin + step, most)
        if _close(shapes[begin : bad + 1], within):
            good = bad
        while bad - good > 1:
            middle = (good + bad) // 2
            if _close(shapes[begin : middle + 1], within):
                good = middle
            else:
                bad = middle
        ends.append(good)
        begin = good
    return ends


def _close(shapes: NDArray[np.float64], within: float) -> bool:
    """Whether one ramp from the first shape to the last is close to all between."""
    share = np.linspace(0, 1, len(shapes))[:, None]
    return bool(np.abs(shapes[0] + share * (shapes[-1] - shapes[0]) - shapes).max() <= within)
