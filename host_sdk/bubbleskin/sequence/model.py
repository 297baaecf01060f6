"""Sequences: steps with targets, a ramp and a condition to go on, in repeats. What cannot be meant is refused here.

Steps are counted from 0 in the order in which they are written, however often a repeat plays them.
"""

import math
from collections.abc import Iterable, Iterator
from collections.abc import Sequence as Items
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubble_protocol import steps as limits
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout

EASINGS = ("linear", "smooth", "in", "out")
"""p, 3p² - 2p³, p², 1 - (1 - p)²: how a ramp goes from 0 to 1."""
THEN = ("go on", "hold", "vent", "stop")
"""What follows a timeout: the next step, or the end with the shape held, everything vented, or all valves closed."""
SECONDS_MAX = limits.MS_MAX / 1000
TIMES_MAX = 0xFFFF
STEPS_MAX = 65535
REST_MM = 5.0
_TICK = 0.005
_TARGET_MAX = (limits.LEAVE - 1) / 1000


def _seconds(value: Any, what: str) -> float:
    """A time, in whole ms."""
    seconds = _number(value, what)
    if not 0 <= seconds <= SECONDS_MAX:
        raise InvalidInput(f"{what} is {seconds:g} s; 0 to {SECONDS_MAX:g} s is allowed. Repeat a step to wait longer.")
    return round(seconds * 1000) / 1000


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise InvalidInput(f"{what} must be a number; {value!r} is none.")
    if not math.isfinite(value):
        raise InvalidInput(f"{what} must be a finite number; {value} is none.")
    return float(value)


def _choice(value: Any, of: tuple[str, ...], what: str) -> str:
    if value not in of:
        raise InvalidInput(f"{what} is {value!r}; choose one of {', '.join(of)}.")
    return str(value)


@dataclass(frozen=True)
class After:
    """Go on so many seconds after the ramp has ended, up to 60."""

    seconds: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "seconds", _seconds(self.seconds, "The time of After"))


@dataclass(frozen=True)
class Settled:
    """Go on when the ramp has ended and every bubble is within `tolerance_mm` (0.05 to 5) of its target.

    `timeout_s` after the ramp's end that is given up: then `go on`, or end and `hold`, `vent` or `stop`.
    """

    tolerance_mm: float = 0.2
    timeout_s: float = 3.0
    then: str = "go on"

    def __post_init__(self) -> None:
        tolerance = _number(self.tolerance_mm, "The tolerance")
        low, high = limits.TOLERANCE_MIN_UM / 1000, limits.TOLERANCE_MAX_UM / 1000
        if not low <= tolerance <= high:
            raise InvalidInput(f"The tolerance is {tolerance:g} mm; {low:g} to {high:g} mm is allowed.")
        object.__setattr__(self, "tolerance_mm", tolerance)
        object.__setattr__(self, "timeout_s", _seconds(self.timeout_s, "The timeout"))
        _choice(self.then, THEN, "What follows the timeout")


@dataclass(frozen=True)
class Step:
    """Ramp to `targets_mm` within `ramp` seconds, then go on `until` says so.

    `targets_mm`: one height per bubble, from 0 (no pressure); None leaves that bubble as it is. None alone leaves
    them all: a step that only waits. `ramp`: 0 is as fast as the valves can. `easing`: one of `EASINGS`.
    """

    targets_mm: Items[float | None] | NDArray[np.float64] | None
    ramp: float = 0.0
    easing: str = "linear"
    until: After | Settled = After()
    name: str = ""

    def __post_init__(self) -> None:
        if self.targets_mm is not None:
            object.__setattr__(self, "targets_mm", _targets(self.targets_mm))
        object.__setattr__(self, "ramp", _seconds(self.ramp, "The ramp"))
        _choice(self.easing, EASINGS, "The easing")
        if not isinstance(self.until, After | Settled):
            raise InvalidInput(f"A step goes on after some time or when settled; until is {self.until!r}.")
        if not isinstance(self.name, str):
            raise InvalidInput(f"A step's name is a text; {self.name!r} is none.")
        if not self.longest:
            raise InvalidInput("A step must take time: give it a ramp, After(seconds) or Settled().")

    @property
    def shortest(self) -> float:
        """Seconds that the step takes if it is settled as soon as its ramp ends; a tick at least."""
        return max(self.ramp + (self.until.seconds if isinstance(self.until, After) else 0.0), _TICK)

    @property
    def longest(self) -> float:
        """Seconds that it takes if it ends by its timeout."""
        return self.ramp + (self.until.seconds if isinstance(self.until, After) else self.until.timeout_s)


def _targets(values: Any) -> tuple[float | None, ...]:
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise InvalidInput(f"Targets are a height in mm for each bubble, or None to leave it; {values!r} is not.")
    targets: list[float | None] = []
    for bubble, value in enumerate(values):
        if value is not None and not (type(value) is float and 0 <= value <= _TARGET_MAX):
            value = _number(value, f"The target of bubble {bubble}")
            if not 0 <= value <= _TARGET_MAX:
                raise InvalidInput(
                    f"The target of bubble {bubble} is {value:g} mm; heights are 0 to {_TARGET_MAX:g} mm."
                )
        targets.append(value)
    return tuple(targets)


@dataclass(frozen=True)
class Repeat:
    """Play `steps`, which may hold repeats, `times` over; 0: until the sequence is stopped."""

    steps: "Items[Step | Repeat]"
    times: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", _parts(self.steps))
        _times(self.times, "A repeat")


def _parts(parts: Any) -> "tuple[Step | Repeat, ...]":
    if isinstance(parts, str | bytes | dict) or not isinstance(parts, Iterable):
        raise InvalidInput(f"Steps are a list of Step and Repeat; {parts!r} is not.")
    if isinstance(parts, Items) and len(parts) > STEPS_MAX:
        raise _too_many(len(parts))
    parts = tuple(parts)
    for part in parts:
        if not isinstance(part, Step | Repeat):
            raise InvalidInput(f"Steps are a list of Step and Repeat; {part!r} is neither.")
    return parts


def _too_many(count: int) -> InvalidInput:
    return InvalidInput(f"{count} steps; a sequence has at most {STEPS_MAX}. Use repeats, or play it in parts.")


def _times(times: Any, what: str) -> None:
    if isinstance(times, bool) or not isinstance(times, int) or not 0 <= times <= TIMES_MAX:
        raise InvalidInput(f"{what} plays {times!r} times; 1 to {TIMES_MAX}, or 0 until it is stopped.")


class Sequence:
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
        self.steps = _parts(steps)
        """The steps and repeats as they are written."""
        _times(loops, "A sequence")
        self.loops = loops
        self.name = name
        self.board = board
        self.layout = layout
        depth = _depth(self.steps) + (loops != 1)
        if depth > limits.DEPTH_MAX:
            raise InvalidInput(
                f"Repeats are nested more than {limits.DEPTH_MAX} deep, loops included, or contain themselves: "
                f"{limits.DEPTH_MAX} is allowed. Write some of them out."
            )
        self.each = tuple(_flat(self.steps))
        """The steps alone, in the order in which they are written: entry i is step i."""
        if not self.each:
            raise InvalidInput("A sequence without steps cannot be played; give it one.")
        if len(self.each) > STEPS_MAX:
            raise _too_many(len(self.each))
        if any(not tuple(_flat(part.steps)) for part in _repeats(self.steps)):
            raise InvalidInput("A repeat without steps cannot be played; give it one, or leave it out.")
        counts = {len(step.targets_mm) for step in self.each if step.targets_mm is not None}
        if not counts:
            raise InvalidInput("No step of the sequence has targets; give at least one a height for each bubble.")
        self.bubbles: int = len(layout) if layout else min(counts)
        """How many bubbles it is for."""
        for index, step in enumerate(self.each):
            if step.targets_mm is not None and len(step.targets_mm) != self.bubbles:
                raise InvalidInput(
                    f"{self.say(index)} has {len(step.targets_mm)} targets; the sequence is for {self.bubbles} bubbles."
                )

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
                        index += len(tuple(_flat(part.steps)))

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
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if not np.isfinite(times).all():
            raise InvalidInput("Moments must be finite numbers of seconds; one is not.")
        heights = np.empty((len(times), self.bubbles))
        order = np.argsort(times, kind="stable")
        before = np.full(self.bubbles, rest_mm)
        target, begin, length, step = before, 0.0, 0.0, None
        played = self.unrolled()
        for moment in order:
            time = times[moment]
            while time >= begin + length and (index := next(played, None)) is not None:
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

    # Files. How they look is in `sequence_files`, which imports this.

    def to_json(self, path: str | Path | None = None) -> str:
        """As JSON by the schema `sequence.schema.json`; written to `path` if there is one."""
        from bubbleskin.sequence import files

        return files.to_json(self, path)

    @classmethod
    def from_json(cls, source: str | Path) -> "Sequence":
        """From a file, or from a text that begins with a brace."""
        from bubbleskin.sequence import files

        return files.from_json(source)

    @classmethod
    def from_csv(cls, path: str | Path, *, easing: str = "linear", lead: float = 0.5, **how: Any) -> "Sequence":
        """From a timeline: columns time_s, b0, b1 …; each row is a shape (mm) and when it is reached.

        An empty cell leaves its bubble. A first row at 0 s is reached within `lead` seconds before. `how`: as of
        `Sequence`, such as loops and board.
        """
        from bubbleskin.sequence import files

        return files.from_csv(path, easing, lead, how)

    @classmethod
    def load(cls, path: str | Path) -> "Sequence":
        """From a .json or .csv file, whichever it is."""
        return cls.from_csv(path) if Path(path).suffix.lower() == ".csv" else cls.from_json(Path(path))


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
            f"{what!r:.60} cannot be played; give a Sequence, a plan, or the path of a .json or .csv file."
        )
    return sequence


def _ease(easing: str, p: float) -> float:
    p = min(max(p, 0.0), 1.0)
    return {"linear": p, "smooth": p * p * (3 - 2 * p), "in": p * p, "out": 1 - (1 - p) ** 2}[easing]


def _over(times: int, seconds: float) -> float:
    return math.inf if times == 0 else times * seconds


def _flat(parts: "Items[Step | Repeat]") -> Iterator[Step]:
    for part in parts:
        if isinstance(part, Step):
            yield part
        else:
            yield from _flat(part.steps)


def _repeats(parts: "Items[Step | Repeat]") -> Iterator[Repeat]:
    for part in parts:
        if isinstance(part, Repeat):
            yield part
            yield from _repeats(part.steps)


def _depth(parts: "Items[Step | Repeat]", so_far: int = 0) -> int:
    """How deep repeats are nested; stops looking where it is too deep, so a cycle ends."""
    if so_far > limits.DEPTH_MAX:
        return so_far
    return max([so_far, *(_depth(part.steps, so_far + 1) for part in parts if isinstance(part, Repeat))])
