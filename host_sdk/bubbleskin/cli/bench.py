"""`bubbleskin bench`: measure and print."""

import json as jsonlib
from importlib.util import find_spec

import click
from rich.console import Console
from rich.progress import track
from rich.table import Table

from bubbleskin.bench import BENCHES, measure
from bubbleskin.bench.rows import Row
from bubbleskin.cli.options import as_json
from bubbleskin.errors import BubbleskinError, InvalidInput

_HELP = f"""Measure speeds and print them beside their targets.

PART: {", ".join(f"{name} ({what})" for name, what in BENCHES.items())}. Without one, all.
"""


@click.command(help=_HELP)
@click.argument("parts", nargs=-1, type=click.Choice(tuple(BENCHES)), metavar="[PART]...")
@click.option(
    "--target",
    type=click.Choice(("host", "rp2040")),
    default="host",
    show_default=True,
    help="rp2040: the firmware on the emulated chip, in emulated time; takes minutes, and no PART.",
)
@as_json
def bench(parts: tuple[str, ...], target: str, json: bool) -> None:
    """Print what `bubbleskin.bench` measures."""
    console = Console(stderr=json)
    rows: list[Row] = []
    if target == "rp2040":
        if parts:
            raise InvalidInput(f"--target rp2040 measures the chip's firmware; leave out {' and '.join(parts)}.")
        if find_spec("rp2040py") is None:
            raise BubbleskinError("--target rp2040 needs the emulator. Install it: pip install 'bubbleskin[emulator]'.")
        from bubbleskin.bench import rp2040

        with console.status("emulating …") as status:
            for row in rp2040.rows():
                rows.append(row)
                status.update(f"emulating … {row.name}: {row.value:.3g} {row.unit}")
    else:
        for part in track(parts or tuple(BENCHES), "measuring", console=console, transient=True):
            rows += measure(part)
    if json:
        click.echo(jsonlib.dumps([row._asdict() for row in rows], indent=2))
        return
    table = Table("what", "value", "unit", "target")
    for row in rows:
        table.add_row(row.name, f"{row.value:.3g}", row.unit, row.target)
    console.print(table)


commands = [bench]
