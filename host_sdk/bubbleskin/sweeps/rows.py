"""Rows of a sweep: kept line by line while it runs, and written as a table at its end."""

import csv
import io
import json
import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from bubbleskin.errors import InvalidInput
from bubbleskin.files import guarded, write_text
from bubbleskin.sweeps.study import Study

Row = dict[str, Any]
SUFFIXES = (".csv", ".parquet")
_PARTIAL = ".partial.jsonl"


class Rows:
    """Rows of `study`, by the numbers of their points. Where there is a path they are kept in `NAME.partial.jsonl` beside it.

    Each line is a row; the first names the study, so that rows of another are not taken for its own.
    """

    def __init__(self, study: Study, path: Path | None):
        if path and path.suffix not in SUFFIXES:
            raise InvalidInput(f"{path} does not say its kind; end it in {' or '.join(SUFFIXES)}.")
        if path and path.suffix == ".parquet":
            _pyarrow()
        self._study = study
        self._path = path
        self._partial = path.with_suffix(_PARTIAL) if path else None
        self._rows: dict[int, Row] = {}
        self._file: io.TextIOWrapper | None = None

    def __enter__(self) -> Self:
        if self._partial:
            if self._partial.exists():
                self._take_up(self._partial)
            with guarded(self._partial, "the rows of the sweep"):
                self._file = self._partial.open("a", encoding="utf-8")
                if not self._file.tell():
                    self._file.write(json.dumps({"study": self._study.digest, "name": self._study.name}) + "\n")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file:
            self._file.close()

    def __contains__(self, number: int) -> bool:
        return number in self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, rows: Iterable[Row]) -> None:
        """Keep these."""
        for row in rows:
            self._rows[row["point"]] = row
            if self._file and self._partial:
                with guarded(self._partial, "the rows of the sweep"):
                    self._file.write(json.dumps(row) + "\n")
                    self._file.flush()

    def finished(self) -> list[Row]:
        """All rows in the study's order; the table is written, and what was kept beside it is gone."""
        rows = [self._rows[number] for number in sorted(self._rows)]
        if self._path and self._partial and self._file:
            if self._path.suffix == ".parquet":
                self._to_parquet(rows)
            else:
                write_text(self._path, _as_csv(rows), "the rows of the sweep")
            self._file.close()
            self._partial.unlink()
        return rows

    def _take_up(self, partial: Path) -> None:
        """Rows of a sweep that was interrupted; a last line that is not whole is left out, and taken away."""
        whole = 0
        with guarded(partial, "the rows of the sweep"), partial.open("rb") as lines:
            for number, line in enumerate(lines):
                try:
                    row = json.loads(line) if line.endswith(b"\n") else None
                except ValueError:
                    row = None
                if number == 0 and (not isinstance(row, dict) or row.get("study") != self._study.digest):
                    raise InvalidInput(f"{partial} has rows of another study; move it away to begin anew.")
                if not isinstance(row, dict):
                    break
                whole += len(line)
                if number:
                    self._rows[row["point"]] = row
        os.truncate(partial, whole)

    def _to_parquet(self, rows: list[Row]) -> None:
        pa = _pyarrow()
        from pyarrow import parquet

        columns = _columns(rows)
        table = pa.table({name: [row.get(name) for row in rows] for name in columns})
        about = {"bubbleskin": json.dumps({"sweep": self._study.name, "study": self._study.digest})}
        assert self._path
        with guarded(self._path, "the rows of the sweep"):
            parquet.write_table(table.replace_schema_metadata(about), self._path)


def varied(rows: list[Row]) -> list[str]:
    """Names of what varies, the seed aside: it stands before the seed."""
    names = list(rows[0])[1:] if rows else []
    return names[: names.index("seed")] if "seed" in names else []


def figures(rows: list[Row]) -> list[str]:
    """Names of the numbers that the task returned on any wristband."""
    others = {"point", "seed", "error", *varied(rows)}
    return [name for name in _columns(rows) if name not in others]


def _columns(rows: list[Row]) -> list[str]:
    """Names of all columns; a row whose task failed has no numbers."""
    found = dict.fromkeys(name for row in rows for name in row if name != "error")
    return [*found, "error"]


def _as_csv(rows: list[Row]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, _columns(rows), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _pyarrow() -> Any:
    try:
        import pyarrow
    except ImportError:
        raise InvalidInput(
            "Parquet needs pyarrow: `pip install 'bubbleskin[parquet]'`, or write to a .csv file."
        ) from None
    return pyarrow
