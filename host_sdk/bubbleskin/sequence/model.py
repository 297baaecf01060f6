"""Sequences: steps and repeats that a wristband plays by its own clock. What cannot be meant is refused here.

Steps are counted from 0 in the order in which they are written, however often a repeat plays them.
"""

import math
from collections.abc import Iterator
from collections.abc import Sequence as Items
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubble_protocol import steps as limits
from bubbleskin.checks import array, instance, number, shown, text
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.pictured import Pictured
from bubbleskin.sequence import files
from bubbleskin.sequence.steps import (
    STEPS_MAX,
    Repeat,
    Step,
    check_times,
    checked_parts,
    depth_of,
    each_repeat,
    each_step,
    too_many_steps,
)

REST_MM = 5.0


class Sequence(Pictured):
    """Steps that the wristband plays by its own clock.

    `steps`: `Step` and `Repeat`. `loops`: how often all of it is played; 0: until it is stopped. `board`: the only
    board that it is for. `layout`: where its bubbles must be. Raises `InvalidInput` where that cannot be played.
    """

    def __init__(
        self,
        steps: "Items[Step | Repeat]",
        *,
        loops: int = 1,
        name: str = "",
        board: str | None = None,
        layout: Layout | None = None,
    ):
        self.steps = checked_parts(steps)
        """The steps and repeats as they are written."""
        check_times(loops, "A sequence")
        self.loops = loops
        self.name = text("name", name)
        self.board = None if board is None else text("board", board)
        self.layout = None if layout is None else instance("layout", layout, Layout, "a Layout, or None")
        _check_depth(self.steps, loops)
        self.each = _steps_alone(self.steps)
        """The steps alone, in the order in which they are written: entry i is step i."""
        self.bubbles = self._count_bubbles()
        """How many bubbles it is for."""

    def _count_bubbles(self) -> int:
        """Of the layout or of the targets; `InvalidInput` where steps differ in that."""
        counts = {len(step.targets_mm) for step in self.each if step.targets_mm is not None}
        if not counts:
            raise InvalidInput("No step of the sequence has targets; give at least one a height for each bubble.")
        bubbles = len(self.layout) if self.layout else min(counts)
        for index, step in enumerate(self.each):
            if step.targets_mm is not None and len(step.targets_mm) != bubbles:
                raise InvalidInput(
                    f"{self.say(index)} has {len(step.targets_mm)} targets; the sequence is for {bubbles} bubbles."
                )
        return bubbles

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and all(
            getattr(self, name) == getattr(other, name) for name in ("steps", "loops", "name", "board", "layout")
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        return f"<Sequence {name}{len(self.each)} steps, {self.bubbles} bubbles, {self.duration:g} s>"

    def say(self, index: int) -> str:
        """How to name a step in a sentence."""
        name = self.each[index].name
        return f"Step {index} ({name})" if name else f"Step {index}"

    @property
    def duration(self) -> float:
        """Seconds from the first step to the end, if each settles as soon as its ramp ends; inf if it has no end."""
        return self._length("shortest")

    @property
    def longest(self) -> float:
        """Seconds if every condition came to its timeout."""
        return self._length("longest")

    def _length(self, which: str) -> float:
        def sum_of(parts: "Items[Step | Repeat]") -> float:
            return math.fsum(
                getattr(part, which) if isinstance(part, Step) else _over(part.times, sum_of(part.steps))
                for part in parts
            )

        return round(_over(self.loops, sum_of(self.steps)), 3)

    def unrolled(self) -> Iterator[int]:
        """The indices of the steps in the order in which they are played; without end where the sequence has none."""

        def play(parts: "Items[Step | Repeat]", first: int, times: int) -> Iterator[int]:
            done = 0
            while times == 0 or done < times:
                done += 1
                index = first
                for part in parts:
                    if isinstance(part, Step):
                        yield index
                        index += 1
                    else:
                        yield from play(part.steps, index, part.times)
                        index += len(tuple(each_step(part.steps)))

        return play(self.steps, 0, self.loops)

    @cached_property
    def _targets(self) -> NDArray[np.float64]:
        """Of each step, (steps, n); NaN: leave it."""
        rows = np.full((len(self.each), self.bubbles), np.nan)
        for row, step in zip(rows, self.each, strict=True):
            if step.targets_mm is not None:
                row[:] = [np.nan if target is None else target for target in step.targets_mm]
        return rows

    def targets_at(self, t: ArrayLike, rest_mm: float = REST_MM) -> NDArray[np.float64]:
        """What is asked of the bubbles `t` seconds after the start: (n,), or (k, n) for k moments.

        Before it all are at `rest_mm`, which is also what lower targets mean; after it they stay. Steps that wait
        until settled are taken to be so at the end of their ramps.
        """
        times = np.atleast_1d(array("t", t))
        rest_mm = number("rest_mm", rest_mm, 0.0, unit="mm")
        if not np.isfinite(times).all():
            raise InvalidInput("Moments must be finite numbers of seconds; one is not.")
        heights = np.empty((len(times), self.bubbles))
        order = np.argsort(times, kind="stable")
        before = np.full(self.bubbles, rest_mm)
        target, begin, length, step = before, 0.0, 0.0, None
        coming = self.unrolled()
        for moment in order:
            time = times[moment]
            while time >= begin + length and (index := next(coming, None)) is not None:
                begin, before, step = round(begin + length, 3), target, self.each[index]
                length = step.shortest
                row = self._targets[index]
                target = np.where(np.isnan(row), before, np.maximum(row, rest_mm))
            share = (
                0.0
                if step is None or time < 0
                else _ease(step.easing, (time - begin) / step.ramp if step.ramp else 1.0)
            )
            heights[moment] = before + (target - before) * share
        return heights if np.ndim(t) else heights[0]

    # Files; how they look is in `sequence.files`.

    def to_json(self, path: str | Path | None = None) -> str:
        """As JSON by the schema `sequence.schema.json`; written to `path` if there is one."""
        return files.to_json(files.Written(self.steps, self.loops, self.name, self.board, self.layout), path)

    @classmethod
    def from_json(cls, source: str | Path) -> "Sequence":
        """From a file, or from a text that begins with a brace."""
        return files.from_json(source, cls._of)

    @classmethod
    def _of(cls, written: files.Written) -> "Sequence":
        return cls(written.steps, loops=written.loops, name=written.name, board=written.board, layout=written.layout)

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        *,
        easing: str = "linear",
        lead: float = 0.5,
        loops: int = 1,
        name: str = "",
        board: str | None = None,
        layout: Layout | None = None,
    ) -> "Sequence":
        """From a timeline: columns time_s, b0, b1 …; each row is a shape (mm) and when it is reached.

        An empty cell leaves its bubble. A first row at 0 s is reached within `lead` seconds before. The others are
        those of `Sequence`.
        """
        steps = files.steps_from_csv(path, easing, lead)
        return cls(steps, loops=loops, name=name, board=board, layout=layout)

    @classmethod
    def load(cls, path: str | Path) -> "Sequence":
        """From a .json or .csv file, whichever it is."""
        where = files.path_of(path, "the sequence")
        return cls.from_csv(where) if where.suffix.lower() in (".csv", ".tsv", ".txt") else cls.from_json(where)


class HasSequence(Protocol):
    """Something that comes down to a sequence, such as a plan."""

    @property
    def sequence(self) -> Sequence:
        """The sequence."""


Playable = Sequence | HasSequence | str | Path


def playable(what: Playable) -> Sequence:
    """The sequence that is meant."""
    if isinstance(what, str | Path):
        return Sequence.load(what)
    sequence = what if isinstance(what, Sequence) else getattr(what, "sequence", None)
    if not isinstance(sequence, Sequence):
        raise InvalidInput(
            f"{shown(what)} cannot be played; give a Sequence, a plan, the path of a .json or .csv file, or a name of the "
            "library, such as 'pulse'."
        )
    return sequence


def refuse_chance(what: Playable) -> None:
    """Raise `InvalidInput` for a plan that is not sure to end in its shape."""
    if not getattr(what, "sure", True):
        raise InvalidInput(
            "This plan is not sure: on a wristband a little other than the model it can end in another shape; its explain() "
            "says where. Play it with anyway=True, plan another shape, or let fit_contact find the springs of your own sheet."
        )


def _ease(easing: str, p: float) -> float:
    p = min(max(p, 0.0), 1.0)
    return {"linear": p, "smooth": p * p * (3 - 2 * p), "in": p * p, "out": 1 - (1 - p) ** 2}[easing]


def _over(times: int, seconds: float) -> float:
    return math.inf if times == 0 else times * seconds


def _check_depth(parts: "Items[Step | Repeat]", loops: int) -> None:
    if depth_of(parts) + (loops != 1) > limits.DEPTH_MAX:
        raise InvalidInput(
            f"Repeats are nested more than {limits.DEPTH_MAX} deep, loops included, or contain themselves: "
            f"{limits.DEPTH_MAX} is allowed. Write some of them out."
        )


def _steps_alone(parts: "Items[Step | Repeat]") -> tuple[Step, ...]:
    """The steps in the order in which they are written; `InvalidInput` for none, too many, or a repeat without any."""
    steps = tuple(each_step(parts))
    if not steps:
        raise InvalidInput("A sequence without steps cannot be played; give it one.")
    if len(steps) > STEPS_MAX:
        raise too_many_steps(len(steps))
    if any(not tuple(each_step(part.steps)) for part in each_repeat(parts)):
        raise InvalidInput("A repeat without steps cannot be played; give it one, or leave it out.")
    return steps
