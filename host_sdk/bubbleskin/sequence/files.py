"""Sequences in files: JSON by `sequence.schema.json`, and timelines as CSV."""

import csv
import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sequence.steps import STEPS_MAX, After, Repeat, Settled, Step

T = TypeVar("T")

VERSION = 1
SCHEMA = Path(__file__).with_name("sequence.schema.json")
_NESTED = 32  # repeats in a file; more than `Sequence` takes, so that it may say so

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
        try:
            Path(path).write_text(text, encoding="utf-8")
        except OSError as error:
            raise InvalidInput(f"Cannot write {path}: {error.strerror}.") from None
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
    where = "The text"
    text = str(source)
    if isinstance(source, Path) or not text.lstrip().startswith("{"):
        where, text = str(source), _read(source)
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{where} is not JSON: {error}.") from None
    try:
        return make(_written(data))
    except InvalidInput as error:
        raise InvalidInput(f"{where} is not a sequence that can be played. {error}") from None


def _read(path: str | Path) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise InvalidInput(f"Cannot read the sequence {path}: {error.strerror}.") from None
    except ValueError:
        raise InvalidInput(f"{path} is not a text in UTF-8, so it is no sequence.") from None


def _written(data: Any) -> Written:
    _known(data, _SEQUENCE, "The sequence")
    version = data.get("bubbleskin_sequence")
    if version != VERSION or isinstance(version, bool):
        raise InvalidInput(f"bubbleskin_sequence, the version of the format, is {version!r}; this SDK reads {VERSION}.")
    for key in ("name", "board"):
        if not isinstance(data.get(key, ""), str):
            raise InvalidInput(f"{key} is {data[key]!r}; it must be a text.")
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
        return Layout(np.array(data.get("positions_mm"), dtype=float), float(data["pitch_mm"]))
    except (TypeError, ValueError, KeyError) as error:
        raise InvalidInput(f"layout is not one of pitch_mm and positions_mm: {error}.") from None


def _list(data: Any, where: str, depth: int) -> list[Step | Repeat]:
    if not isinstance(data, list):
        raise InvalidInput(f"{where} is {data!r:.40}; it must be a list of steps and repeats.")
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
        raise InvalidInput(f"{where} is {data!r:.40}; it must be an object with {', '.join(sorted(keys))}.")
    unknown = sorted(set(data) - keys)
    if unknown:
        raise InvalidInput(
            f"{where} has {unknown[0]!r}, which means nothing there; known are {', '.join(sorted(keys))}."
        )


def steps_from_csv(path: str | Path, easing: str, lead: float) -> list[Step | Repeat]:
    """See `bubbleskin.Sequence.from_csv`."""
    lines = csv.reader(_read(path).splitlines())
    head = [name.strip() for name in next(lines, [])]
    expected = ["time_s", *(f"b{bubble}" for bubble in range(len(head) - 1))]
    if head != expected or len(head) < 2:
        raise InvalidInput(
            f"{path} begins with the columns {','.join(head)}; a timeline has {','.join(expected[:3])} and so on."
        )
    steps: list[Step | Repeat] = []
    before = 0  # ms
    for number, row in enumerate(lines, start=2):
        if not any(cell.strip() for cell in row):
            continue
        where = f"{path}, line {number}"
        if len(row) != len(head):
            raise InvalidInput(f"{where} has {len(row)} cells; there are {len(head)} columns.")
        time, *heights = (_cell(cell, where) for cell in row)
        if time is None or time < 0:
            raise InvalidInput(f"{where} has no time; time_s is in seconds from 0.")
        now = round(time * 1000)  # of the sum, so that rounding does not add up
        if steps and now <= before:
            raise InvalidInput(
                f"{where} is at {time:g} s, not after the line before it; times must rise by 1 ms or more."
            )
        ramp = (now - before) / 1000 if now else lead
        before = now
        steps.append(_located(where, partial(Step, heights, ramp, easing)))
    if not steps:
        raise InvalidInput(f"{path} has no rows below its header; a timeline needs at least one.")
    return steps


def _cell(text: str, where: str) -> float | None:
    if not text.strip():
        return None
    try:
        return float(text)
    except ValueError:
        raise InvalidInput(f"{where} has {text.strip()!r}, which is not a number.") from None
