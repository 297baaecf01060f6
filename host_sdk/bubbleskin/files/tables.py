"""Tables as text, as people and their programs save them: one reader for measurements, timelines, layouts and heightfields.

Understood are columns parted by commas, semicolons or tabs, quotes, a line `sep=;`, decimal commas where commas do not part
columns, comments after #, empty rows and cells at the end. What could mean two things is refused with what to write.
"""

import csv
import math
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput
from bubbleskin.files.reading import path_of, read_text

CELLS_MAX = 5_000_000
_SEPARATORS = "\t;,"
_NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas"}
_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[+-]?\d{1,4})?", re.ASCII | re.I)
_THOUSANDS = re.compile(
    r"[+-]?\d{1,3}(?:(?:\.\d{3})+,\d*|(?:,\d{3})+\.\d*|(?:[.,]\d{3}){2,}|(?:['\s]\d{3})+(?:[.,]\d*)?)", re.ASCII
)


class CellError(ValueError):
    """A cell that is no number; its text says why."""


class Cell(NamedTuple):
    """What stands in one place of a table."""

    text: str
    line: int
    column: int
    """Counted from 1."""


class Grid:
    """The rows of a table that are not empty, cell by cell; `name` is its file's."""

    def __init__(self, name: str, separator: str, rows: list[list[Cell]]):
        self.name = name
        self.separator = separator
        self.rows = rows
        self._decimal: dict[str, Cell] = {}  # the first cell with each decimal mark

    def number(self, cell: Cell) -> float:
        """The number in a cell; `CellError` where there is none, or where it could be two."""
        text = cell.text.replace("\N{MINUS SIGN}", "-")
        if text.lower().lstrip("+-") in ("nan", "inf", "infinity"):
            raise CellError(f"is {cell.text}, not a number")
        if _THOUSANDS.fullmatch(text):
            raise CellError(f"is {shown(cell.text)}: write thousands without a mark, such as 1234.5")
        if not _NUMBER.fullmatch(text):
            raise CellError(f"is {shown(cell.text)}, not a number")
        for mark in ",.":
            if mark in text:
                self._decimal.setdefault(mark, cell)
        if len(self._decimal) == 2:
            comma, point = self._decimal[","], self._decimal["."]
            raise CellError(
                f"is {shown(cell.text)}: {comma.text[:40]} in line {comma.line} has a decimal comma and "
                f"{point.text[:40]} in line {point.line} a point. Write all with points"
            )
        value = float(text.replace(",", "."))
        if not math.isfinite(value):
            raise CellError(f"is {shown(cell.text)}, which is beyond every number")
        return value

    def place(self, cell: Cell, heading: str = "") -> str:
        """Where a cell stands, for a sentence."""
        return f"{self.name}, line {cell.line}, column {heading[:60] or cell.column}"


def read_table(path: Any, what: str) -> Grid:
    """The table in the file of `what`."""
    text = read_text(path, what)
    return parse_table(text, str(path_of(path, what)))


def parse_table(text: str, name: str) -> Grid:
    """The table in a text; `name` is how sentences call it."""
    lines = text.split("\n")
    given = _given_separator(lines)
    content = [line for line in lines if line.strip() and not line.lstrip().lstrip('"').startswith("#")]
    separator = given or _separator(content[0] if content else "")
    rows: list[list[Cell]] = []
    cells = 0
    try:
        for line, parts in _split(lines, separator):
            row = [Cell(part.strip(), line, k) for k, part in enumerate(parts, 1)]
            if not any(cell.text for cell in row) or row[0].text.startswith("#"):
                continue
            while not row[-1].text and len(row) > (len(rows[0]) if rows else 1):  # what programs leave beyond a table
                row.pop()
            cells += len(row)
            if cells > CELLS_MAX:
                raise InvalidInput(f"{name} has more than {CELLS_MAX} cells.")
            rows.append(row)
    except csv.Error as error:
        raise InvalidInput(f"{name} is not a table that can be read: {error}.") from None
    return Grid(name, separator, rows)


def _split(lines: list[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each line; a quoted cell ends in its line, so that one forgotten quote is named."""
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            for parts in csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True):
                yield number, parts
        except csv.Error as error:
            raise csv.Error(f"line {number}: {error}") from None


def _given_separator(lines: list[str]) -> str:
    """What a first line such as `sep=;` says, and that line taken out."""
    first = lines[0].strip().strip('"') if lines else ""
    if first.lower().startswith("sep=") and len(first) == 5 and first[4] in _SEPARATORS:
        lines[0] = ""
        return first[4]
    if lines and lines[0].startswith("sep=\t"):
        lines[0] = ""
        return "\t"
    return ""


def _separator(line: str) -> str:
    """What parts the columns of a first line: a tab or a semicolon where there is one outside quotes, else a comma."""
    bare = re.sub(r'"[^"]*"', "", line)
    return next((mark for mark in "\t;" if mark in bare), ",")


def width(grid: Grid, columns: int, cells: list[Cell]) -> str:
    """Why a row does not fit under so many headings; empty where it does."""
    if len(cells) == columns:
        return ""
    advice = ""
    if (
        grid.separator == ","
        and len(cells) == 2 * columns
        and all(re.fullmatch(r"[+-]?\d+", cell.text) for cell in cells)
    ):
        advice = "; if the commas are decimal commas, part the columns by semicolons or write points"
    return f"{len(cells)} cells under {columns} headings{advice}"
