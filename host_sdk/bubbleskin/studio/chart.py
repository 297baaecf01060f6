"""The timeline as an element of the page: what it is sent, all of it in one message, and the changes that it asks for."""

from collections.abc import Callable
from typing import Any

from nicegui.element import Element
from nicegui.events import GenericEventArguments

from bubbleskin.layout import Layout
from bubbleskin.sequence.steps import EASINGS, THEN, After, Step
from bubbleskin.studio import edits
from bubbleskin.studio.editor import Editor
from bubbleskin.studio.files import STATIC
from bubbleskin.studio.foresight import Forecast
from bubbleskin.studio.timeline import Message, Timeline

SAID_MAX = 6
"""Sentences about what cannot be had that are shown at once."""


class Chart(Element, component=STATIC / "timeline.js"):
    """The timeline of the `editor`'s sequence. `act(kind, message)` is called with what a hand does: edit, choose or look."""

    def __init__(self, editor: Editor, layout: Layout, act: Callable[[str, Message], None]):
        super().__init__()
        self._editor, self._layout, self._act = editor, layout, act
        self._answering = False
        self._shown = -1
        self._outlook: object = None
        self._looks = -1
        self.props.update(easings=list(EASINGS), thens=list(THEN), first=self._message())
        for kind in ("edit", "choose", "look"):
            self.on(kind, self._asked(kind))

    def _asked(self, kind: str) -> Callable[[GenericEventArguments], None]:
        return lambda event: self._act(kind, event.args if isinstance(event.args, dict) else {})

    def answer(self, act: Callable[[], None]) -> None:
        """Do what this page waits for, and tell it all that came of it in one message."""
        self._answering = True
        try:
            act()
        finally:
            self._answering = False
            self.show(answer=True)

    def show(self, *, answer: bool = False) -> None:
        """Bring the page up to date."""
        if self._answering:
            return
        if answer or self._looks != self._editor.looks or self._shown != self._editor.timeline.revision:
            self.run_method("take", self._message() | {"answer": answer, "problem": self._editor.problem})

    def _message(self) -> Message:
        """What is another since the last one."""
        timeline, forecast = self._editor.timeline, self._editor.forecast
        message: Message = {"look": look(timeline) | {"plays": self._editor.plays}}
        if self._shown != timeline.revision:
            message["doc"] = document(timeline, self._layout)
        now = forecast if forecast and forecast.sequence is timeline.sequence else None
        if self._shown != timeline.revision or self._outlook is not now:
            message["outlook"] = outlook(now)
        self._shown, self._outlook, self._looks = timeline.revision, now, self._editor.looks
        return message


def look(timeline: Timeline) -> Message:
    """Where one looks."""
    return {"time": timeline.time_ms, "chosen": timeline.chosen._asdict()}


def document(timeline: Timeline, layout: Layout) -> Message:
    """The whole sequence: times in ms of what is written, ramps and waits in s, heights in mm."""
    sequence = timeline.sequence
    around = edits.repeats(sequence)
    return {
        "revision": timeline.revision,
        "name": sequence.name,
        "loops": sequence.loops,
        "bubbles": sequence.bubbles,
        "low": timeline.rest_mm,
        "high": timeline.high_mm,
        "undo": timeline.can_undo,
        "redo": timeline.can_redo,
        "rows_are": timeline.rows_are,
        "rows": [row._asdict() for row in timeline.rows(layout)],
        "repeats": [one._asdict() | {"depth": len(one.path) - 1} for one in around],
        "steps": [
            moment._asdict() | _step(step) for moment, step in zip(edits.moments(sequence), sequence.each, strict=True)
        ],
    }


def _step(step: Step) -> dict[str, Any]:
    until = step.until
    return {
        "name": step.name,
        "ramp": step.ramp,
        "easing": step.easing,
        "targets": None if edits.is_wait(step) else step.targets_mm,
        "after": until.seconds if isinstance(until, After) else None,
        "settled": None if isinstance(until, After) else [until.tolerance_mm, until.timeout_s, until.then],
    }


def outlook(forecast: Forecast | None) -> Message:
    """What the sequence comes to, as far as it is known."""
    if forecast is None:
        return {"off": [], "tops": {}, "passes": [], "never": [], "says": [], "known": False}
    off = forecast.off()
    return {
        "off": [f"{step}-{bubble}" for step, bubble in off],
        "tops": {step: forecast.first[step].tops.round(2).tolist() for step in sorted({step for step, _ in off})},
        "passes": list(forecast.passes),
        "never": list(forecast.never),
        "says": forecast.sentences(SAID_MAX),
        "known": True,
    }
