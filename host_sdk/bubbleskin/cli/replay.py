"""`bubbleskin replay`: run a firmware through a full recording, and say whether it decides the same."""

import dataclasses
import json as jsonlib
from pathlib import Path

import click
from rich.console import Console

from bubbleskin.cli.options import as_json, progress_of_parts
from bubbleskin.replays import ON
from bubbleskin.replays import replay as run


@click.command()
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--on",
    type=click.Choice(ON),
    default=ON[0],
    show_default=True,
    help="Where: in this Python, in a real MicroPython, or on the emulated chip.",
)
@click.option(
    "--firmware",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Another version's firmware: a checkout, or a folder with bubble_firmware and bubble_protocol.",
)
@click.option(
    "--board",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.py",
    help="The board's file, where it is not one of ours.",
)
@as_json
def replay(file: Path, on: str, firmware: Path | None, board: Path | None, json: bool) -> int:
    """Run the firmware through FILE, a full recording, tick by tick. Status 1 where it decides otherwise, and says where.

    FILE is what `skin.record("trouble.jsonl", full=True)` or `bubbleskin sim --record trouble.jsonl` has written.
    """
    with progress_of_parts(Console(stderr=True)) as bar:
        task = bar.add_task(f"replaying on {on}", total=None)
        found = run(
            file,
            on,
            firmware=firmware,
            board=board,
            progress=lambda done, all_: bar.update(task, completed=done, total=all_),
        )
    if json:
        difference = found.difference._asdict() if found.difference else None
        facts = dataclasses.asdict(found) | {"identical": found.identical, "difference": difference}
        click.echo(jsonlib.dumps(facts, default=str))
    else:
        click.echo(str(found))
        for note in found.notes:
            click.echo(note, err=True)
    return 0 if found.identical else 1


commands = [replay]
