"""`bubbleskin bring-up`: a board that has never run, step by step."""

import json as jsonlib
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from bubbleskin.cli.options import as_json, device
from bubbleskin.connecting import connect

if TYPE_CHECKING:
    from bubbleskin.bringup.questions import Question
    from bubbleskin.bringup.report import Step

_STOP = ("stop", "q")


@click.command("bring-up")
@device
@click.option("--save/--no-save", default=True, show_default=True, help="Keep the sensors' zeros without power.")
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    multiple=True,
    help="Write the report to a .json, .html or .txt file; may be repeated.",
)
@click.option("--board", metavar="FILE", help="The board's file, where it is one of your own.")
@as_json
def bring_up(device: str | None, save: bool, output: tuple[Path, ...], board: str | None, json: bool) -> int:
    """Bring up a board that has never run: step by step, and only after each yes.

    Power, emergency stop, sensors, a short pulse of each bubble's valves with it off its barb, swapped wires and tubes, pump and
    dump valve, one bubble low, all. No and Ctrl-C vent and end it at any question; the report says what was done. Status 1
    where something is to be mended or it was ended.

    A simulated board needs nobody's hands: it presses, pulls and looks by itself, after each yes.
    """
    from bubbleskin.bringup.report import refuse_suffix
    from bubbleskin.bringup.session import bring_up as begin

    for path in output:
        refuse_suffix(path)
    console = Console(stderr=True, highlight=False, markup=False)
    with connect(device) as skin:
        console.print(
            f"{skin.info.board}, {skin.info.bubbles} bubbles. Nothing moves before a yes; no and Ctrl-C vent and end it.\n"
            "Answer yes or no."
        )
        found = begin(skin, _asker(console), save=save, board=board, progress=lambda step: _tell(console, step))
    for path in output:
        found.save(path)
        click.echo(f"wrote {path}", err=True)
    click.echo(jsonlib.dumps(found.as_dict(), indent=2) if json else "\n" + found.report())
    return 0 if found.passed else 1


def _asker(console: Console):  # type: ignore[no-untyped-def]
    """Asks at the terminal; the end of the input is as Ctrl-C."""

    def ask(question: "Question") -> bool:
        console.print(f"\n{question.text}")
        while True:
            try:
                answer = (
                    click.prompt("yes or no" + ", or stop" * question.look, prompt_suffix=": ", err=True)
                    .strip()
                    .lower()
                )
            except click.Abort:
                console.print("")
                raise KeyboardInterrupt from None
            if answer in _STOP:
                raise KeyboardInterrupt
            if answer in ("yes", "y", "no", "n"):
                return bool(answer[0] == "y")
            console.print(f"{answer[:40]!r} is neither yes nor no.")

    return ask


def _tell(console: Console, step: "Step") -> None:
    found = f"{len(step.findings)} found" if step.findings else "as it should be" if step.done else "not finished"
    console.print(f"== {step.title}: {found}")


commands = [bring_up]
