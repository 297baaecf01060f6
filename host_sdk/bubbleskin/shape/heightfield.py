"""What a user may call heights, turned into one checked number of mm per bubble."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout

_ROUNDING = 5e-4
"""mm. Heights travel in whole µm: a last digit that interpolation got wrong is within the limits."""
_METRES = 0.1
"""mm. A greatest height above 0 and below this cannot be meant: bubbles are 5 mm high at rest. In m it would be one."""
_LEAST_UM = 1000.0
"""mm. From here up, heights are not meant in mm."""
FILLS = ("nearest",)
"""What may stand for the entries of a heightfield that are masked or nan."""

Heights = ArrayLike | Callable[[Any, Any], Any]


def sample(heights_mm: Heights, layout: Layout, height_max_mm: float, fill: str | None = None) -> NDArray[np.float64]:
    """One height in mm per bubble, (n,).

    `heights_mm` is an (n,) array, a 2-D heightfield, or a callable f(x_mm, y_mm). A heightfield is stretched
    over the rectangle of the outermost bubbles' centres, row 0 at the lowest y and column 0 at the lowest x,
    and read between its entries linearly. A callable is given arrays of all x and all y, or, where it cannot
    take those, one bubble after the other. `fill`: 'nearest' gives entries of a heightfield that are masked or nan the
    number of the nearest one that is not.

    Raises `InvalidInput` for the wrong count, anything not a finite number, masked, negative, or above `height_max_mm`.
    """
    if fill is not None:
        checks.one_of("fill", fill, FILLS)
    heights = _call(heights_mm, layout) if callable(heights_mm) else _field(heights_mm, layout, fill)
    if heights.shape != (len(layout),):
        raise _wrong_shape(heights, layout)
    for wrong, what in (
        (~np.isfinite(heights), "is not a number"),
        (heights < -_ROUNDING, "is negative"),
        (heights > height_max_mm + _ROUNDING, f"is above the limit of {height_max_mm:g} mm"),
    ):
        if wrong.any():
            bubble = int(np.flatnonzero(wrong)[0])
            raise InvalidInput(
                f"The height of bubble {bubble}, {heights[bubble]:g} mm, {what}; heights are 0 to {height_max_mm:g} mm."
                f"{_guess(heights_mm, heights, height_max_mm)}"
            )
    refuse_metres(heights.max(), height_max_mm)
    return heights.clip(0, height_max_mm)


def refuse_metres(greatest_mm: float, height_max_mm: float) -> None:
    """Raise where the greatest of several heights, in mm, is one that makes sense only in m."""
    if 0 < greatest_mm < _METRES:
        raise InvalidInput(
            f"The greatest height is {greatest_mm:g} mm, less than any bubble at rest has. Heights are in mm: if these are "
            f"metres, give them times 1000, up to {height_max_mm:g}."
        )


def _field(heights_mm: Any, layout: Layout, fill: str | None) -> NDArray[np.float64]:
    """Heights that are no function, as they are or interpolated."""
    _say_how(heights_mm, layout)
    if fill and np.ndim(heights_mm) == 2:
        heights_mm = filled(heights_mm, fill)
    heights = checks.array("The array of heights", heights_mm)
    if heights.ndim != 2:
        return heights
    checks.refuse_places("The heightfield", "nan", np.isnan(heights))
    return _interpolate(heights, layout)


def _say_how(given: Any, layout: Layout) -> None:
    """Refuse what people give for heights and how to say it is known."""
    if isinstance(given, str | bytes):
        raise InvalidInput(
            f"{checks.shown(given)} is a text. A ready-made shape is a function: show(bubbleskin.shapes.dome(skin.layout)); "
            "a file's heightfield is show(bubbleskin.shapes.load(path))."
        )
    if isinstance(given, Mapping):
        raise InvalidInput(
            f"{checks.shown(given)} is a dict; give one height per bubble, in the order of their numbers: "
            f"[heights[bubble] for bubble in range({len(layout)})]."
        )


def _wrong_shape(heights: NDArray[np.float64], layout: Layout) -> InvalidInput:
    n = len(layout)
    how = "give one height in mm per bubble, a 2-D heightfield or f(x_mm, y_mm)."
    if heights.ndim == 0 and np.isfinite(heights):
        return InvalidInput(f"One height for {n} bubbles: for the same everywhere write [{heights:g}] * {n}.")
    if heights.ndim == 1:
        return InvalidInput(f"{len(heights)} heights for {n} bubbles: {how}")
    hint = ""
    if heights.ndim == 3 and heights.shape[2] in (1, 2, 3, 4):
        hint = " An image with colours becomes one of heights by image.mean(axis=2) / 255 * 12, for example."
    return InvalidInput(f"An array of shape {heights.shape} for {n} bubbles: {how}{hint}")


def _guess(given: Any, heights: NDArray[np.float64], height_max_mm: float) -> str:
    """What was probably meant by heights that are refused; empty where nobody knows."""
    kind = getattr(given, "dtype", None)
    greatest = float(np.nanmax(heights)) if np.isfinite(heights).any() else 0.0
    if kind == np.uint8 and greatest > height_max_mm:
        return f" An image of 0 to 255 becomes heights by image / 255 * {height_max_mm:g}."
    if _LEAST_UM <= greatest <= 1000 * height_max_mm:
        return " If these are µm, give them divided by 1000."
    return ""


def filled(field: Any, fill: str) -> NDArray[np.float64]:
    """A heightfield with its masked entries and those that are nan as the nearest others, by distance in entries."""
    checks.one_of("fill", fill, FILLS)
    from scipy.ndimage import distance_transform_edt

    unknown = (
        np.ma.getmaskarray(field) if isinstance(field, np.ma.MaskedArray) else np.zeros(np.shape(field), dtype=bool)
    )
    values = checks.array("The heightfield", np.ma.getdata(field) if isinstance(field, np.ma.MaskedArray) else field)
    unknown = unknown | np.isnan(values)
    if unknown.all():
        raise InvalidInput("The heightfield has no entry that is known, so there is nothing to fill it with.")
    places = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return values[tuple(places)]


def _call(function: Callable[[Any, Any], Any], layout: Layout) -> NDArray[np.float64]:
    x, y = layout.positions_mm.T
    try:
        given = function(x, y)
        masked = np.ma.isMaskedArray(given) and np.ma.getmaskarray(given).any()
        if not masked and np.asarray(given).dtype.kind in "fiu":
            return np.array(np.broadcast_to(np.asarray(given, dtype=float), x.shape))
    except (TypeError, ValueError):  # it branches on x, or uses math: one bubble after the other
        pass
    values = [function(float(one), float(other)) for one, other in layout.positions_mm]
    for bubble, value in enumerate(values):
        checks.number(f"f(x_mm, y_mm) at bubble {bubble}", value)
    return checks.array("The array of heights", values)


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
