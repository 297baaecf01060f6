"""What a sequence is made of: steps with targets, a ramp and a condition to go on, and repeats of them."""

from collections.abc import Iterable, Iterator
from collections.abc import Sequence as Items
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bubble_protocol import steps as limits
from bubbleskin.checks import number, one_of, shown
from bubbleskin.errors import InvalidInput

EASINGS = ("linear", "smooth", "in", "out")
"""p, 3p² - 2p³, p², 1 - (1 - p)²: how a ramp goes from 0 to 1."""
THEN = ("go on", "hold", "vent", "stop")
"""What follows a timeout: the next step, or the end with the shape held, everything vented, or all valves closed."""
SECONDS_MAX = limits.MS_MAX / 1000
TIMES_MAX = 0xFFFF
STEPS_MAX = 65535
_TICK = 0.005
_TARGET_MAX = (limits.LEAVE - 1) / 1000


def _seconds(value: Any, what: str) -> float:
    """A time, in whole ms."""
    seconds = number(what, value)
    if not 0 <= seconds <= SECONDS_MAX:
        raise InvalidInput(f"{what} is {seconds:g} s; 0 to {SECONDS_MAX:g} s is allowed. Repeat a step to wait longer.")
    return round(seconds * 1000) / 1000


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
        tolerance = number("The tolerance", self.tolerance_mm)
        low, high = limits.TOLERANCE_MIN_UM / 1000, limits.TOLERANCE_MAX_UM / 1000
        if not low <= tolerance <= high:
            raise InvalidInput(f"The tolerance is {tolerance:g} mm; {low:g} to {high:g} mm is allowed.")
        object.__setattr__(self, "tolerance_mm", tolerance)
        object.__setattr__(self, "timeout_s", _seconds(self.timeout_s, "The timeout"))
        one_of("What follows the timeout", self.then, THEN)


@dataclass(frozen=True)
class Step:
    """Ramp to `targets_mm` within `ramp` seconds, then go on `until` says so.

    `targets_mm`: one height per bubble, from 0 (no pressure); None leaves that bubble as it is. None alone leaves
    them all: a step that only waits. `ramp`: 0 is as fast as the valves can. `easing`: one of `EASINGS`. Without ramp and
    `until` it takes a tick: the valves are on their way, and the next step begins.
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
        one_of("The easing", self.easing, EASINGS)
        if not isinstance(self.until, After | Settled):
            raise InvalidInput(f"A step goes on after some time or when settled; until is {shown(self.until)}.")
        if not isinstance(self.name, str):
            raise InvalidInput(f"A step's name is a text; {shown(self.name)} is none.")
        if not self.longest:
            if self.targets_mm is None:
                raise InvalidInput("A step without targets only waits: give it After(seconds) or Settled().")
            object.__setattr__(self, "until", After(_TICK))  # each step begins in a tick of its own

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
        raise InvalidInput(f"Targets are a height in mm for each bubble, or None to leave it; {shown(values)} is not.")
    targets: list[float | None] = []
    for bubble, value in enumerate(values):
        if value is not None and not (type(value) is float and 0 <= value <= _TARGET_MAX):
            value = number(f"The target of bubble {bubble}", value)
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
        object.__setattr__(self, "steps", checked_parts(self.steps))
        check_times(self.times, "A repeat")


def checked_parts(parts: Any) -> "tuple[Step | Repeat, ...]":
    """Steps and repeats as a tuple; `InvalidInput` for anything else."""
    if isinstance(parts, str | bytes | dict) or not isinstance(parts, Iterable):
        raise InvalidInput(f"Steps are a list of Step and Repeat; {shown(parts)} is not.")
    if isinstance(parts, Items) and len(parts) > STEPS_MAX:
        raise too_many_steps(len(parts))
    parts = tuple(parts)
    for part in parts:
        if not isinstance(part, Step | Repeat):
            raise InvalidInput(f"Steps are a list of Step and Repeat; {shown(part)} is neither.")
    return parts


def too_many_steps(count: int) -> InvalidInput:
    """The refusal of more steps than a sequence may have."""
    return InvalidInput(f"{count} steps; a sequence has at most {STEPS_MAX}. Use repeats, or play it in parts.")


def check_times(times: Any, what: str) -> None:
    """`InvalidInput` for what is no number of times that `what`, a sequence or a repeat, can be played."""
    if isinstance(times, bool) or not isinstance(times, int) or not 0 <= times <= TIMES_MAX:
        raise InvalidInput(f"{what} plays {shown(times)} times; 1 to {TIMES_MAX}, or 0 until it is stopped.")


def each_step(parts: "Items[Step | Repeat]") -> Iterator[Step]:
    """The steps alone, in the order in which they are written."""
    for part in parts:
        if isinstance(part, Step):
            yield part
        else:
            yield from each_step(part.steps)


def each_repeat(parts: "Items[Step | Repeat]") -> Iterator[Repeat]:
    """The repeats alone, outer ones before those within them."""
    for part in parts:
        if isinstance(part, Repeat):
            yield part
            yield from each_repeat(part.steps)


def depth_of(parts: "Items[Step | Repeat]", so_far: int = 0) -> int:
    """How deep repeats are nested; stops looking where it is too deep, so a cycle ends."""
    if so_far > limits.DEPTH_MAX:
        return so_far
    return max([so_far, *(depth_of(part.steps, so_far + 1) for part in parts if isinstance(part, Repeat))])
