"""What a user may call heights, turned into one checked number of mm per bubble."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout

_ROUNDING = 5e-4
"""mm. Heights travel in whole µm: a last digit that interpolation got wrong is within the limits."""

Heights = ArrayLike | Callable[[Any, Any], Any]


def sample(heights_mm: Heights, layout: Layout, height_max_mm: float) -> NDArray[np.float64]:
    """One height in mm per bubble, (n,).

    `heights_mm` is an (n,) array, a 2-D heightfield, or a callable f(x_mm, y_mm). A heightfield is stretched
    over the rectangle of the outermost bubbles' centres, row 0 at the lowest y and column 0 at the lowest x,
    and read between its entries linearly. A callable is given arrays of all x and all y, or, where it cannot
    take those, one bubble after the other.

    Raises `InvalidInput` for the wrong count, anything not a finite number, negative, or above `height_max_mm`.
    """
    if callable(heights_mm):
        heights = _call(heights_mm, layout)
    else:
        heights = _numbers(heights_mm)
        if heights.ndim == 2:
            heights = _interpolate(heights, layout)
    if heights.shape != (len(layout),):
        shape = f"{len(heights)} heights" if heights.ndim == 1 else f"an array of shape {heights.shape}"
        raise InvalidInput(
            f"{shape[0].upper() + shape[1:]} for {len(layout)} bubbles: "
            "give one height in mm per bubble, a 2-D heightfield or f(x_mm, y_mm)."
        )
    for wrong, what in (
        (~np.isfinite(heights), "is not a number"),
        (heights < -_ROUNDING, "is negative"),
        (heights > height_max_mm + _ROUNDING, f"is above the limit of {height_max_mm:g} mm"),
    ):
        if wrong.any():
            bubble = int(np.flatnonzero(wrong)[0])
            raise InvalidInput(
                f"The height of bubble {bubble}, {heights[bubble]:g} mm, {what}; heights are 0 to {height_max_mm:g} mm."
            )
    return heights.clip(0, height_max_mm)


def _numbers(values: Any) -> NDArray[np.float64]:
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(f"Heights must be numbers of mm; {values!r} is not an array of numbers.") from None


def _call(function: Callable[[Any, Any], Any], layout: Layout) -> NDArray[np.float64]:
    x, y = layout.positions_mm.T
    try:
        return np.array(np.broadcast_to(np.asarray(function(x, y), dtype=float), x.shape))
    except (TypeError, ValueError):  # it branches on x, or uses math: one bubble after the other
        values = [function(float(one), float(other)) for one, other in layout.positions_mm]
        return _numbers(values)


def _interpolate(field: NDArray[np.float64], layout: Layout) -> NDArray[np.float64]:
    from scipy.ndimage import map_coordinates

    if not field.size:
        raise InvalidInput("A heightfield needs at least one entry; this one is empty.")
    low = layout.positions_mm.min(axis=0)
    span = layout.positions_mm.max(axis=0) - low
    share = (layout.positions_mm - low) / np.where(span > 0, span, 1)
    rows, columns = field.shape
    return np.asarray(
        map_coordinates(field, [share[:, 1] * (rows - 1), share[:, 0] * (columns - 1)], order=1, mode="nearest")
    )
