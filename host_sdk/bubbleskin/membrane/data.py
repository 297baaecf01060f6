"""Measurements as a table in a text file, units in the header.

    # simulated
    bubble,step,height [mm],pressure [kPa]
    0,0,5.412,6.83

``height`` and ``pressure`` must be there, each with its unit; ``bubble`` (a whole number, 0 if absent),
``step`` (the setting; rows of one bubble with the same step are repeats), ``height_sd`` and ``pressure_sd``
may be. Lines that begin with # and empty lines are passed over. Columns are parted by commas, semicolons or
tabs; with semicolons a decimal comma is understood.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bubbleskin.errors import InvalidInput

UNITS = {
    "height": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6},
    "pressure": {
        "pa": 1.0, "hpa": 100.0, "kpa": 1e3, "mpa": 1e6, "mbar": 100.0, "bar": 1e5, "psi": 6894.757293168,
        "mmhg": 133.322387415,
    },
}  # fmt: skip
NUMBERED = ("bubble", "step")
MEASURED = ("height", "pressure", "height_sd", "pressure_sd")
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


def read_csv(path: str | Path, *, skip_bad_rows: bool = False) -> Measurements:
    """Read measurements from the file ``path``, in the format that this module's text shows.

    Raises ``InvalidInput`` with the line numbers of all bad rows; with ``skip_bad_rows`` they are left out
    and named in a :class:`BadRowWarning` instead.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InvalidInput(f"cannot read {path}: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise InvalidInput(f"{path} is not text in UTF-8: save it as CSV.") from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise InvalidInput(f"{path} holds no measurements.")
    separator = next((c for c in (";", "\t") if c in lines[0][1]), ",")
    columns = _heading(path, lines[0][1].split(separator))
    rows, bad = [], []
    for number, line in lines[1:]:
        try:
            rows.append(_row(columns, [cell.strip() for cell in line.split(separator)], separator))
        except ValueError as error:
            bad.append(f"line {number}: {error}")
    if bad:
        shown = "; ".join(bad[:5]) + (f"; and {len(bad) - 5} more" if len(bad) > 5 else "")
        if not skip_bad_rows:
            raise InvalidInput(f"{path} has {len(bad)} bad row{'s' * (len(bad) > 1)}: {shown}.")
        warnings.warn(f"left out of {path}: {shown}.", BadRowWarning, stacklevel=2)
    if not rows:
        raise InvalidInput(f"{path} has a header but no usable row below it.")
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    bubble = values.get("bubble", np.zeros(len(rows))).astype(int)
    step = values["step"].astype(int) if "step" in values else None
    sds = values.get("height_sd"), values.get("pressure_sd")
    return Measurements(values["height"], values["pressure"], bubble, step, *sds, source=path.name)


def write_csv(path: str | Path, measurements: Measurements, *, comments: Iterable[str] = ()) -> None:
    """Write ``measurements`` to ``path`` so that :func:`read_csv` reads them again; see :func:`to_csv`."""
    Path(path).write_text(to_csv(measurements, comments=comments), encoding="utf-8")


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


def _heading(path: Path, cells: list[str]) -> list[tuple[str, float] | None]:
    """Name and factor to SI of each column; None for one that is not ours."""
    columns: list[tuple[str, float] | None] = []
    for cell in (cell.strip().strip('"') for cell in cells):
        match = _HEADING.match(cell.replace(" sd", "_sd"))
        name, unit = (match["name"].lower(), match["unit"] or match["tail"]) if match else (cell.lower(), None)
        if unit == "sd":
            name, unit = f"{name}_sd", None
        if name in NUMBERED:
            columns.append((name, 1.0))
        elif name in MEASURED:
            known = UNITS[name.removesuffix("_sd")]
            example = f"'{name} [{'mm' if name.startswith('height') else 'kPa'}]'"
            if unit is None:
                raise InvalidInput(f"{path}: the column {cell!r} has no unit; write it in the header, as {example}.")
            if unit.lower() not in known or unit == "mPa":
                raise InvalidInput(
                    f"{path}: {unit!r} in the column {cell!r} is no unit of {name.removesuffix('_sd')} known "
                    f"here; there are {', '.join(known)}."
                )
            columns.append((name, known[unit.lower()]))
        else:
            columns.append(None)
    names = [column[0] for column in columns if column]
    for name in ("height", "pressure"):
        if names.count(name) != 1:
            found = "none" if name not in names else str(names.count(name))
            raise InvalidInput(
                f"{path} must have one column of {name} with its unit, such as "
                f"'{name} [{'mm' if name == 'height' else 'kPa'}]'; it has {found}. "
                f"Its header reads: {', '.join(cells)}."
            )
    return columns


def _row(columns: list[tuple[str, float] | None], cells: list[str], separator: str) -> dict[str, float]:
    """One row in SI; raises ValueError with the reason."""
    if len(cells) != len(columns):
        raise ValueError(f"{len(cells)} cells under {len(columns)} headings")
    row = {}
    for column, cell in zip(columns, cells, strict=True):
        if column is None:
            continue
        name, factor = column
        try:
            value = float(cell.replace(",", ".") if separator == ";" else cell)
        except ValueError:
            raise ValueError(f"{name} is {cell!r}, not a number" if cell else f"{name} is missing") from None
        if not math.isfinite(value):
            raise ValueError(f"{name} is {cell}")
        if name in NUMBERED and (value < 0 or value != int(value)):
            raise ValueError(f"{name} is {cell}, not a whole number")
        if name in ("height", "height_sd", "pressure_sd") and value <= 0:
            raise ValueError(f"{name} is {cell}, but must be above zero")
        row[name] = value * factor
    return row
