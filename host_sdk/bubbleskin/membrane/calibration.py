"""The calibration of one wristband: a table per bubble, in a text file that a person can read and diff.

The file is TOML. Every knot has its own line, so a diff shows which height moved by how many Pa; the
constants behind each table stand beside it, with their units and where they come from. The CRC-32 over
all tables is the one that the firmware reports.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bubbleskin.checks import finite, shown
from bubbleskin.errors import InvalidInput
from bubbleskin.files import parse_toml, read_text, write_text
from bubbleskin.membrane.balloon import YeohBalloon
from bubbleskin.membrane.table import MAX_KNOTS, Table, build_table
from bubbleskin.pictured import Pictured

SCHEMA = 1
CONSTANTS = ("mu_pa", "c2_pa", "c3_pa", "thickness_m", "radius_m", "wall", "surface")


@dataclass(frozen=True)
class Calibration(Pictured):
    """The tables of a board's bubbles in layout order, and ``source``, a sentence on where they come from."""

    board: str
    tables: tuple[Table, ...]
    source: str = ""

    @classmethod
    def build(
        cls,
        board: str,
        balloons: Sequence[YeohBalloon],
        *,
        source: str,
        height_mm: tuple[float, float] = (5.0, 14.0),
        knots: int = MAX_KNOTS,
    ) -> Calibration:
        """Build one table per balloon, as :func:`build_table` does."""
        if not balloons:
            raise InvalidInput("a calibration needs at least one balloon.")
        tables = (build_table(balloon, height_mm=height_mm, knots=knots) for balloon in balloons)
        return cls(board, tuple(tables), source)

    def __repr__(self) -> str:
        return f"<Calibration of a {self.board}: {len(self.tables)} tables, CRC-32 {self.crc32:08x}>"

    @property
    def crc32(self) -> int:
        """CRC-32 of all tables' bytes one after the other, as the firmware computes it."""
        return zlib.crc32(b"".join(table.to_bytes() for table in self.tables))

    def table(self, bubble: int) -> Table:
        """The table of one bubble, counted from 0."""
        if not 0 <= bubble < len(self.tables):
            raise InvalidInput(f"there is no bubble {bubble}: they are numbered 0 to {len(self.tables) - 1}.")
        return self.tables[bubble]

    def report(self) -> str:
        """The tables in a few lines of text: their ends, their bound, their checksums."""
        lines = [f"{self.board}: {len(self.tables)} tables, CRC-32 {self.crc32:08x}; {self.source}"]
        for bubble, table in enumerate(self.tables):
            bound = ""
            if table.balloon is not None:
                error = table.max_error()
                bound = f", every height within {error.pressure_pa:.1f} Pa or {error.height_um:.1f} µm"
            lines.append(
                f"  bubble {bubble}: {len(table)} knots from {table.height_um[0] / 1000:.3f} mm to "
                f"{table.height_um[-1] / 1000:.3f} mm, {table.pressure_pa.max() / 1000:.3f} kPa{bound}"
            )
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Everything as plain numbers with units in their names, for JSON."""
        bubbles = []
        for table in self.tables:
            one: dict[str, Any] = {
                "height_um": table.height_um.tolist(),
                "pressure_pa": table.pressure_pa.tolist(),
                "crc32": f"{table.crc32:08x}",
            }
            if table.balloon is not None:
                error = table.max_error()
                one["max_error"] = {"pressure_pa": error.pressure_pa, "height_um": error.height_um}
            bubbles.append(one)
        return {
            "board": self.board, "source": self.source, "crc32": f"{self.crc32:08x}", "bubbles": bubbles,
        }  # fmt: skip

    def differences(self, other: Calibration) -> list[str]:
        """What differs in ``other``, one sentence each; empty if both run the firmware alike."""
        found = []
        if self.board != other.board:
            found.append(f"board: {self.board} here, {other.board} there")
        if len(self.tables) != len(other.tables):
            found.append(f"bubbles: {len(self.tables)} here, {len(other.tables)} there")
        for bubble, (mine, theirs) in enumerate(zip(self.tables, other.tables, strict=False)):
            difference = table_difference(mine, theirs)
            if difference:
                found.append(f"bubble {bubble}: {difference}")
        return found

    def save(self, path: str | Path) -> None:
        """Write the calibration as text to ``path``."""
        write_text(path, self.to_text(), "the calibration")

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read what :meth:`save` wrote; raises ``InvalidInput`` saying what is wrong with the file."""
        return cls.from_text(read_text(path, "the calibration"), name=str(path))

    def to_text(self) -> str:
        """The file's text."""
        lines = [
            "# Heights to gauge pressures, one table per bubble, in layout order.",
            f"schema = {SCHEMA}",
            f"board = {_string(self.board)}",
            f"source = {_string(self.source)}",
            f'crc32 = "{self.crc32:08x}" # of all knots; delete this line after editing knots by hand',
            'units = { height = "µm", pressure = "Pa, gauge" }',
        ]
        for bubble, table in enumerate(self.tables):
            lines += ["", "[[bubble]]", f"number = {bubble}", *_constants(table.balloon)]
            if table.balloon is not None:
                error = table.max_error()
                within = f"{error.pressure_pa:.1f} Pa or {error.height_um:.1f} µm"
                lines.append(f"# every height within {within} of the curve of these constants")
            lines.append("knots = [")
            lines += [f"  [{h}, {p}]," for h, p in zip(table.height_um, table.pressure_pa, strict=True)]
            lines.append("]")
        return "\n".join(lines) + "\n"

    @classmethod
    def from_text(cls, text: str, *, name: str = "calibration") -> Calibration:
        """The calibration that :meth:`to_text` wrote."""
        data = parse_toml(text, name)
        if data.get("schema") != SCHEMA:
            raise InvalidInput(
                f"{name} has schema {shown(data.get('schema'))}, but this version reads schema {SCHEMA}: make it "
                "again with 'bubbleskin table'."
            )
        bubbles = data.get("bubble")
        if not isinstance(bubbles, list) or not bubbles:
            raise InvalidInput(f"{name} has no [[bubble]] in it.")
        tables = []
        for number, bubble in enumerate(bubbles):
            stands = bubble.get("number") if isinstance(bubble, dict) else None
            if stands != number or isinstance(stands, bool):
                raise InvalidInput(
                    f"{name}: bubbles must be numbered 0, 1, 2, ... in this order; where {number} is due stands {shown(stands)}."
                )
            try:
                tables.append(_table(bubble))
            except InvalidInput as error:
                raise InvalidInput(f"{name}, bubble {number}: {error}") from None
        found = cls(str(data.get("board", "")), tuple(tables), str(data.get("source", "")))
        stated = data.get("crc32")
        if stated is not None and stated != f"{found.crc32:08x}":
            raise InvalidInput(
                f"{name}: its knots have CRC-32 {found.crc32:08x}, but it says {shown(stated)}. If you edited "
                "them by hand, delete the line crc32; otherwise the file is damaged."
            )
        return found


def table_difference(mine: Table, theirs: Table) -> str:
    """How two tables differ, in one sentence; nothing if they are the same."""
    if mine == theirs:
        return ""
    h = np.union1d(mine.height_um, theirs.height_um)
    off = theirs.pressure_at(h) - mine.pressure_at(h)
    worst = int(np.argmax(np.abs(off)))
    moved = f"{len(mine)} knots here, {len(theirs)} there; " if len(mine) != len(theirs) else ""
    return f"{moved}at most {off[worst]:+d} Pa apart, at {h[worst] / 1000:.3f} mm"


def compare_tables(mine: Iterable[Table], theirs: Iterable[Table]) -> list[str]:
    """Sentences on how two sets of tables differ, as after reading them back from a board."""
    return Calibration("", tuple(mine)).differences(Calibration("", tuple(theirs)))


def _constants(balloon: YeohBalloon | None) -> list[str]:
    if balloon is None:
        return []
    values = (
        balloon.mu, balloon.c2, balloon.c3, balloon.thickness, balloon.radius, balloon.wall, balloon.surface,
    )  # fmt: skip
    shown = (_string(v) if isinstance(v, str) else f"{v!r}" for v in values)
    return [f"{key} = {value}" for key, value in zip(CONSTANTS, shown, strict=True)]


def _table(bubble: dict[str, Any]) -> Table:
    knots = finite("knots", bubble.get("knots", []))
    if knots.ndim != 2 or knots.shape[1] != 2:
        raise InvalidInput("knots must be rows of [height in µm, pressure in Pa].")
    balloon = None
    if all(key in bubble for key in CONSTANTS):
        mu, c2, c3, thickness, radius, wall, surface = (bubble[key] for key in CONSTANTS)
        balloon = YeohBalloon(mu=mu, c2=c2, c3=c3, thickness=thickness, radius=radius, wall=wall, surface=surface)
    return Table(knots[:, 0], knots[:, 1], balloon)


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # a TOML basic string
