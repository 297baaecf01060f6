"""`bubbleskin play`: sequences from files and from the library."""

import dataclasses
import json as jsonlib
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from bubbleskin.cli.options import LOOPS, Real, as_json, device
from bubbleskin.connecting import connect
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sequence.library import LIBRARY
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.playback import PlaybackReport, PlaybackStatus


@click.command()
@click.argument("what", metavar=f"FILE|{'|'.join(LIBRARY)}")
@click.option("--loops", type=LOOPS, help="How often to play it all; 0: until Ctrl-C. Default: as the sequence says.")
@click.option("--at", type=Real(0.0, unit="s"), metavar="S", help="Device time at which to begin; default: at once.")
@device
@as_json
def play(what: str, loops: int | None, at: float | None, device: str | None, json: bool) -> None:
    """Play a sequence: a .json or .csv FILE, or one of the library.

    The wristband executes it by its own clock and keeps its last shape. Ctrl-C stops it: all valves are closed at
    once, then everything vents.
    """
    from_file = None if what in LIBRARY else _file(what, loops)
    with connect(device) as skin:
        sequence = from_file or _library(what, skin.layout, loops)
        console = Console(stderr=json)
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[step]}"),
            TimeElapsedColumn(),
        )
        try:
            with Progress(*columns, console=console, transient=True, disable=json or not console.is_terminal) as bar:
                task = bar.add_task(f"{sequence.name or what} …", total=None, step="upload")

                def report(playing: PlaybackStatus) -> None:
                    done = f"step {playing.step}{f', {playing.name}' if playing.name else ''}"
                    paused = " (paused)" if playing.state == "paused" else ""
                    bar.update(task, completed=playing.begun_steps, total=playing.steps or None, step=done + paused)

                played = skin.play(sequence, at=at, progress=report)
        except KeyboardInterrupt:
            skin.stop()
            skin.vent()
            raise
    if json:
        click.echo(jsonlib.dumps(dataclasses.asdict(played)))
    else:
        _say(console, sequence, played)


def _file(what: str, loops: int | None) -> Sequence:
    path = Path(what)
    if not path.suffix and not path.exists():
        raise InvalidInput(f"There is no sequence {what!r}; give a .json or .csv file, or one of {', '.join(LIBRARY)}.")
    sequence = Sequence.load(path)
    if loops is None:
        return sequence
    return Sequence(sequence.steps, loops=loops, name=sequence.name, board=sequence.board, layout=sequence.layout)


def load(what: str, layout: Layout, loops: int | None) -> Sequence:
    """The sequence of a file or of the library for `layout`, played `loops` times."""
    return _library(what, layout, loops) if what in LIBRARY else _file(what, loops)


def _library(what: str, layout: Layout, loops: int | None) -> Sequence:
    return LIBRARY[what](layout) if loops is None else LIBRARY[what](layout, loops=loops)


def _say(console: Console, sequence: Sequence, played: PlaybackReport) -> None:
    seconds = played.ended - played.began[0] if played.began else 0.0
    console.print(
        f"Played {sequence.name or 'it'}: {len(played.steps)} steps in {seconds:.3f} s by the wristband's clock.",
        highlight=False,
    )
    for sentence in played.timeouts:
        console.print(sentence, highlight=False)


commands = [play]
