"""`bubbleskin fit-contact`: springs of one's own sheet from a table of measured shapes."""

import json as jsonlib
from pathlib import Path

import click

from bubbleskin import boards
from bubbleskin.cli.options import Board, Real, as_json
from bubbleskin.layout import Layout

_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command("fit-contact")
@click.argument("data", type=_FILE)
@click.option("--board", type=Board(), default=boards.DEFAULT, show_default=True)
@click.option("--layout", "layout_path", type=_FILE, help="A layout of your own, in JSON, instead of a board's.")
@click.option("--height-noise-mm", type=Real(above_zero=True, high=100.0, unit="mm"), default=0.05, show_default=True)
@click.option(
    "--pressure-noise-kpa", type=Real(above_zero=True, high=100.0, unit="kPa"), default=0.05, show_default=True
)
@click.option("-o", "--output", type=_FILE, help="Write the springs, for `plan --contact`.")
@as_json
def fit_contact(
    data: Path,
    board: str,
    layout_path: Path | None,
    height_noise_mm: float,
    pressure_noise_kpa: float,
    output: Path | None,
    json: bool,
) -> None:
    """Fit necks and contact to DATA, a table of measured shapes in which bubbles press each other.

    Columns: shape, step, bubble, sent [mm], height [mm], pressure [kPa]: a row for each bubble and step on the way to a
    shape, with what was measured at its end. One of the last two can be missing; held [kPa] instead of sent [mm] where
    pressures were held. The noises are one sigma.
    """
    from bubbleskin.contact.fit import fit_contact as find

    layout = Layout.from_file(layout_path) if layout_path else Layout.of_board(board)
    found = find(data, layout, sd_mm=height_noise_mm, sd_pa=1e3 * pressure_noise_kpa)
    click.echo(jsonlib.dumps(found.as_dict(), indent=2) if json else found.report())
    if output:
        found.save(output)
        click.echo(f"wrote {output}", err=True)


commands = [fit_contact]
