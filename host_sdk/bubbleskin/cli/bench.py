"""`bubbleskin bench`: measure and print."""

import json as jsonlib
from collections.abc import Callable
from importlib import import_module

import click
from rich.console import Console
from rich.progress import track
from rich.table import Table

from bubbleskin.bench.rows import Row
from bubbleskin.cli.options import as_json

_PARTS = ("simulation", "membrane", "codec", "link", "clock")


@click.command()
@click.argument("parts", nargs=-1, type=click.Choice(_PARTS), metavar="[PART]...")
@as_json
def bench(parts: tuple[str, ...], json: bool) -> None:
    """Measure speeds and print them beside their targets.

    PART: simulation (how fast simulated wristbands run), membrane (inversions, tables, fits), codec (frames, beside
    pymavlink), link (round trips over a pseudo-terminal, beside a plain echo) or clock (error of the device's time
    under jitter). Without one, all.
    """
    console = Console(stderr=json)
    rows: list[Row] = []
    for part in track(parts or _PARTS, "measuring", console=console, transient=True):
        measure: Callable[[], list[Row]] = import_module(f"bubbleskin.bench.{part}").rows
        rows += measure()
    if json:
        click.echo(jsonlib.dumps([row._asdict() for row in rows], indent=2))
        return
    table = Table("what", "figure", "unit", "target")
    for row in rows:
        table.add_row(row.name, f"{row.figure:.3g}", row.unit, row.target)
    console.print(table)


commands = [bench]
