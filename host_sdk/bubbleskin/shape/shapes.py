"""Ready-made shapes, and heights from files and from the command line's arguments."""

import math
import os
import re
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.files import Cell, CellError, Grid, path_of, read_npy, read_table
from bubbleskin.layout import Layout
from bubbleskin.shape.heightfield import filled

_UNKNOWN = ("", "nan", "na", "n/a", "-9999", "-9999.0")
"""What programs write where they know nothing."""
LOW_MM, HIGH_MM = 5.5, 12.0
"""Lowest and highest of the ready-made shapes."""


def dome(layout: Layout) -> NDArray[np.float64]:
    """Highest in the middle, a sphere's cap falling to 6.5 mm at the outermost bubbles, (n,)."""
    _check(layout)
    distance = np.linalg.norm(layout.positions_mm, axis=1)
    return HIGH_MM - 5.5 * (distance / max(distance.max(), 1e-9)) ** 2


def plane(layout: Layout) -> NDArray[np.float64]:
    """Rising from 5.5 mm on the left to 12 mm on the right, (n,)."""
    x = _check(layout).positions_mm[:, 0]
    share = (x - x.min()) / max(np.ptp(x), 1e-9)
    return LOW_MM + (HIGH_MM - LOW_MM) * share


def flat(layout: Layout) -> NDArray[np.float64]:
    """Every bubble at rest, without pressure, (n,)."""
    return np.zeros(len(_check(layout)))


def _check(layout: Layout) -> Layout:
    return checks.instance("layout", layout, Layout, "a Layout, such as skin.layout or Layout.hexagon()")


SHAPES: dict[str, Callable[[Layout], NDArray[np.float64]]] = {"dome": dome, "plane": plane, "flat": flat}


def parse_heights(texts: Sequence[str]) -> NDArray[np.float64]:
    """Heights in mm, (n,), from one text each. Raises `InvalidInput` for one that is not a number."""
    table = Grid("the command line", " ", [])
    heights = []
    for position, text in enumerate(texts, 1):
        if re.match(r"--|-[a-z]", text, re.I):
            raise InvalidInput(f"There is no option {checks.shown(text)}; see --help.")
        if text in SHAPES:
            raise InvalidInput(f"{text!r} is no height in mm; the shape of that name is --shape {text}.")
        if text.lower().endswith((".npy", ".csv")):
            raise InvalidInput(
                f"{checks.shown(text)} is no height in mm; the heightfield of that file is --file {text}."
            )
        try:
            heights.append(table.number(Cell(text.strip(), 1, position)))
        except CellError as error:
            raise InvalidInput(
                f"{checks.shown(text)}, for bubble {position - 1}, is not a height in mm: it {error}. Give one for each bubble."
            ) from None
    return np.array(heights)


def load(path: str | os.PathLike[str], fill: str | None = None) -> NDArray[np.float64]:
    """A heightfield in mm from a .npy file, or from a table of numbers without a header, as `bubbleskin.files` reads them.

    Empty cells, nan and -9999 are entries that are not known: refused with their places, or, with `fill` 'nearest', given
    the number of the nearest one. Raises `InvalidInput` for a file that cannot be read or holds something else.
    """
    what = "a heightfield"
    where = path_of(path, what)
    field = read_npy(where, what) if where.suffix.lower() == ".npy" else _table(read_table(where, what))
    if fill is not None and field.ndim == 2:
        return filled(field, fill)
    checks.refuse_places(f"The heightfield {where}", "not known", np.isnan(field))
    checks.finite(f"The heightfield {where}", field)
    return field


def _table(table: Grid) -> NDArray[np.float64]:
    """The numbers of a table, nan where there is none; one line is one height per bubble."""
    rows: list[list[float]] = []
    columns = len(table.rows[0]) if table.rows else 0
    if not columns:
        raise InvalidInput(f"{table.name} is not a heightfield: it has no numbers.")
    for cells in table.rows:
        if len(cells) != columns:
            raise InvalidInput(
                f"{table.name}, line {cells[0].line} has {len(cells)} numbers and the line before it {columns}; "
                "a heightfield has as many in each. Part them by commas, semicolons or tabs."
            )
        rows.append([_entry(table, cell) for cell in cells])
    field = np.array(rows)
    return field[0] if len(field) == 1 else field[:, 0] if columns == 1 else field


def _entry(table: Grid, cell: Cell) -> float:
    if cell.text.lower() in _UNKNOWN:
        return math.nan
    try:
        return table.number(cell)
    except CellError as error:
        raise InvalidInput(
            f"{table.place(cell)}: it {error}. {table.name} is not a heightfield; one is numbers alone, parted by commas."
        ) from None
