"""A bring-up as it is kept: steps, findings, figures and trim; as text, JSON or a page."""

import html
import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from bubbleskin.bringup.evidence import Pulse
from bubbleskin.bringup.findings import Finding
from bubbleskin.device.trim import Trim
from bubbleskin.errors import InvalidInput
from bubbleskin.files import path_of, write_text

SUFFIXES = (".json", ".html", ".txt")


@dataclass
class Step:
    """One step: what was found, and what was measured."""

    name: str
    """Such as power."""
    title: str
    done: bool = False
    """Whether it came to its end."""
    findings: list[Finding] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)
    """What was measured, with units in the names; numbers, lists of them and texts."""

    @property
    def passed(self) -> bool:
        """Whether it came to its end and found nothing."""
        return self.done and not self.findings


@dataclass
class BringUp:
    """What a bring-up has found: made by `bubbleskin.bring_up`."""

    board: str
    firmware: str
    bubbles: int
    titles: tuple[str, ...]
    """Of all steps that there are."""
    steps: list[Step] = field(default_factory=list)
    """Those that were begun, in order."""
    pulses: list[Pulse] = field(default_factory=list)
    """Every pulse that was given, and what each sensor saw of it."""
    trim: Trim | None = None
    """The trim with the zeros that were found; None where it did not come to that."""
    saved: bool = False
    """Whether the board keeps that without power."""
    ended: str = ""
    """Why it ended before its last step, as a sentence; empty where it did not."""

    @property
    def findings(self) -> list[Finding]:
        """Everything that is wrong, in the order in which it was found."""
        return [finding for step in self.steps for finding in step.findings]

    @property
    def passed(self) -> bool:
        """Whether all steps came to their end and found nothing."""
        return not self.ended and len(self.steps) == len(self.titles) and all(step.passed for step in self.steps)

    @property
    def verdict(self) -> str:
        """All of it in a sentence."""
        if self.passed:
            return "Everything works as it should."
        if self.ended:
            return self.ended
        return (
            f"{len(self.findings)} things are to be mended."
            if len(self.findings) != 1
            else "One thing is to be mended."
        )

    def report(self) -> str:
        """For people: every step, what was found, and what comes next."""
        lines = [f"Bring-up of a {self.board} with {self.bubbles} bubbles, firmware {self.firmware}", ""]
        for step in self.steps:
            lines.append(f"{_mark(step)}  {step.title}{_figures(step)}")
            for finding in step.findings:
                lines += [f"      {finding.cause}", f"      To do: {finding.remedy}", f"      Seen: {finding.seen}"]
        lines += [f"--  {title}: not begun" for title in self.titles[len(self.steps) :]]
        lines += ["", self.verdict, self.what_next]
        return "\n".join(lines)

    @property
    def what_next(self) -> str:
        """What to do now."""
        if self.passed:
            kept = (
                "kept on the board"
                if self.saved
                else "in use until it restarts"
                if self.trim is not None
                else "as they were"
            )
            return f"The sensors' zeros are {kept}. Next: `bubbleskin calibrate`, so that every bubble knows itself."
        if self.findings:
            return "Mend what is listed, with the power off, and begin the bring-up again."
        return "Begin the bring-up again when you are ready: nothing is left under pressure."

    def as_dict(self) -> dict[str, Any]:
        """For scripts: everything, as JSON takes it."""
        trim = None
        if self.trim is not None:
            trim = {name: None if column is None else column.tolist() for name, column in vars(self.trim).items()}
        return {
            "board": self.board,
            "firmware": self.firmware,
            "bubbles": self.bubbles,
            "passed": self.passed,
            "verdict": self.verdict,
            "ended": self.ended,
            "steps": [asdict(step) | {"passed": step.passed} for step in self.steps],
            "not_begun": list(self.titles[len(self.steps) :]),
            "pulses": [asdict(pulse) for pulse in self.pulses],
            "trim": trim,
            "saved": self.saved,
        }

    def html(self) -> str:
        """For people: a page by itself."""
        rows = []
        for step in self.steps:
            found = "".join(
                f"<li><b>{html.escape(one.cause)}</b> {html.escape(one.remedy)} <i>{html.escape(one.seen)}</i></li>"
                for one in step.findings
            )
            rows.append(_row(_mark(step), step.title + _figures(step), f"<ul>{found}</ul>" * bool(found)))
        rows += [_row("--", f"{title}: not begun") for title in self.titles[len(self.steps) :]]
        title = html.escape(f"Bring-up of a {self.board}, firmware {self.firmware}")
        return (
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>'
            "body{font-family:sans-serif;max-width:50em;margin:2em auto}"
            "td{padding:.4em .8em;vertical-align:top;border-top:1px solid #ccc}"
            f"</style></head><body><h1>{title}</h1><p>{html.escape(self.verdict)} {html.escape(self.what_next)}</p>"
            f"<table>{''.join(rows)}</table></body></html>\n"
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it to a .json, .html or .txt file; raises `InvalidInput` for others, and where that cannot be."""
        where = Path(path_of(path, "the report"))
        suffix = refuse_suffix(where)
        text = {".json": json.dumps(self.as_dict(), indent=2), ".html": self.html(), ".txt": self.report()}[suffix]
        write_text(where, text.rstrip("\n") + "\n", "the report")


def refuse_suffix(path: Path) -> str:
    """The kind of file that `path` names; `InvalidInput` for one that a report is not written to."""
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidInput(f"The report cannot be {path.name!r}; its name ends in one of {', '.join(SUFFIXES)}.")
    return path.suffix.lower()


def _mark(step: Step) -> str:
    return "ok" if step.passed else "!!" if step.findings else ".."


def _figures(step: Step) -> str:
    said = step.figures.get("said")
    return f": {said}" if said else ""


def _row(mark: str, text: str, more: str = "") -> str:
    return f"<tr><td>{mark}</td><td>{html.escape(text)}{more}</td></tr>"
