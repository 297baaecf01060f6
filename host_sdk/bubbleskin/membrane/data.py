"""Measurements as a table in a text file, units in the header.

    # simulated
    bubble,step,height [mm],pressure [kPa]
    0,0,5.412,6.83

``height`` and ``pressure`` must be there, each with its unit; ``bubble`` (a whole number, 0 if absent),
``step`` (the setting; rows of one bubble with the same step are repeats), ``height_sd`` and ``pressure_sd``
may be. Units may stand in a row below the header instead. How the table itself may look is for ``bubbleskin.files`` to say.

Numbers of bubbles are their identity: they are kept, from the file to the device. They count from 0; a file that counts
from 1 is read with ``first=1``.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bubbleskin.checks import flag, shown, whole
from bubbleskin.errors import InvalidInput
from bubbleskin.files import Cell, CellError, Grid, read_table, width, write_text

UNITS = {
    "height": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6},
    "pressure": {
        "pa": 1.0, "hpa": 100.0, "kpa": 1e3, "mpa": 1e6, "mbar": 100.0, "bar": 1e5, "psi": 6894.757293168,
        "mmhg": 133.322387415,
    },
}  # fmt: skip
NUMBERED = ("bubble", "step")
MEASURED = ("height", "pressure", "height_sd", "pressure_sd")
_NUMBER_MAX = 1_000_000  # of a bubble or a step
_HEADING = re.compile(r"^(?P<name>[a-z_]+?)\s*(?:[\[(]\s*(?P<unit>\S+?)\s*[\])]|_(?P<tail>[a-zµμ]+))?$", re.I)


@dataclass(frozen=True)
class Measurements:
    """Points of one or many bubbles: ``height`` (m) and ``pressure`` (Pa, gauge), (n,) each.

    ``bubble`` (n,) numbers the bubble, ``step`` (n,) the setting if it is known, ``height_sd`` and
    ``pressure_sd`` are the noise of each point if the file gave it. ``source`` says where they come from.
    """

    height: np.ndarray
    pressure: np.ndarray
    bubble: np.ndarray
    step: np.ndarray | None = None
    height_sd: np.ndarray | None = None
    pressure_sd: np.ndarray | None = None
    source: str = ""

    def __len__(self) -> int:
        return int(self.height.size)

    @property
    def bubbles(self) -> list[int]:
        """The numbers of the bubbles measured, ascending."""
        return [int(n) for n in np.unique(self.bubble)]

    def of(self, bubble: int) -> Measurements:
        """The points of one bubble."""
        mask = self.bubble == bubble

        def cut(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else values[mask]

        return Measurements(
            self.height[mask], self.pressure[mask], self.bubble[mask], cut(self.step), cut(self.height_sd),
            cut(self.pressure_sd), self.source,
        )  # fmt: skip


class BadRowWarning(UserWarning):
    """Rows of a file were left out."""


def read_csv(path: str | Path, *, skip_bad_rows: bool = False, first: int = 0) -> Measurements:
    """Read measurements from the file ``path``, in the format that this module's text shows.

    ``first`` is the number that the file gives to what is bubble 0 here. Raises ``InvalidInput`` with the line numbers of all
    bad rows; with ``skip_bad_rows`` they are left out and named in a :class:`BadRowWarning` instead.
    """
    flag("skip_bad_rows", skip_bad_rows)
    first = whole("first", first, 0, 1)
    table = read_table(path, "the measurements")
    if not table.rows:
        raise InvalidInput(f"{table.name} holds no measurements.")
    columns, below = _columns(table)
    rows, bad = [], []
    for cells in below:
        try:
            rows.append(_row(table, columns, cells, first))
        except CellError as error:
            bad.append(f"line {cells[0].line}: {error}")
    if bad:
        shown = "; ".join(bad[:5]) + (f"; and {len(bad) - 5} more" if len(bad) > 5 else "")
        if not skip_bad_rows:
            raise InvalidInput(f"{table.name} has {len(bad)} bad row{'s' * (len(bad) > 1)}: {shown}.")
        warnings.warn(f"left out of {table.name}: {shown}.", BadRowWarning, stacklevel=2)
    if not rows:
        raise InvalidInput(f"{table.name} has a header but no usable row below it.")
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    bubble = values.get("bubble", np.zeros(len(rows))).astype(int)
    step = values["step"].astype(int) if "step" in values else None
    sds = values.get("height_sd"), values.get("pressure_sd")
    return Measurements(values["height"], values["pressure"], bubble, step, *sds, source=Path(table.name).name)


def write_csv(path: str | Path, measurements: Measurements, *, comments: Iterable[str] = ()) -> None:
    """Write ``measurements`` to ``path`` so that :func:`read_csv` reads them again; see :func:`to_csv`."""
    write_text(path, to_csv(measurements, comments=comments), "the measurements")


def to_csv(measurements: Measurements, *, comments: Iterable[str] = ()) -> str:
    """The text of a file of ``measurements``, in mm and kPa, to 1 µm and 1 Pa."""
    heading = [
        "bubble",
        *(["step"] if measurements.step is not None else []),
        "height [mm]",
        "pressure [kPa]",
    ]
    lines = [f"# {comment}" for comment in comments] + [",".join(heading)]
    for k in range(len(measurements)):
        cells = [str(int(measurements.bubble[k]))]
        if measurements.step is not None:
            cells.append(str(int(measurements.step[k])))
        cells += [f"{measurements.height[k] * 1e3:.3f}", f"{measurements.pressure[k] / 1e3:.3f}"]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def _columns(table: Grid) -> tuple[list[tuple[str, float] | None], list[list[Cell]]]:
    """Name and factor to SI of each column, None for one that is not ours; and the rows below header and units."""
    header, *below = table.rows
    names = [_heading(cell.text) for cell in header]
    if below and len(below[0]) <= len(header) and all(_is_unit(cell.text) for cell in below[0]):
        units, *below = below
        for k, cell in enumerate(units):
            name, unit = names[k]
            if unit and cell.text and _factor(name, unit) != _factor(name, cell.text):
                raise InvalidInput(
                    f"{table.place(cell, header[k].text[:60])}: the unit is {shown(unit)} in the header "
                    f"and {shown(cell.text)} here; keep one."
                )
            names[k] = name, unit or cell.text or None
    columns = [_column(table, cell.text, *named) for cell, named in zip(header, names, strict=True)]
    found = [column[0] for column in columns if column]
    for name in ("height", "pressure"):
        if found.count(name) != 1:
            raise InvalidInput(
                f"{table.name} must have one column of {name} with its unit, such as {_example(name)}; it has "
                f"{found.count(name) or 'none'}. Its header reads: {', '.join(cell.text for cell in header)[:200]}."
            )
    for name in {name for name in found if found.count(name) > 1}:
        raise InvalidInput(f"{table.name} has {found.count(name)} columns of {name}; keep one.")
    return columns, below


def _heading(text: str) -> tuple[str, str | None]:
    """Name and unit in one cell of a header."""
    match = _HEADING.match(text.replace(" sd", "_sd"))
    name, unit = (match["name"].lower(), match["unit"] or match["tail"]) if match else (text.lower(), None)
    return (f"{name}_sd", None) if unit == "sd" else (name, unit)


def _factor(name: str, unit: str) -> float | None:
    """What one of this unit is in SI; None for a unit that is none of this quantity."""
    known = UNITS.get(name.removesuffix("_sd"), {})
    return None if unit == "mPa" else known.get(unit.strip("[]() ").lower())


def _is_unit(text: str) -> bool:
    return not text or any(_factor(name, text) for name in UNITS) or text in ("-", "#", "1")


def _example(name: str) -> str:
    return f"'{name} [{'mm' if name.startswith('height') else 'kPa'}]'"


def _column(table: Grid, text: str, name: str, unit: str | None) -> tuple[str, float] | None:
    if name in NUMBERED:
        return name, 1.0
    if name not in MEASURED:
        return None
    if unit is None:
        raise InvalidInput(
            f"{table.name}: the column {shown(text)} has no unit; write it in the header, as {_example(name)}."
        )
    factor = _factor(name, unit)
    if factor is None:
        quantity = name.removesuffix("_sd")
        raise InvalidInput(
            f"{table.name}: {shown(unit)} in the column {shown(text)} is no unit of {quantity} known here; "
            f"there are {', '.join(UNITS[quantity])}."
        )
    return name, factor


def _row(table: Grid, columns: list[tuple[str, float] | None], cells: list[Cell], first: int) -> dict[str, float]:
    """One row in SI; raises `CellError` with the reason."""
    if misfit := width(table, len(columns), cells):
        raise CellError(misfit)
    row = {}
    for column, cell in zip(columns, cells, strict=True):
        if column is None:
            continue
        name, factor = column
        if not cell.text:
            raise CellError(f"{name} is missing")
        try:
            value = table.number(cell)
        except CellError as error:
            raise CellError(f"{name} {error}") from None
        if name in NUMBERED and not (0 <= value <= _NUMBER_MAX and value == int(value)):
            raise CellError(f"{name} is {cell.text[:60]}, not a whole number")
        if name in ("height", "height_sd", "pressure_sd") and value <= 0:
            raise CellError(f"{name} is {cell.text[:60]}, but must be above zero")
        if name == "bubble":
            value -= first
            if value < 0:
                raise CellError(f"bubble is {cell.text[:60]}, and bubbles are said to count from {first}")
        row[name] = value * factor
    return row
