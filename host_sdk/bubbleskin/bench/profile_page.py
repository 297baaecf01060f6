"""The chip's profile as a file, and as the tables of `docs/chip.md` that are made of it."""

import json
from pathlib import Path

from bubbleskin import files
from bubbleskin.bench.pages import table_row, with_tables
from bubbleskin.bench.profile import LOAD, Profile

DATA = Path("docs/data/profile.json")
PAGE = Path("docs/chip.md")
BEGIN, END = (
    "<!-- profile: made by bubbleskin bench --target rp2040 --profile --write -->\n",
    "<!-- end of profile -->\n",
)
_SHOWN = 24
"""Functions in a table: the others have less than a hundredth each."""
_LEAST_US, _LEAST_CALLS = 0.5, 0.01
"""Of what is kept in the file, a tick."""


def write(root: Path, found: list[Profile]) -> None:
    """Write `found` into the repository at `root`, and the page that shows it."""
    lines = []
    for board, situation, stacks, calls in found:
        kept = [[";".join(stack), round(spent, 2)] for stack, spent in sorted(stacks.items()) if spent >= _LEAST_US]
        often = {name: round(count, 2) for name, count in sorted(calls.items()) if count >= _LEAST_CALLS}
        lines.append(json.dumps([board, situation, kept, often], ensure_ascii=False))
    files.write_text(root / DATA, "[\n" + ",\n".join(lines) + "\n]\n", "the chip's profile")
    files.write_text(root / PAGE, page(root), "the page of the chip")


def read(root: Path) -> list[Profile]:
    """The profiles in the file."""
    entries = files.parse_json(files.read_text(root / DATA, "the chip's profile"), str(DATA))
    return [
        Profile(board, situation, {tuple(stack.split(";")): spent for stack, spent in kept}, calls)
        for board, situation, kept, calls in entries
    ]


def page(root: Path) -> str:
    """The page with the tables of the file's profiles."""
    return with_tables(root / PAGE, BEGIN, END, tables(read(root)))


def tables(found: list[Profile]) -> str:
    """What the chip does in a tick; and of each board under load, which functions take most of it."""
    kinds = [one.by_kind() for one in found]
    lines = [table_row(["µs of a tick, mean", *(f"{one.board}, {one.situation}" for one in found)])]
    lines.append(table_row(["---"] * (1 + len(found))))
    for kind in sorted(set().union(*kinds), key=lambda kind: -sum(one.get(kind, 0.0) for one in kinds)):
        lines.append(table_row([kind, *(f"{one.get(kind, 0.0):.0f}" for one in kinds)]))
    lines.append(table_row(["a whole tick, interrupts left out", *(f"{one.tick_us:.0f}" for one in found)]))
    for one in found:
        if one.situation == LOAD:
            lines += ["", table_row([f"{one.board}, {LOAD}", "calls a tick", "its own, µs", "with what it calls, µs"])]
            lines.append(table_row(["---"] * 4))
            for name, own, whole in one.by_function()[:_SHOWN]:
                calls = f"{one.calls[name]:.2f}" if name in one.calls else "viper"
                lines.append(table_row([f"`{name}`", calls, f"{own:.0f}", f"{whole:.0f}"]))
    return "\n".join(lines) + "\n"
