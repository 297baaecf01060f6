"""`bubbleskin plot`: every picture that the command draws."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from rich.console import Console

from bubbleskin import boards
from bubbleskin.cli.membrane import (
    DATA,
    HEIGHT,
    balloon,
    draw_fit,
    fit_file,
    fit_options,
    material_options,
    picture_option,
)
from bubbleskin.cli.options import LOOPS, SEED, Board, Real, Whole, progress
from bubbleskin.cli.play import load
from bubbleskin.connecting import connect
from bubbleskin.sequence.library import LIBRARY


@click.group()
def plot() -> None:
    """Draw the membrane, contact and sequences: curves, fits, tables, the paper's figures 4 to 6, animations."""


@plot.command("curve")
@material_options
@click.option("--up-to-mm", type=HEIGHT, default=14.0, show_default=True, help="Where the curve ends.")
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
@click.option("--bubble", type=Whole(0, 1000), default=0, show_default=True)
@picture_option("table")
def plot_table(calibration: Path, bubble: int, output: Path) -> None:
    """The knots of one bubble of the file CALIBRATION on their curve, with the error between them."""
    from bubbleskin.membrane import Calibration
    from bubbleskin.plot import membrane

    membrane.save(membrane.plot_table(Calibration.load(calibration).table(bubble)), output)
    click.echo(f"wrote {output}", err=True)


@plot.command("figure4")
@click.option("--seed", type=SEED, default=4, show_default=True)
@picture_option("figure4")
def plot_figure_4(seed: int, output: Path) -> None:
    """Like figure 4 of the paper: height against pressure with the model, from simulated measurements."""
    from bubbleskin.plot import membrane

    membrane.save(membrane.figure_4(seed=seed)[0], output)
    click.echo(f"wrote {output} (simulated measurements)", err=True)


@plot.command("figure6")
@click.option("--seed", type=SEED, default=6, show_default=True)
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


@plot.command("sequence")
@click.argument("what", metavar=f"FILE|{'|'.join(LIBRARY)}")
@click.option("--board", type=Board(), default=boards.DEFAULT, show_default=True)
@click.option("--loops", type=LOOPS, help="How often to play it all. Default: as the sequence says.")
@click.option("--rate", type=Whole(1, 50), default=15, show_default=True, help="Pictures a second.")
@click.option("--seconds", type=Real(0.0, 3600.0, "s"), default=30.0, show_default=True, help="At most so much of it.")
@click.option("-o", "--output", type=DATA, default="sequence.gif", show_default=True, help=".gif, or .mp4 with ffmpeg.")
def plot_sequence(what: str, board: str, loops: int | None, rate: int, seconds: float, output: Path) -> None:
    """A film of a sequence: the true shapes of a simulated wristband that plays it, from above and from the side."""
    from bubbleskin.plot import sequence as film

    with progress(Console(stderr=True)) as bar, connect(f"sim://{board}") as skin:
        sequence = load(what, skin.layout, loops)
        task = bar.add_task("playing", total=min(sequence.duration, seconds))
        frames = film.watch(
            skin, sequence, rate=rate, seconds=seconds, progress=lambda time: bar.update(task, completed=time)
        )
        task = bar.add_task("drawing", total=len(frames))
        film.animate(
            skin.layout, frames, output, title=sequence.name, progress=lambda done: bar.update(task, completed=done)
        )
    click.echo(f"wrote {output} ({len(frames)} pictures of a simulated {skin.info.board})", err=True)


commands = [plot]
