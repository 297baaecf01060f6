"""`bubbleskin bench`: measure and print."""

import json as jsonlib
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import click
from rich.console import Console
from rich.progress import track
from rich.table import Table

from bubbleskin.bench import BENCHES, LONG, measure
from bubbleskin.bench.rows import Row
from bubbleskin.cli.options import SEED, Real, as_json, gathered
from bubbleskin.errors import BubbleskinError, InvalidInput

_HELP = f"""Measure speeds, and how well heights are held, and print them beside their targets.

PART: {", ".join(f"{name} ({what})" for name, what in BENCHES.items())}. Without one, all but {", ".join(LONG)}.
"""
_CONTROL = "control"
_SHORT = tuple(name for name in BENCHES if name not in LONG)


class OfControl(NamedTuple):
    """What only the bench of control can be asked."""

    size: float
    seed: int
    check: bool


@click.command(help=_HELP)
@click.argument("parts", nargs=-1, type=click.Choice(tuple(BENCHES)), metavar="[PART]...")
@click.option(
    "--target",
    type=click.Choice(("host", "rp2040")),
    default="host",
    show_default=True,
    help="rp2040: the firmware on the emulated chip, in emulated time; takes minutes, and no PART.",
)
@click.option(
    "--size",
    type=Real(0.0, 1.0, above_zero=True),
    default=1.0,
    show_default=True,
    help="control: the share of its sheets.",
)
@click.option("--seed", type=SEED, default=1, show_default=True, help="control: of its first sheet.")
@click.option("--profile", is_flag=True, help="rp2040: where a tick goes, function by function.")
@click.option(
    "--write",
    is_flag=True,
    help="Without PART: measure all three times and write docs/benchmarks.md of this folder. control: write its figures into "
    "docs/control.md and docs/contact.md. --profile: into docs/chip.md.",
)
@click.option("--check", is_flag=True, help="control: measure nothing; fail if that page does not show those figures.")
@as_json
@gathered(control=OfControl)
def bench(parts: tuple[str, ...], target: str, profile: bool, write: bool, json: bool, control: OfControl) -> None:
    """Print what `bubbleskin.bench` measures."""
    console = Console(stderr=json)
    alone = parts == (_CONTROL,) and target == "host"
    whole = write and not parts and target == "host"
    if control != OfControl(1.0, 1, False) and not alone:
        raise InvalidInput("--size, --seed and --check are of one bench: bubbleskin bench control --check.")
    if profile and target != "rp2040":
        raise InvalidInput("--profile is of the emulated chip: bubbleskin bench --target rp2040 --profile.")
    if write and not (alone or whole or profile):
        raise InvalidInput(
            "--write is of bubbleskin bench control, of all benches but that together, without a PART, and of "
            "--target rp2040 --profile."
        )
    if control.check:
        from bubbleskin.bench.control import page

        page.check(_repository())
        return
    if target == "rp2040":
        rows = _of_the_chip(parts, profile, write, console)
    elif alone:
        rows = _of_control(control, write, console)
    elif whole:
        rows = _of_all(console)
    else:
        chosen = parts or _SHORT
        rows = [row for part in track(chosen, "measuring", console=console, transient=True) for row in measure(part)]
    if json:
        click.echo(jsonlib.dumps([row._asdict() for row in rows], indent=2))
        return
    table = Table("what", "value", "unit", "target")
    for row in rows:
        table.add_row(row.name, f"{row.value:.3g}", row.unit, row.target)
    console.print(table)


def _of_the_chip(parts: tuple[str, ...], profile: bool, write: bool, console: Console) -> list[Row]:
    if parts:
        raise InvalidInput(f"--target rp2040 measures the chip's firmware; leave out {' and '.join(parts)}.")
    if find_spec("rp2040py") is None:
        raise BubbleskinError("--target rp2040 needs the emulator. Install it: pip install 'bubbleskin[emulator]'.")
    if profile:
        return _of_a_tick(write, console)
    from bubbleskin.bench import rp2040

    rows = []
    with console.status("emulating …") as status:
        for row in rp2040.rows():
            rows.append(row)
            status.update(f"emulating … {row.name}: {row.value:.3g} {row.unit}")
    return rows


def _of_all(console: Console) -> list[Row]:
    from bubbleskin.bench import report

    root = _repository()
    with console.status("measuring …") as status:
        return report.write(root, _SHORT, lambda bench: status.update(f"measuring … {bench}, {report.RUNS} times"))


def _of_a_tick(write: bool, console: Console) -> list[Row]:
    from bubbleskin.bench import profile, profile_page

    root = _repository() if write else None
    found = []
    with console.status("counting instructions …") as status:
        for one in profile.profiles():
            found.append(one)
            status.update(f"counting instructions … {one.board}, {one.situation}: {one.tick_us:.0f} µs")
    if root:
        profile_page.write(root, found)
    return [row for one in found for row in profile.rows_of(one)]


def _of_control(asked: OfControl, write: bool, console: Console) -> list[Row]:
    from bubbleskin.bench.control import measure, page, touching

    root = _repository() if write else None  # found before anything is measured for a quarter of an hour
    found = []
    with console.status("holding heights …") as status:
        for one in measure.figures(asked.size, asked.seed):
            found.append(one)
            status.update(f"holding heights … {len(found)} of {measure.COUNT}: {one.plant}, {one.use}, {one.contender}")
        status.update("bubbles that touch …")
        others = list(touching.rows(asked.size, asked.seed))
    if root:
        page.write(root, found, others)
    return [row for one in found for row in measure.rows_of(one)] + others


def _repository() -> Path:
    from bubbleskin.bench.control import page

    if not page.PAGE.is_file():
        raise InvalidInput(f"There is no {page.PAGE} here; run this in the folder of bubbleskin's repository.")
    return Path()


commands = [bench]
