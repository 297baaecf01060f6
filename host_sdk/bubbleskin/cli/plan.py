"""`bubbleskin plan`: how to get a shape of bubbles that touch."""

import json as jsonlib
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
from rich.console import Console
from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from bubbleskin import boards
from bubbleskin.cli.options import Board, as_json, progress
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.shape import shapes
from bubbleskin.shape.heightfield import Heights

if TYPE_CHECKING:
    from bubbleskin.planner.plan import Plan

_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("heights", nargs=-1, metavar="[MM]...")
@click.option("--shape", type=click.Choice(list(shapes.SHAPES)), help="A ready-made shape.")
@click.option("--file", "path", type=_FILE, help="A heightfield: .npy, or numbers in .csv.")
@click.option("--from", "begin", metavar="MM,MM,…", help="Heights of the shape that the array has now. Default: flat.")
@click.option("--board", type=Board(), default=boards.DEFAULT, show_default=True)
@click.option("--layout", "layout_path", type=_FILE, help="A layout of your own, in JSON, instead of a board's.")
@click.option("--plot", type=_FILE, help="Draw the shape from the side and from above.")
@as_json
def plan(
    heights: tuple[str, ...],
    shape: str | None,
    path: Path | None,
    begin: str | None,
    board: str,
    layout_path: Path | None,
    plot: Path | None,
    json: bool,
) -> None:
    """Plan a shape: one height in MM per bubble, or one of --shape and --file.

    Says which bubbles go when, what to send to the wristband in each step, and which heights come of it. A shape
    that cannot be had is answered with the nearest one found.
    """
    from bubbleskin.contact.model import CompliantContact
    from bubbleskin.planner.search import plan as find

    if sum([bool(heights), shape is not None, path is not None]) != 1:
        raise InvalidInput("Say the shape in one way: a height in mm per bubble, or one of --shape and --file.")
    layout = Layout.from_file(layout_path) if layout_path else Layout.of_board(board)
    asked: Heights = (
        shapes.load(path) if path else shapes.SHAPES[shape](layout) if shape else shapes.parse_heights(heights)
    )
    contact = CompliantContact(layout)
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


def _facts(found: "Plan") -> dict[str, object]:
    return {
        "asked_mm": found.asked_mm.round(3).tolist(),
        "predicted_mm": found.predicted_mm.round(3).tolist(),
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
    table = Table("bubble", "asked (mm)", "predicted (mm)")
    for k in range(len(found.steps)):
        table.add_column(f"step {k + 1}: send (mm)")
    table.add_column("pressure (kPa)")
    for bubble in range(len(found.layout)):
        sent = [f"{step.target_mm[bubble]:.2f}" for step in found.steps]
        asked, predicted = found.asked_mm[bubble], found.predicted_mm[bubble]
        held = f"{found.shape.pressure[bubble] / 1e3:.2f}"
        table.add_row(str(bubble), f"{asked:.2f}", f"{predicted:.2f}", *sent, held)
    console.print(table)
    console.print(found.explain(), highlight=False, markup=False, soft_wrap=True)


commands = [plan]
