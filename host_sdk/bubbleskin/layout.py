"""Where the bubbles are: positions, order and neighbours."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin import boards
from bubbleskin.checks import above_zero, array, shown, whole
from bubbleskin.errors import InvalidInput
from bubbleskin.files import CellError, Grid, parse_json, path_of, read_table, read_text, width

_PITCH_MM = 10.0  # of one bubble alone
RINGS_MAX = 50
ROWS_MAX = 1000
BUBBLES_MAX = 10_000
_SAME_MM = 1e-3  # in which devices tell where their bubbles are


@dataclass(frozen=True, eq=False)
class Layout:
    """Bubble positions in mm, x to the right and y up, seen from above; entry i is bubble i everywhere."""

    positions_mm: NDArray[np.float64]
    """(n, 2)"""

    pitch_mm: float
    """Distance between the centres of neighbours."""

    def __post_init__(self) -> None:
        positions = array("positions_mm", self.positions_mm)
        if len(positions) > BUBBLES_MAX if positions.ndim else False:
            raise InvalidInput(f"A layout of {len(positions)} bubbles; {BUBBLES_MAX} at most can be meant.")
        if positions.ndim != 2 or positions.shape[1] != 2 or not len(positions):
            raise InvalidInput(f"A layout needs an (n, 2) array of positions in mm; this one is {positions.shape}.")
        if not np.isfinite(positions).all():
            raise InvalidInput("A layout's positions must be finite numbers in mm; one is not.")
        object.__setattr__(self, "pitch_mm", above_zero("The pitch", self.pitch_mm, unit="mm"))
        positions.setflags(write=False)
        object.__setattr__(self, "positions_mm", positions)

    def __len__(self) -> int:
        return len(self.positions_mm)

    def __repr__(self) -> str:
        return f"<Layout of {len(self)} bubbles, {self.pitch_mm:g} mm apart>"

    def __eq__(self, other: object) -> bool:
        """Whether the same bubbles are at the same places, to the µm in which devices tell them."""
        return (
            isinstance(other, Layout)
            and len(self) == len(other)
            and np.allclose(self.positions_mm, other.positions_mm, rtol=0, atol=_SAME_MM)
        )

    @classmethod
    def hexagon(cls, rings: int = 1, pitch_mm: float = 10.0) -> Self:
        """A centre and `rings` rings around it: 7, 19, 37 … bubbles.

        Bubble 0 is the centre; then ring by ring, each counterclockwise from the one on the right.
        """
        rings = whole("rings", rings, 0, RINGS_MAX)
        pitch_mm = above_zero("pitch_mm", pitch_mm, unit="mm")
        corners = [np.array([np.cos(a), np.sin(a)]) for a in np.deg2rad(np.arange(0, 420, 60))]
        places = [np.zeros(2)]
        for ring in range(1, rings + 1):
            for here, there in pairwise(corners):
                places += [ring * here + step * (there - here) for step in range(ring)]
        return cls(np.round(np.array(places) * pitch_mm, 6), pitch_mm)

    @classmethod
    def grid(cls, rows: int, columns: int, pitch_mm: float = 10.0) -> Self:
        """`rows` by `columns` bubbles around the origin; row by row from the lowest y, each from the left."""
        rows, columns = whole("rows", rows, 1, ROWS_MAX), whole("columns", columns, 1, ROWS_MAX)
        pitch_mm = above_zero("pitch_mm", pitch_mm, unit="mm")
        y, x = np.mgrid[0:rows, 0:columns].astype(float)
        places = np.column_stack([x.ravel() - (columns - 1) / 2, y.ravel() - (rows - 1) / 2])
        return cls(places * pitch_mm, pitch_mm)

    @classmethod
    def from_file(cls, path: str | Path) -> Self:
        """Read a file: JSON, `{"pitch_mm": 10, "positions_mm": [[0, 0], [10, 0], …]}`, or a table.

        A table (.csv, .tsv, .txt) has the columns bubble, x_mm and y_mm, a row per bubble; its pitch is the least distance.
        """
        where = path_of(path, "the layout")
        if where.suffix.lower() in (".csv", ".tsv", ".txt"):
            return cls._of_table(read_table(where, "the layout"))
        text = read_text(where, "the layout")
        try:
            data = parse_json(text, "it")
            if not isinstance(data, dict):
                raise InvalidInput(f"it is {shown(data)}.")
            missing = [key for key in ("positions_mm", "pitch_mm") if key not in data]
            if missing:
                raise InvalidInput(f"it has no {missing[0]}.")
            return cls(data["positions_mm"], data["pitch_mm"])
        except InvalidInput as error:
            raise InvalidInput(
                f"{where} is not a layout: {error} It should be JSON like "
                '{"pitch_mm": 10, "positions_mm": [[0, 0], [10, 0], …]}.'
            ) from None

    @classmethod
    def _of_table(cls, table: Grid) -> Self:
        head, *rows = table.rows or [[]]
        names = [re.sub(r"\s*[\[(]mm[\])]$", "_mm", cell.text.lower()) for cell in head]
        if sorted(names) != ["bubble", "x_mm", "y_mm"]:
            raise InvalidInput(
                f"{table.name} begins with the columns {','.join(names)[:200]}; a layout has bubble,x_mm,y_mm."
            )
        places: dict[float, tuple[float, float]] = {}
        for row in rows:
            if misfit := width(table, len(head), row):
                raise InvalidInput(f"{table.name}, line {row[0].line} has {misfit}.")
            try:
                values = {name: table.number(cell) for name, cell in zip(names, row, strict=True)}
            except CellError as error:
                raise InvalidInput(f"{table.name}, line {row[0].line}: a cell {error}.") from None
            if values["bubble"] in places:
                raise InvalidInput(f"{table.name}, line {row[0].line}: bubble {values['bubble']:g} stands there twice.")
            places[values["bubble"]] = values["x_mm"], values["y_mm"]
        if sorted(places) != list(range(len(places))) or not places:
            raise InvalidInput(
                f"{table.name} numbers its bubbles {', '.join(f'{one:g}' for one in sorted(places))[:200] or 'not at all'}; "
                "they count from 0, each once."
            )
        positions = np.array([places[bubble] for bubble in range(len(places))])
        gap = np.linalg.norm(positions[:, None] - positions[None], axis=2)[~np.eye(len(positions), dtype=bool)]
        return cls(positions, float(gap.min()) if gap.size else _PITCH_MM)

    @classmethod
    def from_um(cls, positions_um: ArrayLike, pitch_um: float) -> Self:
        """From whole µm, as boards' files have and devices tell them."""
        return cls(np.asarray(positions_um, dtype=float).reshape(-1, 2) / 1000, pitch_um / 1000)

    @classmethod
    def of_board(cls, board: str | Path) -> Self:
        """The layout in the file of a board, one of the SDK's by its name or any other by the path of its file.

        Raises `InvalidInput` where there is no such board.
        """
        data = boards.load(board)
        return cls.from_um(data.LAYOUT, data.PITCH_UM)

    @cached_property
    def neighbours(self) -> tuple[tuple[int, ...], ...]:
        """For each bubble the bubbles around it, in order of index."""
        gap = np.linalg.norm(self.positions_mm[:, None] - self.positions_mm[None], axis=2)
        near = (gap > 0) & (gap < boards.NEIGHBOUR * self.pitch_mm)
        return tuple(tuple(np.flatnonzero(row).tolist()) for row in near)

    def names(self, bubbles: Sequence[int]) -> str:
        """How to name some bubbles in a sentence: 'bubble 3', 'bubbles 1, 4 and 5'."""
        words = [str(bubble) for bubble in bubbles]
        if len(words) == 1:
            return f"bubble {words[0]}"
        return f"bubbles {', '.join(words[:-1])} and {words[-1]}"
