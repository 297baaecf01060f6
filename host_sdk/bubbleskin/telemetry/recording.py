"""Telemetry to a file: CSV as it comes, Parquet when it ends, both with what they were recorded from."""

import contextlib
import csv
import datetime
import json
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any, Self

from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.files import guarded, path_of
from bubbleskin.layout import Layout
from bubbleskin.link.link import run_sync

SUFFIXES = (".csv", ".parquet")
_ARRAYS = ("height_mm", "sd_mm", "alone_mm", "pressure_kpa", "target_mm", "setpoint_mm", "fill_ms", "vent_ms")
_TEXTS = ("status", "faults")
_UNKNOWN = ("sd_mm",)
"""Told, and still nan for a while: where nobody knows who lifts whom."""
_PARTIAL = ".partial.csv"


class Sink(ABC):
    """A file that is recorded to: its `path`, and how many `rows` it has."""

    path: Path
    rows: int

    @abstractmethod
    def write(self, state: State) -> None:
        """Add a state."""

    @abstractmethod
    def close(self) -> None:
        """Finish the file; a second time does nothing. `InvalidInput` if not all could be written."""


class Table(Sink):
    """A file that rows are added to, one per `State`; readable after every row, whatever becomes of this program.

    `path` ends in .csv or .parquet. A Parquet file is only whole with its footer, so rows go to a CSV beside it,
    `NAME.partial.csv`, and become Parquet in `close`. Every number is SI or says its unit in its column's name.
    The metadata stands in the CSV's first lines, after #, and in a Parquet file's `attrs` as pandas reads it.
    """

    def __init__(self, path: str | os.PathLike[str], info: Info, layout: Layout, rate_hz: float):
        self.path = path_of(path, "the recording")
        self.rows = 0
        if self.path.suffix not in SUFFIXES:
            raise InvalidInput(f"{self.path} does not say its kind; end it in {' or '.join(SUFFIXES)}.")
        self._parquet = self.path.suffix == ".parquet"
        if self._parquet:
            _pyarrow()
        self._csv = self.path.with_suffix(_PARTIAL) if self._parquet else self.path
        with guarded(self._csv, "the recording"):
            self._file = self._csv.open("w", newline="", encoding="utf-8")
        for key, value in metadata(info, layout, rate_hz).items():
            self._file.write(f"# {key}: {json.dumps(value)}\n")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._columns: list[str] | None = None
        self._whole = 0  # bytes that hold whole rows

    def write(self, state: State) -> None:
        """Add a row, in the columns of the first. `InvalidInput` where the disk is full: the rows before it stay readable."""
        cells = dict(_cells(state))
        if self._columns is None:
            self._columns = list(cells)
            self._writer.writerow(self._columns)
        try:
            self._writer.writerow([_text(cells.get(name, _nothing(name))) for name in self._columns])
            self._file.flush()
        except OSError as error:
            self._cut()
            raise InvalidInput(f"{self.path} ends after {self.rows} rows: {error.strerror}.") from None
        self.rows += 1
        self._whole = self._file.tell()

    def _cut(self) -> None:
        """Take half a row away again, and with it what waits in the file's buffer, which closing would try to write."""
        with contextlib.suppress(OSError):  # a device cannot be cut
            os.ftruncate(self._file.fileno(), self._whole)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._file.fileno())
        os.close(nowhere)
        self._file.close()

    def close(self) -> None:
        """Finish the file."""
        if self._file.closed:
            return
        with guarded(self._csv, "the recording"):
            self._file.close()
        if self._parquet:
            with guarded(self.path, f"the recording, whose rows are in {self._csv},"):
                to_parquet(self._csv, self.path)
            self._csv.unlink()


def to_parquet(source: Path, path: Path) -> None:
    """Write the recording in the CSV file `source` as Parquet to `path`. `InvalidInput` where pyarrow is not installed."""
    pa = _pyarrow()
    from pyarrow import csv as arrow_csv
    from pyarrow import parquet

    about: dict[str, Any] = {}
    columns: list[str] = []
    with source.open(encoding="utf-8") as file:
        for line in file:
            if not line.startswith("# "):
                columns = line.rstrip("\n").split(",")
                break
            key, _, value = line[2:].partition(": ")
            about[key] = json.loads(value)
    if not columns:
        table = pa.table({})
    else:
        types = {name: pa.string() if _is_text(name) else pa.float64() for name in columns}
        types["lost"] = pa.int64()
        convert = arrow_csv.ConvertOptions(column_types=types, strings_can_be_null=False, null_values=["nan"])
        read = arrow_csv.ReadOptions(skip_rows=len(about))
        table = arrow_csv.read_csv(source, read_options=read, convert_options=convert)
    text = json.dumps(about)
    known = {"bubbleskin": text, "PANDAS_ATTRS": text}  # the second is where pandas looks for `attrs`
    parquet.write_table(table.replace_schema_metadata(known), path)


class Recording:
    """Telemetry that goes to a file while the script goes on; made by `Skin.record`. Close it, or leave its `with` block.

    `path`, `rows` and `lost` (telemetry that was due and has not come) tell how it stands. Rows of a full recording are ticks.
    """

    def __init__(self, table: Sink, end: Callable[[], Coroutine[Any, Any, None]] | None = None):
        self._table = table
        self._end = end
        self._broken: InvalidInput | None = None
        self.lost = 0

    def __repr__(self) -> str:
        return f"<Recording {self.path}: {self.rows} rows, {self.lost} lost>"

    @property
    def path(self) -> Path:
        """The file."""
        return self._table.path

    @property
    def rows(self) -> int:
        """States in it, or ticks."""
        return self._table.rows

    def write(self, state: State) -> None:
        """Add a state. What goes wrong with the file is for `close` to say: here it would hit whoever uses the link."""
        self.lost = state.lost
        if not self._broken:
            try:
                self._table.write(state)
            except InvalidInput as error:
                self._broken = error

    async def aclose(self) -> None:
        """`close` for asyncio."""
        end, self._end = self._end, None
        try:
            if end:
                with contextlib.suppress(LinkError):  # a device that has gone sends no more either
                    await end()
        finally:
            try:
                self._table.close()
            except InvalidInput as error:
                self._broken = self._broken or error
        if self._broken:
            why, self._broken = self._broken, None
            raise why

    def close(self) -> None:
        """Unsubscribe and finish the file; a second time does nothing. `InvalidInput` if not all could be written."""
        run_sync(self.aclose())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *error: object) -> None:
        await self.aclose()


def metadata(info: Info, layout: Layout, rate_hz: float) -> dict[str, Any]:
    """What a recording says of its origin."""
    return {
        "bubbleskin": "telemetry",
        "recorded": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "board": info.board,
        "firmware": info.firmware,
        "boot_id": f"{info.boot_id:08x}",
        "tables_crc": f"{info.tables_crc:08x}",
        "tick_s": info.tick,
        "rate_hz": rate_hz,
        "positions_mm": layout.positions_mm.round(6).tolist(),
        "units": "time_s: device time since boot; every other column says its unit; _0, _1 … are the bubbles",
    }


def _cells(state: State) -> Iterator[tuple[str, Any]]:
    """Names and values of a row: what the state has, in one order."""
    yield "time_s", state.time
    yield "mode", state.mode
    yield "lost", state.lost
    if state.supply_kpa == state.supply_kpa:
        yield "supply_kpa", state.supply_kpa
        yield "board_faults", " ".join(state.board_faults)
    for name in _ARRAYS:
        values = getattr(state, name)
        if values is not None and (name in _UNKNOWN or (values == values).any()):
            for bubble, value in enumerate(values.tolist()):
                yield f"{name}_{bubble}", value
    for bubble, status in enumerate(state.status):
        yield f"status_{bubble}", status
    for bubble, faults in enumerate(state.faults):
        yield f"faults_{bubble}", " ".join(faults)


def _is_text(column: str) -> bool:
    return column in ("mode", "board_faults") or column.rpartition("_")[0] in _TEXTS


def _nothing(column: str) -> Any:
    """What stands in a column of which a state says nothing."""
    return "" if _is_text(column) else float("nan")


def _text(value: Any) -> Any:
    return round(value, 6) if isinstance(value, float) else value


def _pyarrow() -> Any:
    try:
        import pyarrow
    except ImportError:
        raise InvalidInput(
            "Parquet needs pyarrow: `pip install 'bubbleskin[parquet]'`, or record to a file that ends in .csv."
        ) from None
    return pyarrow
