"""What a sequence comes to where bubbles touch, before it is played: by the model that `play` bounds it with, from flat.

Steps are followed in the order in which they are played, repeats twice. Of each step the first time is what is told.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.device.info import Info
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sequence.compile import check
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.steps import Repeat, Step, each_step
from bubbleskin.studio import edits
from bubbleskin.surface.compensate import SHORT_MM
from bubbleskin.surface.gaps import Gaps
from bubbleskin.surface.kept import KeptShape
from bubbleskin.surface.limits import Limits
from bubbleskin.surface.played import MANY, OTHERS, cut, highest_cut

if TYPE_CHECKING:
    from bubbleskin.contact.held import HeldShape

Array = NDArray[np.float64]

_FOLLOWED = 4000
"""Steps that are followed at most."""


class _Played(NamedTuple):
    """A step that is played."""

    begin: "list[HeldShape]"
    """The likeliest wristband, and others, before it; none where neighbours do not push each other."""
    alone: Array
    """Heights alone that are asked at its end, mm."""
    end: "list[HeldShape]"
    tops: Array
    """Of the likeliest at its end, mm."""
    passes: bool
    """Whether neighbours would lift a bubble past the limit on its way."""


@dataclass(frozen=True)
class Forecast:
    """What became of `sequence` in the model."""

    sequence: Sequence
    refused: str = ""
    """Why `play` would not take it at all."""
    cut_mm: float | None = None
    """Where `play` would cut its targets; None: nowhere."""
    passes: tuple[int, ...] = ()
    """Steps in which neighbours would lift a bubble past the limit."""
    never: tuple[int, ...] = ()
    """Steps that are not played, as a repeat before them has no end."""
    first: dict[int, _Played] = field(default_factory=dict)
    """Of each step that was followed the first time."""
    rest_mm: float = 0.0
    by: "Foresight | None" = None

    def off(self) -> list[tuple[int, int]]:
        """(step, bubble) of all heights that cannot be had as they are asked."""
        return [
            (index, bubble)
            for index, played in sorted(self.first.items())
            for bubble, target in enumerate(self.sequence.each[index].targets_mm or ())
            if target is not None and abs(played.tops[bubble] - max(target, self.rest_mm)) > SHORT_MM
        ]

    def tops_at(self, time_ms: float) -> list[float] | None:
        """The true tops at a time of what is written, (n,) mm; None where nobody knows."""
        ends = [moment.end for moment in edits.moments(self.sequence)]
        index = min(bisect_right(ends, time_ms), len(ends) - 1)
        played = self.first.get(index)
        if played is None:
            return None
        asked = np.array(edits.heights_at(self.sequence, time_ms, self.rest_mm))
        tops = np.minimum(asked, np.inf if self.cut_mm is None else self.cut_mm)
        if played.begin:
            shape = played.begin[0].copy()
            shape.go(tops)
            tops = shape.height_mm
        return [round(top, 2) for top in tops.tolist()]

    def sentences(self, most: int) -> list[str]:
        """What there is to say, at most so many sentences."""
        said = [self.refused] if self.refused else []
        if self.cut_mm is not None:
            steps = ", ".join(str(step) for step in self.passes[:6]) + (" and more" if len(self.passes) > 6 else "")
            said.append(
                f"Neighbours would lift a bubble past the limit in step{'' if len(self.passes) == 1 else 's'} {steps}: "
                f"where it is played, all targets are cut at {self.cut_mm:g} mm."
            )
        if self.never:
            said.append(f"{self.sequence.say(self.never[0])} is never played: the repeat before it has no end.")
        said += [self._say_off(step, list(bubbles)) for step, bubbles in groupby(self.off(), lambda one: one[0])]
        return said[:most]

    def _say_off(self, step: int, off: list[tuple[int, int]]) -> str:
        tops = self.first[step].tops
        asked = {
            bubble: target
            for bubble, target in enumerate(self.sequence.each[step].targets_mm or ())
            if target is not None
        }
        most = max((bubble for _, bubble in off), key=lambda bubble: abs(tops[bubble] - asked[bubble]))
        others = len(off) - 1
        more = f"; {others} other{'s are' if others > 1 else ' is'} off too" if others else ""
        return f"{self.sequence.say(step)}: bubble {most} would stand {tops[most]:.1f} mm high, not {asked[most]:.1f} mm{more}."


class _UnwantedError(Exception):
    """Nobody waits for it any more."""


class _Limits(Limits):
    """Those of a board, as long as somebody wants to know."""

    wanted: Callable[[], bool] = staticmethod(lambda: True)

    def keeps(self, members: "list[HeldShape]", alone_mm: Array) -> bool:
        if not self.wanted():
            raise _UnwantedError
        return super().keeps(members, alone_mm)


class Foresight:
    """Follows sequences for one wristband. What did not change since the last one is not reckoned again.

    `touch`: whether neighbours push each other, as real ones do.
    """

    def __init__(self, layout: Layout, info: Info, *, touch: bool):
        self._layout, self._info = layout, info
        gaps = Gaps(layout, info.height_max_mm if touch else 0.0)
        self._limits = _Limits(gaps, info.height_rest_mm, info.height_max_mm)
        self._followed: dict[bool, list[_Played]] = {False: [], True: []}
        self._cut: tuple[list[list[float]], float | None] = [], None

    def follow(self, sequence: Sequence, wanted: Callable[[], bool] = lambda: True) -> Forecast | None:
        """What it comes to; None where it is not `wanted` any more. It takes seconds where it is long."""
        refused = ""
        try:
            check(sequence, self._info, self._layout)
        except InvalidInput as error:
            refused = str(error)
        if sequence.bubbles != len(self._layout):
            return Forecast(sequence, refused, by=self)
        self._limits.wanted = wanted
        order, never = played_order(sequence)
        cut_mm = None
        try:
            played = self._follow(sequence, order, is_cut=False)
            passes = tuple(sorted({index for index, one in zip(order, played, strict=True) if one.passes}))
            if passes and not refused:
                cut_mm = self._highest_cut(sequence, played)
            if cut_mm is not None:
                played = self._follow(cut(sequence, cut_mm), order, is_cut=True)
        except _UnwantedError:
            return None
        first = dict(reversed(list(zip(order, played, strict=True))))
        return Forecast(sequence, refused, cut_mm, passes, tuple(never), first, self._info.height_rest_mm, self)

    def _highest_cut(self, sequence: Sequence, played: list[_Played]) -> float | None:
        asked = [one.alone.tolist() for one in played]
        if self._cut[0] != asked:
            self._cut = asked, highest_cut(sequence, self._flat(), self._limits)
        return self._cut[1]

    def _flat(self) -> KeptShape:
        return KeptShape(self._layout, self._limits.gaps, self._limits.rest_mm)

    def _follow(self, sequence: Sequence, order: list[int], *, is_cut: bool) -> list[_Played]:
        others = OTHERS if len(order) <= MANY else ()
        asked = self._asked(sequence, order)
        if not self._limits.gaps:
            return [_Played([], alone, [], alone, passes=False) for alone in asked]
        before, same = self._followed[is_cut], 0
        while same < min(len(before), len(asked)) and np.array_equal(before[same].alone, asked[same]):
            same += 1
        if before and len(before[0].end) != 1 + len(others):
            same = 0
        done = before[:same]
        if not done:
            doubles = self._flat().begun()
            members = [doubles[number] for number in (0, *others)]
        else:
            members = done[-1].end
        for alone in asked[same:]:
            begin, members = members, [member.copy() for member in members]
            passes = not self._limits.keeps(members, alone)
            for member in members:  # the rest of the way, where it was left
                member.go(alone)
            done.append(_Played(begin, alone, members, members[0].height_mm, passes))
        self._followed[is_cut] = done
        return done

    def _asked(self, sequence: Sequence, order: list[int]) -> list[Array]:
        """Heights alone at the end of each step that is played."""
        now = np.full(len(self._layout), self._limits.rest_mm)
        asked = list[Array]()
        for index in order:
            targets = sequence.each[index].targets_mm or now.tolist()
            given = np.array([old if new is None else new for old, new in zip(now, targets, strict=True)])
            now = self._limits.clip(given)
            asked.append(now)
        return asked


def played_order(sequence: Sequence) -> tuple[list[int], list[int]]:
    """The steps as they are played, repeats twice at most; and those that never are."""
    order = list[int]()
    _walk(sequence.steps, 0, order)
    is_whole = len(order) <= _FOLLOWED
    after = max(order) + 1 if is_whole and _is_endless(sequence.steps) else len(sequence.each)
    return order[:_FOLLOWED], list(range(after, len(sequence.each)))


def _walk(parts: edits.Parts, index: int, order: list[int]) -> bool:
    """Whether what is after `parts`, the first of which is step `index`, is played too."""
    for part in parts:
        if isinstance(part, Step):
            order.append(index)
            index += 1
            continue
        for _ in range(min(part.times or 2, 2)):
            if len(order) > _FOLLOWED or not _walk(part.steps, index, order):
                return False
        if not part.times:
            return False
        index += sum(1 for _ in each_step(part.steps))
    return True


def _is_endless(parts: edits.Parts) -> bool:
    return any(isinstance(part, Repeat) and (part.times == 0 or _is_endless(part.steps)) for part in parts)
