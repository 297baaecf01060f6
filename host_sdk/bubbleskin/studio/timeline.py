"""The sequence that is edited: what it is, what was done to it and can be undone, and which keyframe is chosen."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from bubbleskin.checks import number, one_of, whole
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sequence.library import rings
from bubbleskin.sequence.model import REST_MM, Sequence
from bubbleskin.sequence.steps import After, Settled
from bubbleskin.studio import edits

Message = dict[str, Any]
UNDO_MAX = 200
"""Changes that can be undone."""
STEPS_MAX = 2000
"""Steps of a sequence that is edited: what a page can still draw."""
ROWS = ("bubbles", "rings", "all")
"""What a row of the timeline is."""


class Chosen(NamedTuple):
    """Which keyframe is chosen, or steps."""

    step: int = 0
    last: int = 0
    """The last of several steps."""
    row: int = -1
    """-1: the steps themselves, no keyframe."""


class Row(NamedTuple):
    """Bubbles that go together in the timeline."""

    name: str
    bubbles: tuple[int, ...]


class Timeline:
    """A sequence and its past. Every change makes another sequence; the one before is what undo brings back."""

    def __init__(self, sequence: Sequence, rest_mm: float = REST_MM, high_mm: float = math.inf):
        self.sequence = check_size(sequence)
        self.rest_mm, self.high_mm = rest_mm, high_mm
        """Of the wristband: what lower heights mean, and the limit of those that are given."""
        self.chosen = Chosen()
        self.time_ms = 0
        """Where the playhead is."""
        self.rows_are = "bubbles"
        """One of `ROWS`."""
        self.revision = 0
        """Another after every change, so that a page knows whether it shows what there is."""
        self._past: list[Sequence] = []
        self._future: list[Sequence] = []

    # What was done.

    @property
    def can_undo(self) -> bool:
        """Whether there is a change to undo."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether a change was undone last."""
        return bool(self._future)

    def undo(self) -> None:
        """Bring back what was before the last change."""
        if self._past:
            self._future.append(self.sequence)
            self._be(self._past.pop())

    def redo(self) -> None:
        """Do again what was undone."""
        if self._future:
            self._past.append(self.sequence)
            self._be(self._future.pop())

    def become(self, sequence: Sequence) -> None:
        """Be another sequence; `InvalidInput` where it is too long to be edited, and nothing is changed."""
        check_size(sequence)
        if sequence == self.sequence:
            return
        self._past = [*self._past[-UNDO_MAX + 1 :], self.sequence]
        self._future.clear()
        self._be(sequence)

    def _be(self, sequence: Sequence) -> None:
        other = sequence.bubbles != self.sequence.bubbles
        self.sequence = sequence
        self.revision += 1
        last = len(sequence.each) - 1
        step, end, row = self.chosen
        self.chosen = Chosen(min(step, last), min(end, last), -1 if other else row)
        self.time_ms = min(self.time_ms, edits.moments(sequence)[-1].end)

    # Where one looks.

    def rows(self, layout: Layout | None) -> list[Row]:
        """The rows, top first; `layout`: of the wristband, for a sequence that has none of its own."""
        n = self.sequence.bubbles
        where = self.sequence.layout or (layout if layout and len(layout) == n else None)
        if self.rows_are == "all":
            return [Row("All", tuple(range(n)))]
        if self.rows_are == "rings" and where:
            return [
                Row("Middle" if number == 0 else f"Ring {number}", tuple(ring.tolist()))
                for number, ring in enumerate(rings(where))
            ]
        return [Row(f"Bubble {bubble}", (bubble,)) for bubble in range(n)]

    def show_rows(self, kind: str) -> None:
        """Let a row be one of `ROWS`."""
        self.rows_are = one_of("rows", kind, ROWS)
        self.chosen = self.chosen._replace(row=-1)
        self.revision += 1

    def choose(self, step: int, last: int, row: int) -> None:
        """Choose a keyframe, or with row -1 the steps `step` to `last`."""
        most = len(self.sequence.each) - 1
        row = whole("row", row, -1, self.sequence.bubbles - 1)
        self.chosen = Chosen(whole("step", step, 0, most), whole("last", last, 0, most), row)

    def look_at(self, time_ms: float) -> None:
        """Put the playhead there, or at the end."""
        end = edits.moments(self.sequence)[-1].end
        self.time_ms = min(round(number("The time", time_ms, 0.0, 1e9, "ms")), end)

    # Changes, as a page asks for them.

    def change(self, what: Message, layout: Layout | None) -> None:
        """Do what `what`, the message of a page, asks: its `kind` is one of `CHANGES`."""
        kind = what.get("kind")
        if not isinstance(kind, str) or kind not in CHANGES:
            raise InvalidInput("The page asks for a change that there is not; reload it.")
        try:
            if kind not in _MAY_BE_EMPTY and None in {**what, **what.get("until", {})}.values():
                raise InvalidInput("A field is empty; give it a value.")
            CHANGES[kind](self, what, self.rows(layout))
        except InvalidInput:
            raise
        except (KeyError, TypeError, ValueError, IndexError, OverflowError):
            raise InvalidInput("The page's message is not whole; reload it.") from None


def check_size(sequence: Sequence) -> Sequence:
    """`InvalidInput` for a sequence that is too long to be edited."""
    if len(sequence.each) > STEPS_MAX:
        raise InvalidInput(
            f"This sequence has {len(sequence.each)} steps; the editor takes {STEPS_MAX}. It can be played as it is: "
            "`bubbleskin play`."
        )
    return sequence


def _bubbles(what: Message, rows: list[Row]) -> tuple[int, ...]:
    return rows[whole("row", what["row"], 0, len(rows) - 1)].bubbles


def _height(timeline: Timeline, what: Message) -> float | None:
    """The height that is given; None: none."""
    height = what.get("height")
    return None if height is None else number("The height", height, 0.0, timeline.high_mm, "mm")


def _place(timeline: Timeline, what: Message, rows: list[Row]) -> None:
    step = int(what["step"])
    sequence = edits.moved(timeline.sequence, step, what["time"]) if "time" in what else timeline.sequence
    if "height" in what:
        sequence = edits.with_targets(sequence, step, _bubbles(what, rows), _height(timeline, what))
    timeline.become(sequence)


def _add(timeline: Timeline, what: Message, rows: list[Row]) -> None:
    bubbles, height = _bubbles(what, rows), _height(timeline, what)
    sequence, step = edits.keyed(timeline.sequence, what["time"], bubbles, height, timeline.rest_mm)
    timeline.become(sequence)
    timeline.chosen = Chosen(step, step, what["row"])


def _delete(timeline: Timeline, what: Message, rows: list[Row]) -> None:
    step, row = int(what["step"]), int(what["row"])
    if row >= 0:
        timeline.become(edits.without_keyframe(timeline.sequence, step, _bubbles(what, rows)))
        return
    sequence = timeline.sequence
    for index in range(max(step, int(what["last"])), min(step, int(what["last"])) - 1, -1):
        sequence = edits.without_step(sequence, index)
    timeline.become(sequence)


def _step(timeline: Timeline, what: Message, rows: list[Row]) -> None:
    index = int(what["step"])
    given: Message = {name: what[name] for name in ("ramp", "easing", "name") if name in what}
    if "until" in what:
        given["until"] = _until(dict(what["until"]), timeline.sequence.each[index].until)
    timeline.become(edits.with_step(timeline.sequence, index, **given))


def _until(what: Message, before: After | Settled) -> After | Settled:
    """What goes on after a time, or when settled: then what is not given is as `before`."""
    if "after" in what:
        return After(what["after"])
    return replace(before if isinstance(before, Settled) else Settled(), **what)


def _repeat(timeline: Timeline, what: Message, rows: list[Row]) -> None:
    timeline.become(edits.repeated(timeline.sequence, int(what["step"]), int(what["last"]), what["times"]))


def _times(timeline: Timeline, what: Message, rows: list[Row]) -> None:
    timeline.become(edits.with_times(timeline.sequence, [int(place) for place in what["path"]], what["times"]))


def _whole(timeline: Timeline, what: Message, rows: list[Row]) -> None:
    given = {name: what[name] for name in ("loops", "name") if name in what}
    timeline.become(edits.changed(timeline.sequence, **given))


CHANGES: dict[str, Callable[[Timeline, Message, list[Row]], None]] = {
    "place": _place,
    "add": _add,
    "delete": _delete,
    "step": _step,
    "repeat": _repeat,
    "times": _times,
    "whole": _whole,
    "undo": lambda timeline, what, rows: timeline.undo(),
    "redo": lambda timeline, what, rows: timeline.redo(),
    "rows": lambda timeline, what, rows: timeline.show_rows(what["rows"]),
}
"""What a page can ask for, by its name."""
_MAY_BE_EMPTY = ("place", "add")
"""Those in which no height has a meaning."""
