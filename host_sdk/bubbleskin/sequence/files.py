"""Sequences in files: JSON by `sequence.schema.json`, and timelines as CSV."""

import json
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput
from bubbleskin.files import Cell, CellError, Grid, parse_json, path_of, read_table, read_text, width, write_text
from bubbleskin.layout import Layout
from bubbleskin.sequence.steps import STEPS_MAX, After, Repeat, Settled, Step

T = TypeVar("T")

VERSION = 1
SCHEMA = Path(__file__).with_name("sequence.schema.json")
_NESTED = 32  # repeats in a file; more than `Sequence` takes, so that it may say so

_TIME_MAX = 1e6  # s, of a timeline: eleven days

_SEQUENCE = {"bubbleskin_sequence", "name", "board", "layout", "loops", "steps"}
_LAYOUT = {"pitch_mm", "positions_mm"}
_STEP = {"targets_mm", "ramp_s", "easing", "until", "name"}
_REPEAT = {"repeat", "steps"}
_AFTER = {"after_s"}
_SETTLED = {"settled_mm", "timeout_s", "then"}


class Written(NamedTuple):
    """What a file holds of a sequence: what `bubbleskin.Sequence`, which imports this module, is made from."""

    steps: Sequence[Step | Repeat]
    loops: int = 1
    name: str = ""
    board: str | None = None
    layout: Layout | None = None


def to_json(written: Written, path: str | Path | None) -> str:
    """See `bubbleskin.Sequence.to_json`."""
    data: dict[str, Any] = {"bubbleskin_sequence": VERSION, "name": written.name, "loops": written.loops}
    if written.board:
        data["board"] = written.board
    if layout := written.layout:
        data["layout"] = {"pitch_mm": layout.pitch_mm, "positions_mm": layout.positions_mm.tolist()}
    lines = ",\n    ".join(json.dumps(_part(part), ensure_ascii=False) for part in written.steps)
    head = json.dumps(data, ensure_ascii=False)[1:-1]
    text = f'{{\n  {head},\n  "steps": [\n    {lines}\n  ]\n}}\n'  # a line for each step
    if path is not None:
        write_text(path, text, "the sequence")
    return text


def _part(part: Step | Repeat) -> dict[str, Any]:
    if isinstance(part, Repeat):
        return {"repeat": part.times, "steps": [_part(inner) for inner in part.steps]}
    until: dict[str, Any]
    if isinstance(part.until, After):
        until = {"after_s": part.until.seconds}
    else:
        until = {"settled_mm": part.until.tolerance_mm, "timeout_s": part.until.timeout_s, "then": part.until.then}
    named = {"name": part.name} if part.name else {}
    targets = None if part.targets_mm is None else list(part.targets_mm)
    return {**named, "targets_mm": targets, "ramp_s": part.ramp, "easing": part.easing, "until": until}


def from_json(source: str | Path, make: Callable[[Written], T]) -> T:
    """See `bubbleskin.Sequence.from_json`; what `make` refuses is refused with the file's name."""
    if isinstance(source, str) and source.lstrip().startswith("{"):
        where, text = "The text", source
    else:
        where, text = str(path_of(source, "the sequence")), read_text(source, "the sequence")
    data = parse_json(text, where)
    try:
        return make(_written(data))
    except InvalidInput as error:
        raise InvalidInput(f"{where} is not a sequence that can be played. {error}") from None


def _written(data: Any) -> Written:
    _known(data, _SEQUENCE, "The sequence")
    version = data.get("bubbleskin_sequence")
    if version != VERSION or isinstance(version, bool):
        raise InvalidInput(
            f"bubbleskin_sequence, the version of the format, is {shown(version)}; this SDK reads {VERSION}."
        )
    for key in ("name", "board"):
        if not isinstance(data.get(key, ""), str):
            raise InvalidInput(f"{key} is {shown(data[key])}; it must be a text.")
    return Written(
        _list(data.get("steps"), "steps", 0),
        loops=data.get("loops", 1),
        name=data.get("name", ""),
        board=data.get("board"),
        layout=_layout(data.get("layout")),
    )


def _layout(data: Any) -> Layout | None:
    if data is None:
        return None
    _known(data, _LAYOUT, "layout")
    try:
        return Layout(data.get("positions_mm"), data.get("pitch_mm"))
    except InvalidInput as error:
        raise InvalidInput(f"layout is not one of pitch_mm and positions_mm: {error}") from None


def _list(data: Any, where: str, depth: int) -> list[Step | Repeat]:
    if not isinstance(data, list):
        raise InvalidInput(f"{where} is {shown(data)}; it must be a list of steps and repeats.")
    if depth > _NESTED:
        raise InvalidInput(f"{where} is nested {depth} deep.")
    if len(data) > STEPS_MAX:
        return [Step(None, until=After(1))] * len(data)  # too many for a sequence, which says so
    return [_read_part(part, f"{where}[{index}]", depth) for index, part in enumerate(data)]


def _read_part(data: Any, where: str, depth: int) -> Step | Repeat:
    if isinstance(data, dict) and "repeat" in data:
        _known(data, _REPEAT, where)
        inner = _list(data.get("steps"), f"{where}.steps", depth + 1)
        return _located(where, lambda: Repeat(inner, data["repeat"]))
    _known(data, _STEP, where)
    if "targets_mm" not in data:
        raise InvalidInput(f"{where} has no targets_mm; give a height for each bubble, or null to leave them.")
    until = data.get("until", {"after_s": 0.0})
    if isinstance(until, dict) and "after_s" in until:
        _known(until, _AFTER, f"{where}.until")
        condition: Callable[[], After | Settled] = partial(After, until["after_s"])
    else:
        _known(until, _SETTLED, f"{where}.until")
        names = {"settled_mm": "tolerance_mm", "timeout_s": "timeout_s", "then": "then"}
        condition = partial(Settled, **{names[key]: value for key, value in until.items()})
    return _located(
        where,
        lambda: Step(
            data["targets_mm"],
            data.get("ramp_s", 0.0),
            data.get("easing", "linear"),
            condition(),
            data.get("name", ""),
        ),
    )


def _located(where: str, make: Callable[[], T]) -> T:
    """What `make` makes; its refusal says where in the file the mistake stands."""
    try:
        return make()
    except InvalidInput as error:
        raise InvalidInput(f"{where}: {error}") from None


def _known(data: Any, keys: set[str], where: str) -> None:
    if not isinstance(data, dict):
        raise InvalidInput(f"{where} is {shown(data)}; it must be an object with {', '.join(sorted(keys))}.")
    unknown = sorted(set(data) - keys)
    if unknown:
        raise InvalidInput(
            f"{where} has {shown(unknown[0])}, which means nothing there; known are {', '.join(sorted(keys))}."
        )


def steps_from_csv(path: str | Path, easing: str, lead: float) -> list[Step | Repeat]:
    """See `bubbleskin.Sequence.from_csv`."""
    table = read_table(path, "the timeline")
    head, *rows = table.rows or [[]]
    order = _bubbles(table, [cell.text for cell in head])
    steps: list[Step | Repeat] = []
    before = 0  # ms
    for row in rows:
        where = f"{table.name}, line {row[0].line}"
        if misfit := width(table, len(head), row):
            raise InvalidInput(f"{where} has {misfit}.")
        time, *heights = (_cell(table, cell, name.text) for cell, name in zip(row, head, strict=True))
        if time is None or not 0 <= time <= _TIME_MAX:
            raise InvalidInput(f"{where} has no time; time_s is in seconds from 0 to {_TIME_MAX:g}.")
        now = round(time * 1000)  # of the sum, so that rounding does not add up
        if steps and now <= before:
            raise InvalidInput(
                f"{where} is at {time:g} s, not after the line before it; times must rise by 1 ms or more."
            )
        ramp = (now - before) / 1000 if now else lead
        before = now
        steps.append(_located(where, partial(Step, [heights[k] for k in order], ramp, easing)))
    if not steps:
        raise InvalidInput(f"{table.name} has no rows below its header; a timeline needs at least one.")
    return steps


def _bubbles(table: Grid, head: list[str]) -> list[int]:
    """In which column after the first each bubble stands. The columns' names say so; their order does not matter."""
    names = head[1:]
    expected = [f"b{bubble}" for bubble in range(len(names))]
    if head[:1] != ["time_s"] or not names or not all(re.fullmatch(r"b\d{1,4}", name, re.ASCII) for name in names):
        raise InvalidInput(
            f"{table.name} begins with the columns {','.join(head)[:200]}; a timeline has time_s,b0,b1 and so on."
        )
    numbers = [int(name[1:]) for name in names]
    if sorted(numbers) == list(range(1, len(names) + 1)):
        raise InvalidInput(
            f"{table.name} has the columns b1 to b{len(names)}, and bubbles count from 0: name them b0 to b{len(names) - 1}."
        )
    missing = [name for name in expected if name not in names]
    if missing or len(set(names)) < len(names):
        raise InvalidInput(
            f"{table.name} has no column {missing[0]}; {len(names)} bubbles are {expected[0]} to {expected[-1]}, each once. "
            "A bubble that is to stay as it is has empty cells."
        )
    return [names.index(name) for name in expected]


def _cell(table: Grid, cell: Cell, heading: str) -> float | None:
    if not cell.text:
        return None
    try:
        return table.number(cell)
    except CellError as error:
        raise InvalidInput(f"{table.place(cell, heading)}: it {error}.") from None
