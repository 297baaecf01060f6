"""`bubbleskin inject`: make a part of a board fail, and see what the firmware makes of it."""

import contextlib
import json as jsonlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.table import Table

from bubbleskin.cli.options import Real, as_json, device_or_simulated
from bubbleskin.connecting import connect
from bubbleskin.errors import DeviceRefused, InvalidInput, LinkError

if TYPE_CHECKING:
    from bubbleskin.skin import Skin

_EVERY_S = 0.02
_MOVE_MM = 2.0
_FLAT_S = 1.5


@click.command()
@click.argument("words", nargs=-1, metavar="PART [NUMBER] HOW")
@device_or_simulated
@click.option(
    "--height",
    type=Real(0.0, unit="mm"),
    default=8.0,
    show_default=True,
    help="What all bubbles are to show meanwhile, mm.",
)
@click.option("--seconds", type=Real(0.1, 60.0, "s"), default=3.0, show_default=True, help="How long the firmware has.")
@click.option("--list", "listed", is_flag=True, help="Print what can fail in which ways, and do nothing else.")
@click.option("--permit", is_flag=True, help="Let a real board do it to itself, which nobody may wear then.")
@as_json
def inject(
    words: tuple[str, ...], device: str, height: float, seconds: float, listed: bool, permit: bool, json: bool
) -> None:
    """Make a part of a board fail, and say what its firmware finds, when, and what it says to do.

    For example: `bubbleskin inject sensor 3 stuck`. All bubbles stand at --height before; after the failure they rise by 2 mm
    and come down, because some failures are felt in a move only.
    """
    from bubbleskin.sim.failures import TABLE

    if listed:
        _print_table(json, [(each.part, each.how, each.meaning, each.board is not None) for each in TABLE])
        return
    part, number, how = _meant(words)
    with connect(device) as skin, _permitted(skin, permit, part, number, how):
        skin.show([height] * skin.info.bubbles)
        found = _watched(skin, lambda: skin.inject(part, number, how), height, seconds)
    if json:
        click.echo(jsonlib.dumps({"part": part, "number": number, "how": how, "found": found}, indent=2))
        return
    for each in found:
        click.echo(f"{each['after_s']:.2f} s: {each['said']}")
    if not found:
        click.echo(f"The firmware has found nothing within {seconds:g} s.")


def _meant(words: tuple[str, ...]) -> tuple[str, int, str]:
    """The part, whose words may be two, its number, and how it fails."""
    from bubbleskin.sim.failures import OF_BUBBLES, failure_of, part_of

    if len(words) < 2:
        raise InvalidInput(
            "Say what fails and how, such as `bubbleskin inject sensor 3 stuck`; --list has all of them."
        )
    *parts, how = words
    number = parts.pop() if parts[-1].isdecimal() else None
    part = part_of(" ".join(parts))
    failure_of(part, how)
    if part in OF_BUBBLES and number is None:
        raise InvalidInput(f"Say of which bubble, such as `bubbleskin inject {part} 3 {how}`.")
    return part, int(number or 0), how


@contextlib.contextmanager
def _permitted(skin: "Skin", permit: bool, part: str, number: int, how: str) -> Iterator[None]:
    """A real board needs permission, and loses it in the end; what it cannot do is refused before anything moves."""
    from bubbleskin.sim.failures import on_board

    if skin.simulated is not None:
        yield
        return
    if not permit:
        raise InvalidInput(
            f"{skin.link.transport.name} is a real board: with --permit it makes a part of itself fail, while nobody wears it."
        )
    on_board(part, number, how, skin.info.bubbles)
    skin.vent()
    skin.permit_injection()
    try:
        yield
    finally:
        with contextlib.suppress(LinkError, DeviceRefused):
            skin.permit_injection(False)
            skin.vent()
            skin.sleep(_FLAT_S)
            skin.clear_faults()


def _watched(skin: "Skin", fail: Callable[[], None], height: float, seconds: float) -> list[dict[str, Any]]:
    """What the fault log gets, and where the wristband is not heard any more, that.

    All bubbles rise and come down meanwhile: some failures are felt in a move only.
    """
    known = {fault.id for fault in skin.fault_log()}
    begin, top = skin.link.transport.now(), skin.info.height_max_mm
    booted = skin.state().time - begin
    moves = [(0.5, min(height + _MOVE_MM, top)), (0.5 + seconds / 3, max(height - _MOVE_MM, 0.0))]
    found: dict[int, dict[str, Any]] = {}
    fail()
    try:
        while (after := skin.link.transport.now() - begin) < seconds:
            if moves and after >= moves[0][0]:
                with contextlib.suppress(DeviceRefused):  # the fault log says why
                    skin.show([moves.pop(0)[1]] * skin.info.bubbles, wait=False)
            skin.sleep(_EVERY_S)
            for fault in skin.fault_log():
                if fault.id in known:
                    continue
                at = max(fault.time - booted - begin, 0.0)
                said = f"{fault.name} of {fault.where}: {fault.meaning}. {fault.remedy}."
                found.setdefault(
                    fault.id, {"name": fault.name, "bubble": fault.bubble, "after_s": round(at, 3), "said": said}
                )
    except LinkError as error:
        after = skin.link.transport.now() - begin
        found[-1] = {"name": "link", "bubble": None, "after_s": round(after, 3), "said": str(error)}
    return list(found.values())


def _print_table(json: bool, rows: list[tuple[str, str, str, bool]]) -> None:
    if json:
        names = ("part", "how", "meaning", "real_board")
        click.echo(jsonlib.dumps([dict(zip(names, row, strict=True)) for row in rows], indent=2))
        return
    table = Table("part", "how", "what it does then", "on a real board")
    for part, how, meaning, real in rows:
        table.add_row(part, how, meaning, "yes" if real else "")
    Console().print(table)


commands = [inject]
