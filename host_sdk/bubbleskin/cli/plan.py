"""`bubbleskin plan`: how to get a shape of bubbles that touch."""

import json as jsonlib
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from bubbleskin import boards
from bubbleskin.cli.options import Board, as_json, device, gathered, progress
from bubbleskin.connecting import connect
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.shape import shapes
from bubbleskin.shape.heightfield import Heights

if TYPE_CHECKING:
    from bubbleskin.planner.plan import Plan

_FILE = click.Path(dir_okay=False, path_type=Path)


class Asked(NamedTuple):
    """The shape, said in one of three ways."""

    heights: tuple[str, ...]
    shape: str | None
    path: Path | None


class Sheet(NamedTuple):
    """Where the bubbles are, and what their springs are."""

    board: str
    layout_path: Path | None
    contact_path: Path | None


class Playing(NamedTuple):
    """Whether a plan is played, where, and whether it need not be sure."""

    play: bool
    device: str | None
    anyway: bool


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("heights", nargs=-1, metavar="[MM]...")
@click.option("--shape", type=click.Choice(list(shapes.SHAPES)), help="A ready-made shape.")
@click.option("--file", "path", type=_FILE, help="A heightfield: .npy, or numbers in .csv.")
@click.option("--from", "begin", metavar="MM,MM,…", help="Heights of the shape that the array has now. Default: flat.")
@click.option("--board", type=Board(), default=boards.DEFAULT, show_default=True)
@click.option("--layout", "layout_path", type=_FILE, help="A layout of your own, in JSON, instead of a board's.")
@click.option("--contact", "contact_path", type=_FILE, help="Springs of your own sheet: what `fit-contact` wrote.")
@click.option("--plot", type=_FILE, help="Draw the shape from the side and from above.")
@click.option("--play", is_flag=True, help="Play it on the wristband.")
@click.option("--anyway", is_flag=True, help="With --play: a plan that is not sure too.")
@device
@as_json
@gathered(what=Asked, sheet=Sheet, playing=Playing)
def plan(
    what: Asked,
    begin: str | None,
    sheet: Sheet,
    plot: Path | None,
    playing: Playing,
    json: bool,
) -> None:
    """Plan a shape: one height in MM per bubble, or one of --shape and --file.

    Says which bubbles go when, what to send to the wristband in each step, which heights come of it and between which
    they may be. A shape that cannot be had is answered with the nearest one found. A plan that chance has a say in is
    played with --anyway only.
    """
    from bubbleskin.contact.model import CompliantContact
    from bubbleskin.planner.search import plan as find

    heights, shape, path = what
    if sum([bool(heights), shape is not None, path is not None]) != 1:
        raise InvalidInput("Say the shape in one way: a height in mm per bubble, or one of --shape and --file.")
    if playing.anyway and not playing.play:
        raise InvalidInput("--anyway goes with --play: it plays a plan that is not sure.")
    layout = Layout.from_file(sheet.layout_path) if sheet.layout_path else Layout.of_board(sheet.board)
    asked: Heights = (
        shapes.load(path) if path else shapes.SHAPES[shape](layout) if shape else shapes.parse_heights(heights)
    )
    contact = CompliantContact.from_file(sheet.contact_path, layout) if sheet.contact_path else CompliantContact(layout)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with progress(Console(stderr=True), *columns) as bar:
        task = bar.add_task("planning …", total=None)

        def report(tried: int, error: float) -> None:
            off = "" if np.isinf(error) else f", best within {error:.2f} mm"
            bar.update(task, description=f"planning … {tried} paths followed{off}")

        start = find(shapes.parse_heights(begin.split(",")), layout, contact=contact).shape if begin else None
        found = find(asked, layout, contact=contact, start=start, progress=report)
    if plot:
        from bubbleskin.plot.contact import plot_plan
        from bubbleskin.plot.membrane import save

        save(plot_plan(found, contact, start), plot)
        click.echo(f"wrote {plot}", err=True)
    if json:
        click.echo(jsonlib.dumps(_facts(found), indent=2))
    else:
        _print(found)
    if playing.play:
        with connect(playing.device) as skin:
            skin.play(found, anyway=playing.anyway)
        click.echo("played", err=True)


def _facts(found: "Plan") -> dict[str, object]:
    return {
        "asked_mm": found.asked_mm.round(3).tolist(),
        "predicted_mm": found.predicted_mm.round(3).tolist(),
        "low_mm": found.low_mm.round(3).tolist(),
        "high_mm": found.high_mm.round(3).tolist(),
        "rms_mm": round(found.rms_mm, 3),
        "error_mm": round(found.error_mm, 3),
        "unreachable": list(found.unreachable),
        "sure": found.sure,
        "steps": [
            {
                "bubbles": list(step.bubbles),
                "target_mm": step.target_mm.round(3).tolist(),
                "pressure_pa": step.pressure.round(1).tolist(),
                "predicted_mm": step.predicted_mm.round(3).tolist(),
            }
            for step in found.steps
        ],
        "explanation": found.explain().splitlines(),
    }


def _print(found: "Plan") -> None:
    console = Console()
    table = Table("bubble", "asked (mm)", "predicted (mm)", "between (mm)")
    for k in range(len(found.steps)):
        table.add_column(f"step {k + 1}: send (mm)")
    table.add_column("pressure (kPa)")
    for bubble in range(len(found.layout)):
        sent = [f"{step.target_mm[bubble]:.2f}" for step in found.steps]
        asked, predicted = found.asked_mm[bubble], found.predicted_mm[bubble]
        between = f"{found.low_mm[bubble]:.2f} … {found.high_mm[bubble]:.2f}"
        held = f"{found.shape.pressure[bubble] / 1e3:.2f}"
        table.add_row(str(bubble), f"{asked:.2f}", f"{predicted:.2f}", between, *sent, held)
    console.print(table)
    console.print(found.explain(), highlight=False, markup=False, soft_wrap=True)


commands = [plan]
