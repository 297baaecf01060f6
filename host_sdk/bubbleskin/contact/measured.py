"""Shapes that somebody measured: what was held, step by step, and which heights or pressures came of it; and their table."""

from dataclasses import dataclass
from os import PathLike
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin.checks import finite, one_of
from bubbleskin.contact.model import CompliantContact
from bubbleskin.contact.shape import Shape
from bubbleskin.errors import InvalidInput
from bubbleskin.files import Cell, CellError, Grid, read_table, width
from bubbleskin.layout import Layout

Array = NDArray[np.float64]
Held = Literal["pressure", "size"]

HELD = {"held [kpa]": "pressure", "sent [mm]": "size"}
"""Columns of a table, in small letters, and what they say is held."""
_HEIGHT, _PRESSURE = "height [mm]", "pressure [kpa]"
_COLUMNS = "shape, step, bubble, sent [mm], height [mm], pressure [kPa]"
_WHAT = "the table of shapes"


@dataclass(frozen=True, eq=False)
class Measured:
    """A shape that was measured, after the way that led there."""

    steps: ArrayLike
    """(k, n): gauge pressures in Pa, or with `held="size"` heights alone in mm, as they are sent to a wristband."""
    height_mm: ArrayLike | None = None
    """The tops that were found, (n,), nan for none."""
    held: Held = "pressure"
    pressure_pa: ArrayLike | None = None
    """With `held="size"`, what the sensors said, gauge, (n,), nan for none."""


class Checked(NamedTuple):
    """The same in arrays of the right shape."""

    steps: Array
    height_mm: Array
    held: Held
    pressure_pa: Array

    def settled(self, model: CompliantContact) -> Shape:
        """Where `model` ends on this way."""
        return model.settle_sizes(self.steps) if self.held == "size" else model.settle(self.steps)


def checked(one: Measured, layout: Layout) -> Checked:
    """`one` for `layout`; `InvalidInput` for what is no measurement of it."""
    n = len(layout)
    steps = np.atleast_2d(finite("steps", one.steps))
    one_of("held", one.held, ("pressure", "size"))
    heights = _told("Heights", "mm", one.height_mm, n)
    pressures = _told("Pressures", "Pa", one.pressure_pa, n)
    if steps.shape[1] != n or heights.shape != (n,) or pressures.shape != (n,):
        raise InvalidInput(
            f"A measurement of this layout has steps of {n} bubbles and {n} heights; "
            f"one has {steps.shape[1]} and {heights.size if heights.shape != (n,) else pressures.size}."
        )
    if one.held == "pressure" and not np.isnan(pressures).all():
        raise InvalidInput('Pressures that were held say nothing: pressure_pa goes with held="size".')
    if np.isnan(heights).all() and np.isnan(pressures).all():
        raise InvalidInput("A measurement needs at least one height, or one pressure where sizes were held.")
    return Checked(steps, heights, one.held, pressures)


def _told(what: str, unit: str, values: ArrayLike | None, n: int) -> Array:
    if values is None:
        return np.full(n, np.nan)
    try:
        told = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(f"{what} must be numbers of {unit}, nan where none was measured, not {values!r}.") from None
    if np.isinf(told).any():
        raise InvalidInput(f"{what} must be finite, or nan where none was measured; one is infinite.")
    return told


def read_shapes(path: str | PathLike[str], layout: Layout) -> list[Measured]:
    """Read a table: a row for each shape, step and bubble, with what it was sent or held, and what was measured at the end.

    Columns: shape, step, bubble, `sent [mm]` or `held [kPa]`, and `height [mm]`, `pressure [kPa]` or both. A bubble that
    has no row in a step stays as it was, at rest at first. Empty cells were not measured; of several in a shape the last
    step's count. Raises `InvalidInput` with the place of a mistake.
    """
    grid = read_table(path, _WHAT)
    names = [cell.text.lower() for cell in grid.rows[0]] if grid.rows else []
    held = [name for name in names if name in HELD]
    known = {"shape", "step", "bubble", _HEIGHT, _PRESSURE, *HELD}
    missing = {"shape", "step", "bubble"} - set(names)
    if missing or len(held) != 1 or set(names) - known or len(set(names)) < len(names):
        raise InvalidInput(
            f"{grid.name} is not {_WHAT}: its first row must be {_COLUMNS}; held [kPa] instead of sent [mm] where "
            "pressures were held, and one of the last two can be missing."
        )
    rows = [_row(grid, names, cells) for cells in grid.rows[1:]]
    if not rows:
        raise InvalidInput(f"{grid.name} has no shapes below its first row.")
    return [
        _shape([row for row in rows if row["shape"] == number], HELD[held[0]], held[0], layout, grid.name)
        for number in dict.fromkeys(row["shape"] for row in rows)
    ]


def _row(grid: Grid, names: list[str], cells: list[Cell]) -> dict[str, float]:
    if amiss := width(grid, len(names), cells):
        raise InvalidInput(f"{grid.name}, line {cells[0].line}: {amiss}.")
    row = {"line": float(cells[0].line)}
    for name, cell in zip(names, cells, strict=True):
        try:
            row[name] = np.nan if not cell.text and name in (_HEIGHT, _PRESSURE) else grid.number(cell)
        except CellError as error:
            raise InvalidInput(f"{grid.place(cell, name)} {error}.") from None
        if name in ("shape", "step", "bubble") and (row[name] != round(row[name]) or row[name] < 0):
            raise InvalidInput(f"{grid.place(cell, name)} is {cell.text}; it must be a whole number from 0 on.")
    return row


def _shape(rows: list[dict[str, float]], kind: str, column: str, layout: Layout, name: str) -> Measured:
    n = len(layout)
    now, steps = np.zeros(n), []
    told = {_HEIGHT: np.full(n, np.nan), _PRESSURE: np.full(n, np.nan)}
    for step in sorted({row["step"] for row in rows}):
        now = now.copy()
        for row in (row for row in rows if row["step"] == step):
            bubble = round(row["bubble"])
            if bubble >= n:
                raise InvalidInput(
                    f"{name}, line {row['line']:.0f} is of bubble {bubble}; the layout has 0 to {n - 1}."
                )
            now[bubble] = row[column]
            for quantity, values in told.items():
                values[bubble] = row.get(quantity, np.nan)
        steps.append(now)
    if kind == "size":
        return Measured(np.array(steps), told[_HEIGHT], "size", 1e3 * told[_PRESSURE])
    return Measured(1e3 * np.array(steps), told[_HEIGHT])
