"""A sequence as the device takes it: records of words, checked against the board that is to play it."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bubble_protocol import steps as wire
from bubbleskin.device.info import Info
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.link.framing import crc32
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.steps import EASINGS, THEN, After, Repeat, Step
from bubbleskin.shape.heightfield import refuse_metres

_PLACE_MM = 0.5
"""How far a bubble may be from where a sequence wants it."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """Records, (m, words) of 16 bits, and which step each one is: -1 for a repeat or its end."""

    sequence: Sequence
    records: NDArray[np.uint16]
    steps: NDArray[np.int64]

    @classmethod
    def of(cls, sequence: Sequence, info: Info, layout: Layout) -> "Compiled":
        """The records for that board. `InvalidInput` where the sequence is for another or beyond its limits."""
        check(sequence, info, layout)
        rows: list[list[int]] = []
        steps: list[int] = []
        number = itertools.count()
        blank = [0] * (wire.HEAD - 2 + sequence.bubbles)

        def put(parts: tuple[Step | Repeat, ...]) -> None:
            for part in parts:
                if isinstance(part, Step):
                    steps.append(next(number))
                    rows.append(_record(part, sequence.bubbles))
                else:
                    put_repeat(part.times, tuple(part.steps))

        def put_repeat(times: int, parts: tuple[Step | Repeat, ...]) -> None:
            if times == 1:
                put(parts)
                return
            rows.append([wire.REPEAT, times, *blank])
            steps.append(-1)
            put(parts)
            rows.append([wire.END, 0, *blank])
            steps.append(-1)

        put_repeat(sequence.loops, sequence.steps)
        return cls(sequence, np.array(rows, dtype=np.uint16), np.array(steps))

    def __len__(self) -> int:
        return len(self.records)

    @property
    def crc(self) -> int:
        """CRC-32 of all words, low byte first."""
        return crc32(self.records.astype("<u2").tobytes())

    @property
    def total(self) -> int:
        """How many steps will be played; 0 where there is no end."""
        return _count(self.sequence.steps, self.sequence.loops)

    def stream(self) -> Iterator[int]:
        """The numbers of the records in the order in which they are played, without repeats."""
        record = np.flatnonzero(self.steps >= 0)
        return (int(record[step]) for step in self.sequence.unrolled())


def check(sequence: Sequence, info: Info, layout: Layout) -> None:
    """Whether a board can play the sequence. `InvalidInput` where it cannot, with the step and the limit."""
    if sequence.board and sequence.board != info.board:
        raise InvalidInput(f"The sequence is for a {sequence.board}; this is a {info.board}.")
    if sequence.bubbles != info.bubbles:
        raise InvalidInput(f"The sequence is for {sequence.bubbles} bubbles; this {info.board} has {info.bubbles}.")
    if sequence.layout:
        off = np.linalg.norm(sequence.layout.positions_mm - layout.positions_mm, axis=1)
        bubble = int(off.argmax())
        if off[bubble] > _PLACE_MM:
            x, y = sequence.layout.positions_mm[bubble]
            raise InvalidInput(
                f"The sequence is for another layout: it wants bubble {bubble} at ({x:g}, {y:g}) mm, "
                f"{off[bubble]:.1f} mm from where this {info.board} has it."
            )
    high = info.height_max_mm
    targets = (target for step in sequence.each for target in step.targets_mm or () if target is not None)
    refuse_metres(max(targets, default=0.0), high)
    for index, step in enumerate(sequence.each):
        for bubble, target in enumerate(step.targets_mm if step.targets_mm is not None else ()):
            if target is not None and round(target * 1000) > round(high * 1000):
                raise InvalidInput(
                    f"{sequence.say(index)}: the target of bubble {bubble}, {target:g} mm, is above the limit of {high:g} mm; "
                    f"heights are 0 to {high:g} mm."
                )
        if step.longest < info.tick - 1e-9:
            raise InvalidInput(
                f"{sequence.say(index)} takes {step.longest * 1000:g} ms; a step takes a tick of the {info.board} at least, "
                f"{info.tick * 1000:g} ms."
            )


def _record(step: Step, n: int) -> list[int]:
    if isinstance(step.until, After):
        until, then, wait, tolerance = wire.TIME, 0, step.until.seconds, 0.0
    else:
        until, then, wait = wire.SETTLE, THEN.index(step.until.then), step.until.timeout_s
        tolerance = step.until.tolerance_mm
    targets = step.targets_mm if step.targets_mm is not None else (None,) * n
    return [
        wire.flags(EASINGS.index(step.easing), until, then),
        round(step.ramp * 1000),
        round(wait * 1000),
        round(tolerance * 1000),
        *(wire.LEAVE if target is None else round(target * 1000) for target in targets),
    ]


def _count(parts: "tuple[Step | Repeat, ...]", times: int) -> int:
    once = 0
    for part in parts:
        count = 1 if isinstance(part, Step) else _count(tuple(part.steps), part.times)
        if not count:
            return 0
        once += count
    return once * times
