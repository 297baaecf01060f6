"""Verbs that talk to a wristband: demo, info, show."""

import dataclasses
import json as jsonlib
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table

from bubbleskin.cli.options import Real, as_json, device, device_or_simulated, gathered, progress
from bubbleskin.connecting import connect
from bubbleskin.demo import DEMO, SECONDS, Show, watch
from bubbleskin.device.state import State
from bubbleskin.errors import InvalidInput
from bubbleskin.fault_guide import guide
from bubbleskin.shape import shapes
from bubbleskin.shape.heightfield import FILLS, Heights
from bubbleskin.skin import Skin


@click.group(invoke_without_command=True)
@device_or_simulated
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    default="demo.png",
    show_default=True,
    help="The picture.",
)
@click.pass_context
def demo(context: click.Context, device: str, output: Path) -> None:
    """Show a dome, then a tilted plane; print heights asked and reached; save a picture.

    The demonstrations of the paper are commands of their own, below.
    """
    if context.invoked_subcommand:
        return
    from bubbleskin.plot.array import draw_shows

    console = Console()
    shows: list[Show] = []
    with connect(device) as skin:
        info = skin.info
        console.print(f"{device}: {info.board}, {info.bubbles} bubbles, firmware {info.firmware}", highlight=False)
        for title, shape in DEMO.items():
            with _progress(console) as bar:
                task = bar.add_task(f"{title} …", total=SECONDS, off="")

                def report(state: State, since: float, bar: Progress = bar, task: TaskID = task) -> None:
                    worst = np.abs(state.height_mm - state.target_mm).max()
                    bar.update(task, completed=since, off=f"{worst:5.2f} mm to go")

                show = watch(skin, title, shape(skin.layout), report)
            console.print(_reached(show.states[-1], skin, title))
            shows.append(show)
        skin.vent()
        picture = draw_shows(output, skin.layout, shows, (info.height_rest_mm, info.height_max_mm))
    console.print(
        f"The picture is [bold]{picture}[/bold]: the array from above, from the side, and height over time.",
        highlight=False,
        soft_wrap=True,
    )


def _progress(console: Console) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[off]}"), TimeElapsedColumn())
    return progress(console, *columns)


def _reached(state: State, skin: Skin, title: str) -> Table:
    simulated = skin.simulated
    table = Table("bubble", "asked (mm)", "reached (mm)", title=title, title_justify="left")
    if simulated:
        table.add_column("true (mm)")
    table.add_column("pressure (kPa)")
    for bubble in range(skin.info.bubbles):
        row = [str(bubble), f"{state.target_mm[bubble]:.2f}", f"{state.height_mm[bubble]:.2f}"]
        if simulated:
            row.append(f"{simulated.height_mm[bubble]:.2f}")
        table.add_row(*row, f"{state.pressure_kpa[bubble]:.2f}")
    return table


@click.command()
@device
@as_json
def info(device: str | None, json: bool) -> None:
    """Say who the wristband is and how it does."""
    with connect(device) as skin:
        facts = dataclasses.asdict(skin.info) | dataclasses.asdict(skin.health()) | {"faults": skin.faults()}
        facts["fault_log"] = [dataclasses.asdict(fault) for fault in skin.fault_log()]
    if json:
        click.echo(jsonlib.dumps(facts, indent=2))
        return
    table = Table(show_header=False, box=None)
    units = {"tick": " s", "time": " s", "tick_worst": " s", "heap_free": " bytes", "supply_kpa": ""}
    for fault in facts.pop("fault_log"):
        where = "board" if fault["bubble"] is None else f"bubble {fault['bubble']}"
        seen = "" if fault["acknowledged"] else ", not acknowledged"
        facts[f"fault {fault['id']}"] = (
            f"{fault['name']}, {where}, at {fault['time']:.3f} s, {fault['value']:g}{seen}. {guide(fault['name']).remedy}."
        )
    for name, value in facts.items():
        if name in ("tables_crc", "boot_id"):
            value = f"{value:08x}"
        table.add_row(name.replace("_", " "), f"{value}{units.get(name, '')}")
    Console().print(table)


class _Way(NamedTuple):
    """The one way in which a shape is said."""

    heights: tuple[str, ...]
    everywhere: float | None
    shape: str | None
    path: Path | None
    fill: str | None


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("heights", nargs=-1, metavar="[MM]...")
@click.option("--all", "everywhere", type=Real(), metavar="MM", help="The same height for every bubble.")
@click.option("--shape", type=click.Choice(list(shapes.SHAPES)), help="A ready-made shape.")
@click.option(
    "--file", "path", type=click.Path(dir_okay=False, path_type=Path), help="A heightfield: .npy, or numbers in .csv."
)
@click.option("--fill", type=click.Choice(FILLS), help="What entries of --file that are not known are given.")
@click.option(
    "--over", type=Real(0.0, unit="s"), default=0.0, show_default=True, help="Seconds the change should take."
)
@click.option(
    "--hold",
    type=Real(0.0, unit="s"),
    default=0.0,
    show_default=True,
    help="Seconds to hold it for; a wristband vents 1 s after its host has gone.",
)
@device
@as_json
@gathered(way=_Way)
def show(way: _Way, over: float, hold: float, device: str | None, json: bool) -> None:
    """Take a shape: one height in MM per bubble, or one of --all, --shape, --file."""
    heights, everywhere, shape, path, fill = way
    given = [bool(heights), everywhere is not None, shape is not None, path is not None]
    if sum(given) != 1:
        raise InvalidInput("Say the shape in one way: a height in mm per bubble, or one of --all, --shape and --file.")
    asked: Heights
    if path is not None:
        asked = shapes.load(path, fill)
    elif everywhere is None:
        asked = shapes.parse_heights(heights)
    with connect(device) as skin:
        if shape:
            asked = shapes.SHAPES[shape](skin.layout)
        elif everywhere is not None:
            asked = np.full(skin.info.bubbles, everywhere)
        state = skin.show(asked, over=over)
        if json:
            columns = {"target_mm": state.target_mm, "height_mm": state.height_mm, "pressure_kpa": state.pressure_kpa}
            click.echo(jsonlib.dumps({name: column.tolist() for name, column in columns.items()}))
        else:
            Console().print(_reached(state, skin, f"settled at {state.time:.2f} s"))
        skin.sleep(hold)


commands = [info, show]
