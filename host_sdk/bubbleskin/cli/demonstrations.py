"""`bubbleskin demo pulse`, `demo terrain` and `demo buttons`: the paper's demonstrations."""

import contextlib
import json as jsonlib
import math
import sys
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from click.core import ParameterSource
from rich.console import Console, RenderableType
from rich.live import Live

from bubbleskin import boards
from bubbleskin.cli.device import demo
from bubbleskin.cli.options import LOOPS, Real, as_json, gathered
from bubbleskin.connecting import connect
from bubbleskin.demonstrations import keyboard
from bubbleskin.demonstrations import pulse as pulses
from bubbleskin.demonstrations.buttons import Buttons
from bubbleskin.demonstrations.landscapes import LANDSCAPES
from bubbleskin.demonstrations.pointer import PATHS, RATE_HZ, SPEED_MM_S, Moment, Pointer, follow
from bubbleskin.demonstrations.terrain import MODES, WIDTH_MM, Terrain
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.shape.heightfield import FILLS
from bubbleskin.skin import Skin

_REALTIME = f"sim://{boards.DEFAULT}?realtime=1"
"""Where nobody says a device: a simulated one, at the pace at which one can watch it."""
_SHAPES_A_DRAWING = 3

_device = click.option(
    "--device", envvar="BUBBLESKIN_DEVICE", metavar="URL", show_envvar=True, help=f"Default: {_REALTIME}."
)


def _url(device: str | None) -> str:
    """The device of a demonstration: its own option's, or that of `bubbleskin demo` before it."""
    before = click.get_current_context().parent
    if device or before is None or before.get_parameter_source("device") is ParameterSource.DEFAULT:
        return device or _REALTIME
    return str(before.params["device"])


class _Ground(NamedTuple):
    """Which terrain."""

    what: str
    width: float
    fill: str | None


@demo.command("terrain")
@click.argument("what", metavar=f"{'|'.join(LANDSCAPES)}|FILE", default="volcano")
@click.option("--mode", type=click.Choice(MODES), default="plain", show_default=True, help="How it is felt.")
@click.option("--path", type=click.Choice(list(PATHS)), default="wander", show_default=True, help="The pointer's way.")
@click.option(
    "--speed",
    type=Real(above_zero=True, unit="mm/s"),
    default=SPEED_MM_S,
    show_default=True,
    help="The pointer's, mm/s.",
)
@click.option("--width", type=Real(above_zero=True, unit="mm"), default=WIDTH_MM, show_default=True, help="Of it, mm.")
@click.option("--seconds", type=Real(0.0, unit="s"), default=20.0, show_default=True, help="End after so many.")
@click.option("--fill", type=click.Choice(FILLS), help="What places that a FILE does not know are given.")
@_device
@as_json
@gathered(ground=_Ground)
def terrain(
    ground: _Ground, mode: str, path: str, speed: float, seconds: float, device: str | None, json: bool
) -> None:
    """The topographic mouse: feel a terrain under a pointer that moves over it, 30 shapes a second.

    WHAT is one of the terrains here, or a FILE: a picture (bright is high), a .tif with numbers, .npy, or a table of numbers.
    With --json, a line for each shape.
    """
    console = Console()
    with connect(_url(device)) as skin, contextlib.ExitStack() as shown:
        felt = _terrain(ground, skin.layout)
        live = None
        if console.is_terminal and not json:
            live = shown.enter_context(Live(console=console, auto_refresh=False, transient=True))
        pointer = Pointer(PATHS[path](felt), speed)
        off: list[float] = []
        for moment in follow(skin, felt, pointer, mode=mode, seconds=seconds):
            if json:
                click.echo(jsonlib.dumps(moment._asdict(), default=lambda array: array.tolist()))
            if live and len(off) % _SHAPES_A_DRAWING == 0:
                _draw(live, skin, felt, moment, mode)
            off.append(_off(skin, moment))
        skin.vent()
    if not json:
        console.print(_felt(felt, off), highlight=False, soft_wrap=True)


def _terrain(ground: _Ground, layout: Layout) -> Terrain:
    what, width, fill = ground
    if what in LANDSCAPES or not (Path(what).suffix or Path(what).exists()):
        return Terrain.named(what, layout, width_mm=width)
    return Terrain.load(what, layout, fill=fill, width_mm=width)


def _draw(live: Live, skin: Skin, felt: Terrain, moment: Moment, mode: str) -> None:
    from bubbleskin.plot.demonstrations import draw_terrain

    patch = felt.look(moment.x_mm, moment.y_mm, mode, skin.state())
    live.update(draw_terrain(felt, moment, patch), refresh=True)


def _off(skin: Skin, moment: Moment) -> float:
    """The mean square of true minus asked heights, nan where nobody knows the true ones."""
    return float(np.mean((skin.simulated.height_mm - moment.heights_mm) ** 2)) if skin.simulated else math.nan


def _felt(felt: Terrain, off: list[float]) -> str:
    rms = math.sqrt(sum(off) / len(off))
    how_well = "" if math.isnan(rms) else f", true heights within {rms:.2f} mm RMS of those asked"
    return f"Felt {felt.name} in {len(off)} shapes, {RATE_HZ:g} a second{how_well}."


@demo.command("pulse")
@click.option("--rate", type=Real(above_zero=True, unit="Hz"), default=pulses.RATE_HZ, show_default=True, help="In Hz.")
@click.option(
    "--depth", type=Real(above_zero=True, unit="mm"), default=pulses.DEPTH_MM, show_default=True, help="In mm."
)
@click.option("--loops", type=LOOPS, default=pulses.LOOPS, show_default=True, help="How many of them; 0: until Ctrl-C.")
@click.option(
    "--per-line", is_flag=True, help="Whenever a line comes on standard input, as of a program that notifies."
)
@_device
def pulse(rate: float, depth: float, loops: int, per_line: bool, device: str | None) -> None:
    """The pulse: the inner bubbles together, then the framing ring one after the other; once, or as a notification.

    `tail -f /var/log/messages | bubbleskin demo pulse --per-line` is felt whenever a line comes; several that come
    while it pulses are felt as one.
    """
    if per_line and not loops:
        raise InvalidInput(
            "A pulse without end is felt once, however many lines come: give --loops, or leave out --per-line."
        )
    console = Console()
    with connect(_url(device)) as skin:
        sequence = pulses.pulse(skin.layout, rate_hz=rate, depth_mm=depth, loops=loops)
        try:
            if not per_line:
                skin.play(sequence)
            for batch in pulses.pulse_per_line(skin, sys.stdin, sequence) if per_line else ():
                more = f" and {len(batch) - 1} more" if len(batch) > 1 else ""
                console.print(f"Felt: {batch[0]}{more}", markup=False, highlight=False)
        finally:
            skin.vent()


@demo.command("buttons")
@_device
@as_json
def buttons(device: str | None, json: bool) -> None:
    """Digital buttons by the keyboard: a bubble peeks out where one is, and rises when it is pressed.

    Arrows move, space presses, p paints on the way, digits press their bubble, c lets all down, q ends. Prints which bubble
    was pressed, with --json a line of it for scripts; keys are read from standard input where that is no terminal.
    """
    console = Console()
    with connect(_url(device)) as skin, contextlib.ExitStack() as shown:
        pad = Buttons.on(skin)
        said = [keyboard.HELP]
        live = None
        if console.is_terminal and not json:
            live = shown.enter_context(Live(console=console, auto_refresh=False, transient=True))

        def pressed(bubble: int) -> None:
            said[:] = [f"Bubble {bubble} was pressed."]
            if not live:
                click.echo(jsonlib.dumps({"bubble": bubble, "time": skin.state().time}) if json else said[0])

        for bubble in range(skin.info.bubbles):
            pad.on_press(bubble, pressed)
        taker = keyboard.Keyboard(pad)
        going = True
        while going:
            if live:
                live.update(_drawn(pad, said[0]), refresh=True)
            going = all(taker.take(key) for key in keyboard.keys(_typed()))
        skin.vent()


def _drawn(pad: Buttons, said: str) -> RenderableType:
    from bubbleskin.plot.demonstrations import draw_buttons

    return draw_buttons(pad, said)


def _typed() -> str:
    """The next key, or several that were typed at once; empty at the end of the input."""
    return click.getchar() if sys.stdin.isatty() else sys.stdin.read(1)


commands = [demo]
