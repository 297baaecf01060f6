"""`bubbleskin flash`: firmware onto the wristband."""

import dataclasses
import json as jsonlib
from pathlib import Path

import click
from rich.console import Console

from bubbleskin.cli.options import Board, as_json, progress_of_parts
from bubbleskin.errors import InvalidInput


@click.command()
@click.option(
    "--board",
    type=Board(),
    help="What it is or shall be; one of your own by the path of its file. Needed where nothing of ours is on it.",
)
@click.option("--device", metavar="PORT", help="The board's port. Default: the only board attached.")
@click.option(
    "--drive",
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False),
    help="Where the boot loader's drive RPI-RP2 is. Default: the only one mounted.",
)
@click.option(
    "--uf2",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Copy this firmware. Default: today's, built if need be.",
)
@click.option("--mpy", is_flag=True, help="Install .mpy files on a stock MicroPython, and nothing else.")
@click.option(
    "--previous", is_flag=True, help="Bring the last other firmware back that worked on a board of this kind."
)
@as_json
def flash(
    board: str | None, device: str | None, drive: Path | None, uf2: Path | None, mpy: bool, previous: bool, json: bool
) -> None:
    """Bring the firmware onto a wristband, and see it answer.

    A board in its boot loader (BOOTSEL held while it was plugged in), or one that runs our UF2, gets a UF2; one with a
    stock MicroPython gets .mpy files. Calibration stays. If anything interrupts it, run it again.
    """
    from bubbleskin.flash import Order, ThisMachine
    from bubbleskin.flash import flash as bring

    if device and device.startswith(("sim://", "micropython://")):
        raise InvalidInput(
            f"{device} is simulated: it always runs the firmware of this source. Name a wristband's port."
        )
    console = Console(stderr=json)
    with progress_of_parts(console) as bar:
        task = bar.add_task("looking for the wristband")

        def report(title: str, done: int, total: int) -> None:
            bar.update(task, description=title, completed=done, total=total or 1)

        order = Order(board=board, device=device, drive=drive, uf2=uf2, mpy=mpy, previous=previous)
        outcome = bring(ThisMachine(), order, report)
    info = outcome.info
    if json:
        click.echo(jsonlib.dumps({"how": outcome.how, "old": outcome.old, "info": dataclasses.asdict(info)}, indent=2))
        return
    how = {"uf2": "as a UF2", "mpy": "as files on its MicroPython"}[outcome.how]
    before = f", which had {outcome.old}," if outcome.old else ""
    console.print(
        f"The [bold]{info.board}[/bold]{before} runs firmware {info.firmware} now, {how}, and has answered. "
        "See it with `bubbleskin info`.",
        highlight=False,
        soft_wrap=True,
    )


commands = [flash]
