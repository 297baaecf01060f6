"""`bubbleskin hil`: the suite that every target passes, on yours."""

import os
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn

import click

import bubbleskin
from bubbleskin import boards
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.files import parse_toml, read_text

INSTALL = "pip install 'bubbleskin[hil]'"
_NEEDED = ("pytest", "pytest_timeout", "pytest_html")


@click.command()
@click.option(
    "--device",
    "devices",
    multiple=True,
    envvar="BUBBLESKIN_DEVICE",
    metavar="URL",
    show_envvar=True,
    help=f"A port or URL; several times for several targets in one run.  [default: sim://{boards.DEFAULT}]",
)
@click.option(
    "--map",
    "hardware",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="A .toml file of more devices: in [devices] a name and a port or URL each.",
)
@click.option(
    "--only", metavar="WORDS", help="Tests whose names have these words, such as 'safety' or 'line and not vent'."
)
@click.option(
    "--html", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Write a report to look at."
)
@click.option("--junit", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Write JUnit XML.")
@click.option(
    "--permit-failures",
    "failures",
    is_flag=True,
    help="On a real wristband too, let parts of it fail on purpose, such as a sensor: nobody may wear it.",
)
@click.option("--list", "names", is_flag=True, help="Say what would be tried, and touch nothing.")
def hil(
    devices: tuple[str, ...],
    hardware: Path | None,
    only: str | None,
    html: Path | None,
    junit: Path | None,
    failures: bool,
    names: bool,
) -> NoReturn:
    """Try on a device what docs/safety.md, link.md, store.md and control.md promise.

    A board that has never moved is asked for little at first, and for no more where that fails. What needs a
    failure is tried on simulated targets, and on a real one with --permit-failures, as far as it can fail on purpose; the
    rest is said. Status 0: all of it holds; 1: something does not.
    """
    if missing():
        raise BubbleskinError(f"`bubbleskin hil` needs {', '.join(missing())}: {INSTALL}")
    import pytest

    folder = suite()
    arguments = [
        str(folder),
        f"--rootdir={folder}",
        "-c",
        os.devnull,
        "-p",
        "no:cacheprovider",
        "-ra",
        "--import-mode=importlib",
    ]
    if hardware is not None:
        devices += mapped(hardware)
    for device in devices or (f"sim://{boards.DEFAULT}",):
        arguments += ["--target", device]
    arguments += ["-k", only] if only else []
    arguments += [f"--html={html}", "--self-contained-html"] if html else []
    arguments += [f"--junit-xml={junit}", "-o", "junit_family=xunit1"] if junit else []  # with figures of tests
    arguments += ["--permit-failures"] if failures else []
    arguments += ["--collect-only", "-q"] if names else []
    raise SystemExit(pytest.main(arguments))


def mapped(path: Path) -> tuple[str, ...]:
    """The devices that a hardware map names, in its order; `InvalidInput` where it is none."""
    found = parse_toml(read_text(path, "a hardware map"), str(path)).get("devices")
    if not isinstance(found, dict) or not found or not all(isinstance(url, str) for url in found.values()):
        raise InvalidInput(
            f'{path} has no table [devices] of a name and a port or URL each, such as left = "/dev/ttyACM0".'
        )
    return tuple(found.values())


def missing() -> list[str]:
    """What it needs and is not installed."""
    return [name for name in _NEEDED if find_spec(name) is None]


def suite() -> Path:
    """Where the tests are: in an installed package, or in a checkout beside it."""
    package = Path(bubbleskin.__file__).parent
    for folder in (package / "hil", package.parents[1] / "hil_tests"):
        if (folder / "conftest.py").is_file():
            return folder
    raise BubbleskinError("The tests of `bubbleskin hil` are not in this installation; install bubbleskin again.")


commands = [hil]
