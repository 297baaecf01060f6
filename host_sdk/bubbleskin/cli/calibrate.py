"""`bubbleskin calibrate`: a wristband measures itself."""

import json as jsonlib
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click
from rich.console import Console

from bubbleskin.cli.options import Whole, as_json, device, gathered, progress_of_parts
from bubbleskin.connecting import connect
from bubbleskin.errors import DeviceFault, InvalidInput

if TYPE_CHECKING:  # it loads scipy
    from bubbleskin.calibrate.measure import CalibrationProgress
    from bubbleskin.calibrate.result import SelfCalibration

_FILE = click.Path(dir_okay=False, path_type=Path)


class Chosen(NamedTuple):
    """What is calibrated, or taken from a file, and whether it is kept."""

    bubbles: tuple[int, ...]
    board: str | None
    load: Path | None
    heights: Path | None
    upload: bool
    save: bool


class Written(NamedTuple):
    """Where it goes besides."""

    output: Path | None
    picture: Path | None


@click.command()
@click.option("--bubbles", type=Whole(0, 255), multiple=True, help="One bubble, may be repeated; without it all.")
@click.option("--save/--no-save", default=True, show_default=True, help="Keep it without power.")
@click.option("-o", "--output", type=_FILE, help="Write raw data and what was found to a JSON file.")
@click.option("--picture", type=_FILE, help="Draw curves, fits and bands: png, svg or pdf.")
@click.option("--board", metavar="FILE", help="The board's file, where it is one of your own.")
@click.option("--load", type=_FILE, help="Fit the raw data of such a file again instead of measuring.")
@click.option(
    "--heights",
    type=_FILE,
    help="With --load: measured heights, a CSV file: bubble, told [mm], measured [mm].",
)
@click.option("--upload", is_flag=True, help="With --load: let the wristband use it.")
@device
@as_json
@gathered(chosen=Chosen, written=Written)
def calibrate(chosen: Chosen, written: Written, device: str | None, json: bool) -> int:
    """Let the wristband measure itself: valves, line, rubber and leaks of each bubble, with its own sensors.

    Bubbles rise to 13 mm in groups that do not touch: 20 s for 7 bubbles, 40 s for 19. Nobody may touch them. Those that
    are accepted get a table and a trim of their own. Status 1 where one is not.
    """
    from bubbleskin.calibrate.result import SelfCalibration

    if chosen.load and chosen.bubbles:
        raise InvalidInput("--load fits all bubbles of its file; leave --bubbles out.")
    if not chosen.load and (chosen.heights or chosen.upload):
        raise InvalidInput("--heights and --upload go with --load: heights are told by a calibration that is in use.")
    found = SelfCalibration.load(chosen.load) if chosen.load else _measured(chosen, device)
    if chosen.heights:
        from bubbleskin.calibrate.heights import read_heights

        found = found.refined(read_heights(chosen.heights))
    if chosen.upload:
        with connect(device) as skin:
            skin.upload_calibration(found, chosen.save)
    if written.output:
        found.save(written.output)
    click.echo(jsonlib.dumps(found.as_dict(), indent=2) if json else found.report())
    if written.picture:
        from bubbleskin.plot import calibration

        calibration.save(calibration.draw(found), written.picture)
    for path in (written.output, written.picture):
        if path:
            click.echo(f"wrote {path}", err=True)
    return 0 if len(found.accepted) == len(found.bubbles) else 1


def _measured(chosen: Chosen, device: str | None) -> "SelfCalibration":
    with connect(device) as skin, progress_of_parts(Console(stderr=True)) as bar:
        if skin.faults():
            raise DeviceFault(
                f"Bubbles {', '.join(map(str, skin.faults()))} have faults; see `bubbleskin info`, and clear them."
            )
        task = bar.add_task("begin", total=1.0)

        def tell(now: "CalibrationProgress") -> None:
            which = f" of {', '.join(map(str, now.bubbles))}" if now.bubbles else ""
            bar.update(task, completed=now.done, description=now.what + which)

        return skin.calibrate(chosen.bubbles or None, save=chosen.save, board=chosen.board, progress=tell)


commands = [calibrate]
