"""`bubbleskin studio`: the page."""

import importlib.util
import json as jsonlib
import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from bubbleskin import boards
from bubbleskin.cli.options import Whole, as_json
from bubbleskin.errors import BubbleskinError

if TYPE_CHECKING:
    from bubbleskin.studio.server import Studio

PORT = 8808
_END = {False: "Closing its last page or Ctrl-C", True: "Ctrl-C"}


@click.command()
@click.option(
    "--device",
    envvar="BUBBLESKIN_DEVICE",
    metavar="URL",
    show_envvar=True,
    default=f"sim://{boards.DEFAULT}",
    show_default=True,
    help="The wristband to begin with; another can be chosen in the page. Simulated ones run in real time.",
)
@click.option("--port", type=Whole(0, 65535), default=PORT, show_default=True, help="Port of the page; 0: a free one.")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address at which to listen. Anything but loopback lets your network in, with the token only, unencrypted.",
)
@click.option(
    "--open/--no-open", "opened", default=None, help="Open the page in a browser. Default: where there is a screen."
)
@click.option("--stay", is_flag=True, help="Stay when the last page is closed: for notifications, and for other pages.")
@click.option(
    "--recordings",
    type=click.Path(exists=True, file_okay=False, writable=True, path_type=Path),
    metavar="FOLDER",
    help="Where recordings stay. Default: they go when the studio ends.",
)
@as_json
def studio(
    device: str, port: int, host: str, opened: bool | None, stay: bool, recordings: Path | None, json: bool
) -> None:
    """See a wristband live in a browser, and play it: by hand, pulse, terrain, buttons. Until its last page is closed, or Ctrl-C.

    Needs the extra `bubbleskin[studio]`. Every run has a token of its own, which is in the address that is printed; nobody
    comes in without it. Where no page is open any more, everything vents, and it ends unless told to stay.
    """
    if importlib.util.find_spec("nicegui") is None:
        raise BubbleskinError("The studio needs NiceGUI. Install it with `pip install 'bubbleskin[studio]'`.")
    from bubbleskin.studio.server import run

    def ready(running: "Studio") -> None:
        if json:
            click.echo(jsonlib.dumps({"url": running.url, "token": running.token}))
        else:
            Console(soft_wrap=True).print(
                f"The studio is at [bold]{running.url}[/bold]. {_END[stay]} vents and ends it.", highlight=False
            )
        sys.stdout.flush()
        if _has_screen() and not json if opened is None else opened:
            webbrowser.open(running.url)

    run(device, host, port, ready, stays=stay, folder=recordings)


def _has_screen() -> bool:
    """Whether a browser that opens would be seen by whoever has typed this."""
    if not sys.stdout.isatty():
        return False
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


commands = [studio]
