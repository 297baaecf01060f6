"""The figures as files, and as the tables of `docs/control.md` and `docs/contact.md` that are made of them."""

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from bubbleskin import files
from bubbleskin.bench.control.contenders import FIRST, PRESENT
from bubbleskin.bench.control.figures import Figures
from bubbleskin.bench.control.measure import FILL_GOAL, LONG_GOAL_MM, OVERSHOOT_GOAL_MM, TO_AND_FRO_GOAL_MM
from bubbleskin.bench.control.plants import KINDS, Kind
from bubbleskin.bench.control.runs import HOLDS, LONG, SEARCH, STEP, TO_AND_FRO
from bubbleskin.bench.control.shows import TIMES_S
from bubbleskin.bench.pages import table_row, with_tables
from bubbleskin.bench.rows import Row
from bubbleskin.errors import InvalidInput

DATA = Path("docs/data/control.json")
PAGE = Path("docs/control.md")
TOPS_DATA = Path("docs/data/tops.json")
"""Of bubbles that touch."""
TOPS_PAGE = Path("docs/contact.md")
BEGIN, END = "<!-- figures: made by bubbleskin bench control --write -->\n", "<!-- end of figures -->\n"
_DIGITS = 4

_Entry = dict[str, Any]


def write(root: Path, figures: Iterable[Figures], tops: Iterable[Row]) -> None:
    """Write `figures`, and `tops` of bubbles that touch, into the repository at `root`, and the pages that show them."""
    files.write_text(root / DATA, text_of(figures), "the control bench's figures")
    files.write_text(root / PAGE, page(root), "the page of control")
    lines = [json.dumps(_rounded(row), ensure_ascii=False) for row in tops]
    files.write_text(root / TOPS_DATA, "[\n" + ",\n".join(lines) + "\n]\n", "the figures of tops")
    files.write_text(root / TOPS_PAGE, tops_page(root), "the page of contact")


def check(root: Path) -> None:
    """`InvalidInput` where a page does not show the figures in its file."""
    for path, data, made in ((PAGE, DATA, page), (TOPS_PAGE, TOPS_DATA, tops_page)):
        if files.read_text(root / path, "the page") != made(root):
            raise InvalidInput(
                f"{path} does not show the figures of {data}: run `bubbleskin bench control --write`, or "
                "`python tools/generate/control_page.py` where they need not be measured again."
            )


def text_of(figures: Iterable[Figures]) -> str:
    """The file: a list of `Figures`, one a line; what is infinite is null."""
    lines = [json.dumps(_rounded(one.as_dict()), ensure_ascii=False) for one in figures]
    return "[\n" + ",\n".join(lines) + "\n]\n"


def page(root: Path) -> str:
    """The page with the tables of the file's figures."""
    entries = files.parse_json(files.read_text(root / DATA, "the control bench's figures"), str(DATA))
    return with_tables(root / PAGE, BEGIN, END, _tables(entries))


def tops_page(root: Path) -> str:
    """The page of contact with the figures of tops."""
    rows = files.parse_json(files.read_text(root / TOPS_DATA, "the figures of tops"), str(TOPS_DATA))
    lines = ["| what | value | target |", "|---|---|---|"]
    for name, value, unit, target in rows:
        number = f"{value:g}" if value == int(value) else f"{value:.2f}" if value < 10 else f"{value:.1f}"
        lines.append(table_row([name.removeprefix("touching, "), f"{number} {unit}".rstrip(), target]))
    return with_tables(root / TOPS_PAGE, BEGIN, END, "\n".join(lines) + "\n")


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, tuple):
        return [_rounded(one) for one in value]
    if isinstance(value, float):
        return round(value, _DIGITS) if math.isfinite(value) else None
    return value


def _tables(entries: Sequence[_Entry]) -> str:
    found = {(one["use"], one["plant"], one["contender"]): one for one in entries}
    times = " / ".join(f"{moment:g}" for moment in TIMES_S)
    held = next((one["shows"] for one in entries if one["use"] == HOLDS), 0)
    lines = [
        f"Shows of seven bubbles that were held, of each kind: {held}.",
        "",
        f"| plant | goal: mm; pulses/s | RMS at {times} s, mm | most, mm | pulses/s | within 2 sd | settled | of these wrong "
        f"| first law: RMS at {times} s, mm | pulses/s | settled wrong |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [_held(kind, found) for kind in KINDS if (HOLDS, kind.name, PRESENT) in found]
    shows = next((one["shows"] for one in entries if one["use"] == SEARCH), 0)
    lines += [
        "",
        f"| plant | of {shows} short shows: false faults | vent-locks | emptied on the way | held: false faults | vent-locks "
        "| limit cycles | first law, held: vent-locks | limit cycles |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [_counted(kind, found) for kind in KINDS if (SEARCH, kind.name, PRESENT) in found]
    lines += ["", "| what | goal | this firmware | the first law |", "|---|---|---|---|", *_others(entries, found)]
    return "\n".join(lines) + "\n"


def _held(kind: Kind, found: dict[Any, _Entry]) -> str:
    one, other = found[HOLDS, kind.name, PRESENT], found[HOLDS, kind.name, FIRST]
    goals = [f"≤ {goal:g}" for goal in (kind.rms_mm, kind.pulses) if goal is not None]
    most = max(value for value in one["max_mm"] if value is not None)
    cells = [
        kind.name,
        "; ".join(goals) or "–",
        _errors(one),
        f"{most:.2f}",
        f"{one['pulses']:.2f}",
        _share(one["within"]),
        _share(one["settled"]),
        _share(one["settled_wrong"]),
        _errors(other),
        f"{other['pulses']:.2f}",
        _share(other["settled_wrong"]),
    ]
    return table_row(cells)


def _counted(kind: Kind, found: dict[Any, _Entry]) -> str:
    short = found[SEARCH, kind.name, PRESENT]
    one, other = found[HOLDS, kind.name, PRESENT], found[HOLDS, kind.name, FIRST]
    names = [(short, "faults"), (short, "vent_locks"), (short, "emptied")]
    names += [(one, "faults"), (one, "vent_locks"), (one, "limit_cycles")]
    names += [(other, "vent_locks"), (other, "limit_cycles")]
    return table_row([kind.name, *(str(entry[name]) for entry, name in names)])


def _others(entries: Sequence[_Entry], found: dict[Any, _Entry]) -> Iterable[str]:
    for one in entries:
        if one["contender"] != PRESENT or one["use"] in (HOLDS, SEARCH):
            continue
        name, other = f"{one['plant']}, {one['use']}", found[one["use"], one["plant"], FIRST]
        if one["use"] == STEP:
            ratios = [_ratio(entry["fill_ratio"]) for entry in (one, other)]
            yield table_row([f"{name}: longest time, by the fastest fill's", f"≤ {FILL_GOAL:g}", *ratios])
            over = [f"{entry['overshoot_mm']:.2f}" for entry in (one, other)]
            yield table_row([f"{name}: overshoot, mm", f"≤ {OVERSHOOT_GOAL_MM:g}", *over])
        elif one["use"] == TO_AND_FRO:
            yield table_row([f"{name}: RMS, mm", f"≤ {TO_AND_FRO_GOAL_MM:g}", _errors(one), _errors(other)])
        elif one["use"] == LONG:
            last = [f"{entry['last_rms_mm']:.3f}" for entry in (one, other)]
            yield table_row([f"{name}: RMS of the last tenth, mm", f"≤ {LONG_GOAL_MM:g}", *last])
            yield table_row([f"{name}: bubbles emptied on their way", "", str(one["emptied"]), "–"])


def _errors(entry: _Entry) -> str:
    return " / ".join("–" if rms is None else f"{rms:.3f}" for rms in entry["rms_mm"])


def _share(share: float | None) -> str:
    return (
        "–"
        if share is None
        else f"{share:.1%}".replace("%", " %")
        if 0 < share < 1
        else f"{share:.0%}".replace("%", " %")
    )


def _ratio(ratio: float | None) -> str:
    return "never" if ratio is None else f"{ratio:.2f}"
