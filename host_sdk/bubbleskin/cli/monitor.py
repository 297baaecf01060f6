"""`bubbleskin monitor`: telemetry live in the terminal, as lines of JSON, and to a file."""

import contextlib
import dataclasses
import json as jsonlib
from pathlib import Path

import click
from rich.console import Console
from rich.live import Live

from bubbleskin.cli.options import Real, as_json, device
from bubbleskin.connecting import connect
from bubbleskin.telemetry.recording import Table

_SHOWN = ("height", "pressure", "target", "status", "faults")
_DRAWN = 0.1  # seconds of device time between two drawings
_PINGED = 1.0


@click.command()
@click.option("--rate", type=Real(), default=20.0, show_default=True, help="Times a second.")
@click.option(
    "--seconds",
    type=Real(above_zero=True, unit="s"),
    help="End after so many seconds of device time; without it, at Ctrl-C.",
)
@click.option(
    "--record",
    "path",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Record to a .csv or .parquet file too.",
)
@device
@as_json
def monitor(rate: float, seconds: float | None, path: Path | None, device: str | None, json: bool) -> None:
    """Watch heights, pressures and faults live; with --json, a line for each state."""
    from bubbleskin.plot.terminal import Monitor

    console = Console()
    with connect(device) as skin, contextlib.ExitStack() as open_files:
        view = Monitor(device or "the only port", skin.info, skin.layout)
        file = Table(path, skin.info, skin.layout, rate) if path else None
        if file:
            open_files.callback(file.close)
        live = None if json else open_files.enter_context(Live(console=console, auto_refresh=False))
        clock = skin.clock
        begin = drawn = pinged = None
        for state in skin.telemetry(rate, _SHOWN):
            begin = state.time if begin is None else begin
            view.take(state)
            if file:
                file.write(state)
            if pinged is None or state.time - pinged >= _PINGED:
                pinged = state.time
                clock = skin.synchronise(1)
            if json:
                facts = dataclasses.asdict(state) | {"clock_uncertainty": clock.uncertainty}
                click.echo(jsonlib.dumps(facts, default=lambda array: array.tolist()))
            elif live and (drawn is None or state.time - drawn >= _DRAWN):
                drawn = state.time
                live.update(view.render(console.width, clock), refresh=True)
            if seconds is not None and state.time - begin >= seconds:
                break
        if live:
            live.update(view.render(console.width, clock), refresh=True)
    if file and not json:
        console.print(f"{file.rows} states are in [bold]{file.path}[/bold].", highlight=False)


commands = [monitor]
