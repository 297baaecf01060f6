"""What a bench writes into a page: tables, between two marks."""

from collections.abc import Iterable
from pathlib import Path

from bubbleskin import files


def with_tables(path: Path, begin: str, end: str, tables: str) -> str:
    """The page at `path` with `tables` in place of what stands between the lines `begin` and `end`."""
    before, rest = files.read_text(path, "the page").split(begin)
    return before + begin + "\n" + tables + "\n" + end + rest.split(end)[1]


def table_row(cells: Iterable[str]) -> str:
    """A line of a table."""
    return "| " + " | ".join(cells) + " |"
