"""`bubbleskin plot`: every picture that the command draws."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from bubbleskin.cli.membrane import DATA, balloon, draw_fit, fit_file, fit_options, material_options, picture_option


@click.group()
def plot() -> None:
    """Draw the membrane, contact and sequences: curves, fits, tables, the paper's figures 4 to 6, animations."""


@plot.command("curve")
@material_options
@click.option("--up-to-mm", type=float, default=14.0, show_default=True, help="Where the curve ends.")
@picture_option("curve")
def plot_curve(preset: str, up_to_mm: float, output: Path, **options: Any) -> None:
    """Height against pressure: stable solid, unstable dashed, jumps marked."""
    from bubbleskin.plot import membrane

    drawn = balloon(preset, **options)
    name = f"μ = {drawn.mu / 1e3:.4g} kPa, {drawn.wall} wall"
    membrane.save(membrane.plot_curve({name: drawn}, up_to_mm=up_to_mm), output)
    click.echo(f"wrote {output}", err=True)


@plot.command("fit")
@click.argument("data", type=DATA)
@fit_options
@picture_option("fit")
def plot_fit(data: Path, output: Path, **options: Any) -> None:
    """The points of DATA with error bars, the fitted curves and their 95 % confidence band."""
    measurements, found = fit_file(data, **options)
    draw_fit(found, measurements, output)


@plot.command("table")
@click.argument("calibration", type=DATA)
@click.option("--bubble", type=int, default=0, show_default=True)
@picture_option("table")
def plot_table(calibration: Path, bubble: int, output: Path) -> None:
    """The knots of one bubble of the file CALIBRATION on their curve, with the error between them."""
    from bubbleskin.physics import Calibration
    from bubbleskin.plot import membrane

    membrane.save(membrane.plot_table(Calibration.load(calibration).table(bubble)), output)
    click.echo(f"wrote {output}", err=True)


@plot.command("figure4")
@click.option("--seed", type=int, default=4, show_default=True)
@picture_option("figure4")
def plot_figure_4(seed: int, output: Path) -> None:
    """Like figure 4 of the paper: height against pressure with the model, from simulated measurements."""
    from bubbleskin.plot import membrane

    membrane.save(membrane.figure_4(seed=seed)[0], output)
    click.echo(f"wrote {output} (simulated measurements)", err=True)


@plot.command("figure6")
@click.option("--seed", type=int, default=6, show_default=True)
@picture_option("figure6")
def plot_figure_6(seed: int, output: Path) -> None:
    """Like figure 6 of the paper: how bubbles of one sheet differ, from simulated measurements."""
    from bubbleskin.plot import membrane

    membrane.save(membrane.figure_6(seed=seed)[0], output)
    click.echo(f"wrote {output} (simulated measurements)", err=True)


@plot.command("order")
@picture_option("order")
def plot_order(output: Path) -> None:
    """Like figure 5 of the paper: the height of the centre against the order of inflation, with the shapes."""
    from bubbleskin.plot import contact, membrane

    membrane.save(contact.plot_order(), output)
    click.echo(f"wrote {output} (the model's heights)", err=True)


commands = [plot]
