"""Heights that somebody has measured, in a table: what the wristband told, and what a camera or a calliper says."""

from os import PathLike

from bubbleskin.errors import InvalidInput
from bubbleskin.files import Cell, CellError, Grid, read_table, width

COLUMNS = ("bubble", "told [mm]", "measured [mm]")
_WHAT = "the table of heights"


def read_heights(path: str | PathLike[str]) -> dict[int, list[tuple[float, float]]]:
    """By bubble, pairs of a height told and one measured, mm: what `SelfCalibration.refined` takes.

    The file is a table with the columns `COLUMNS`; `InvalidInput` names the place of a mistake.
    """
    grid = read_table(path, _WHAT)
    if not grid.rows or tuple(cell.text.lower() for cell in grid.rows[0]) != COLUMNS:
        raise InvalidInput(f"{grid.name} is not {_WHAT}: its first row must be {', '.join(COLUMNS)}.")
    found: dict[int, list[tuple[float, float]]] = {}
    for cells in grid.rows[1:]:
        if amiss := width(grid, len(COLUMNS), cells):
            raise InvalidInput(f"{grid.name}, line {cells[0].line}: {amiss}.")
        bubble, told, measured = (_number(grid, cell, name) for cell, name in zip(cells, COLUMNS, strict=True))
        if bubble != round(bubble) or bubble < 0:
            raise InvalidInput(f"{grid.place(cells[0], COLUMNS[0])} is {cells[0].text}; bubbles count from 0.")
        found.setdefault(round(bubble), []).append((told, measured))
    if not found:
        raise InvalidInput(f"{grid.name} has no heights below its first row.")
    return found


def _number(grid: Grid, cell: Cell, name: str) -> float:
    try:
        return grid.number(cell)
    except CellError as error:
        raise InvalidInput(f"{grid.place(cell, name)} {error}.") from None
