"""Changes of a sequence, each a function from one to another. What cannot be meant raises `InvalidInput`, and changes nothing.

Times are those of the sequence as it is written: every repeat once, and steps that wait until settled as long as their ramps.
"""

from collections.abc import Iterable, Iterator
from collections.abc import Sequence as Items
from dataclasses import replace
from typing import Any, NamedTuple

from bubbleskin.checks import number, whole
from bubbleskin.errors import InvalidInput
from bubbleskin.sequence.model import REST_MM, Sequence
from bubbleskin.sequence.steps import SECONDS_MAX, After, Repeat, Step, each_step

LEAST_MS = 10
"""What a ramp is left at least where its neighbour needs room: the tick of a wristband of nineteen."""
_MS_MAX = round(SECONDS_MAX * 1000)
Parts = Items[Step | Repeat]
Path = tuple[int, ...]


class Moment(NamedTuple):
    """When a step is, ms from the start of what is written."""

    begin: int
    arrival: int
    """Its ramp has ended: where its keyframes are."""
    end: int


def moments(sequence: Sequence) -> list[Moment]:
    """When each step is, in the order in which they are written."""
    found, now = list[Moment](), 0
    for step in sequence.each:
        found.append(Moment(now, now + _ms(step.ramp), now + _ms(step.shortest)))
        now = found[-1].end
    return found


def written_once(sequence: Sequence) -> Sequence:
    """The steps alone, each once: what `moments` counts."""
    return Sequence(sequence.each, layout=sequence.layout)


def heights_at(sequence: Sequence, time_ms: float, rest_mm: float = REST_MM) -> list[float]:
    """What is asked of the bubbles at a time of what is written, mm."""
    heights = written_once(sequence).targets_at(time_ms / 1000, rest_mm)
    return [round(height, 3) for height in heights.tolist()]


class Around(NamedTuple):
    """A repeat, and the steps in it."""

    path: Path
    first: int
    last: int
    times: int


def repeats(sequence: Sequence) -> list[Around]:
    """All repeats, outer ones before those within them."""

    def walk(parts: Parts, path: Path, index: int) -> Iterator[Around]:
        for place, part in enumerate(parts):
            count = 1
            if isinstance(part, Repeat):
                count = sum(1 for _ in each_step(part.steps))
                yield Around((*path, place), index, index + count - 1, part.times)
                yield from walk(part.steps, (*path, place), index)
            index += count

    return list(walk(sequence.steps, (), 0))


# What is changed.


def changed(sequence: Sequence, **what: Any) -> Sequence:
    """The same with another `steps`, `loops` or `name`."""
    kept = {name: getattr(sequence, name) for name in ("steps", "loops", "name", "board", "layout")}
    kept.update(what)
    return Sequence(kept.pop("steps"), **kept)


def with_step(sequence: Sequence, index: int, **what: Any) -> Sequence:
    """Step `index` with another `ramp`, `easing`, `until` or `name`; those after it come sooner or later."""
    return _put(sequence, index, [replace(_step(sequence, index), **what)])


def with_targets(sequence: Sequence, index: int, bubbles: Iterable[int], height_mm: float | None) -> Sequence:
    """Step `index` with `bubbles` going to a height; None leaves them as they are."""
    step = _step(sequence, index)
    targets = list(step.targets_mm) if step.targets_mm is not None else [None] * sequence.bubbles
    for bubble in bubbles:
        targets[whole("bubble", bubble, 0, sequence.bubbles - 1)] = _height(height_mm)
    return _put(sequence, index, [replace(step, targets_mm=targets)])


def without_keyframe(sequence: Sequence, index: int, bubbles: Iterable[int]) -> Sequence:
    """Step `index` leaves `bubbles` as they are. What is after it stays where it is; a last step of nothing else goes."""
    left = with_targets(sequence, index, bubbles, None)
    if index == len(left.each) - 1 and index and is_wait(left.each[index]):
        return without_step(left, index)
    return left


def without_step(sequence: Sequence, index: int) -> Sequence:
    """No step `index`; those after it come sooner. A repeat of nothing goes with it."""
    _step(sequence, index)
    if len(sequence.each) == 1:
        raise InvalidInput("This is the only step, and a sequence has one at least; open another sequence instead.")
    return _put(sequence, index, [])


def moved(sequence: Sequence, index: int, arrival_ms: int) -> Sequence:
    """The keyframes of step `index` at another time, as near as its neighbours let them; the others stay where they are.

    What it takes or gives is its own wait, then the ramp of the step after it. Where a repeat begins or ends, or all of it, no
    other step gives way: what is after it comes sooner or later.
    """
    step, moment = _step(sequence, index), moments(sequence)[index]
    path = _path(sequence.steps, index)
    later = _at(sequence.steps, (*path[:-1], path[-1] + 1))
    ramp, hold = _ms(step.ramp), _ms(step.until.seconds) if isinstance(step.until, After) else 0
    room = hold + _room(later) if isinstance(later, Step) else _MS_MAX
    least = min(ramp, 0 if hold else LEAST_MS)
    shift = max(least - ramp, min(_whole_ms(arrival_ms) - moment.arrival, _MS_MAX - ramp, room))
    gives = max(min(shift, hold), hold - _MS_MAX) if hold else 0
    until = After((hold - gives) / 1000) if isinstance(step.until, After) else step.until
    parts: list[Step | Repeat] = [replace(step, ramp=(ramp + shift) / 1000, until=until)]
    if isinstance(later, Step) and shift != gives:
        parts.append(_shorter(later, shift - gives))
    return changed(sequence, steps=_spliced(sequence.steps, path, len(parts), parts))


def keyed(
    sequence: Sequence, time_ms: int, bubbles: Iterable[int], height_mm: float | None = None, rest_mm: float = REST_MM
) -> tuple[Sequence, int]:
    """`bubbles` at a height at a time: with another keyframe of a step that arrives then, or with a step of its own.

    A ramp that is cut in two goes through what it had there, each part eased by itself. No height: the one that they have there.
    Returns the step's index too.
    """
    time_ms, bubbles = _whole_ms(time_ms), list(bubbles)
    now = heights_at(sequence, time_ms, rest_mm)
    height = _height(height_mm) if height_mm is not None else now[whole("bubble", bubbles[0], 0, len(now) - 1)]
    when = moments(sequence)
    for index, moment in enumerate(when):
        if moment.arrival == time_ms and not is_wait(sequence.each[index]):
            return with_targets(sequence, index, bubbles, height), index
    alone = [height if bubble in bubbles else None for bubble in range(sequence.bubbles)]
    if time_ms >= when[-1].end:
        step = Step(alone, (time_ms - when[-1].end) / 1000)
        return changed(sequence, steps=(*sequence.steps, step)), len(when)
    index = next(number for number, moment in enumerate(when) if time_ms < moment.end)
    parts, which = _cut(sequence.each[index], when[index], time_ms, alone, now)
    return _put(sequence, index, parts), index + which


def repeated(sequence: Sequence, first: int, last: int, times: int) -> Sequence:
    """Steps `first` to `last` played `times` over; 0: until it is stopped."""
    first, last = min(first, last), max(first, last)
    begin, end = _path(sequence.steps, first), _path(sequence.steps, last)
    depth = next((level for level, (one, other) in enumerate(zip(begin, end, strict=False)) if one != other), None)
    depth = min(len(begin), len(end)) - 1 if depth is None else depth
    if any(begin[depth + 1 :]) or _step_after(sequence.steps, end, depth) != last + 1:
        raise InvalidInput(
            f"Steps {first} to {last} begin or end within a repeat; choose all of its steps, or only steps in it."
        )
    parts = [_at(sequence.steps, (*begin[:depth], place)) for place in range(begin[depth], end[depth] + 1)]
    around = Repeat([part for part in parts if part is not None], times)
    return changed(sequence, steps=_spliced(sequence.steps, begin[: depth + 1], len(parts), [around]))


def with_times(sequence: Sequence, path: Items[int], times: int) -> Sequence:
    """The repeat at `path` plays its steps another number of times; once: it is no repeat any more."""
    part = _at(sequence.steps, tuple(path))
    if not isinstance(part, Repeat):
        raise InvalidInput("There is no repeat any more; look again.")
    parts = part.steps if times == 1 else [replace(part, times=times)]
    return changed(sequence, steps=_spliced(sequence.steps, tuple(path), 1, parts))


def is_wait(step: Step) -> bool:
    """Whether it goes nowhere."""
    return step.targets_mm is None or all(target is None for target in step.targets_mm)


# The tree of steps and repeats: a path is the place in each list on the way to a part.


def _path(parts: Parts, index: int) -> Path:
    """Of the step that is written as number `index`."""
    for place, part in enumerate(parts):
        count = 1 if isinstance(part, Step) else sum(1 for _ in each_step(part.steps))
        if index < count:
            return (place,) if isinstance(part, Step) else (place, *_path(part.steps, index))
        index -= count
    raise InvalidInput("There is no such step any more; look again.")


def _at(parts: Parts, path: Path) -> Step | Repeat | None:
    head, *rest = path
    part = parts[head] if 0 <= head < len(parts) else None
    if not rest:
        return part
    return _at(part.steps, tuple(rest)) if isinstance(part, Repeat) else None


def _spliced(parts: Parts, path: Path, count: int, new: Iterable[Step | Repeat]) -> tuple[Step | Repeat, ...]:
    """`parts` with `new` instead of `count` of them from `path` on; a repeat without steps goes."""
    head, *rest = path
    if rest:
        around = parts[head]
        assert isinstance(around, Repeat)
        inner = _spliced(around.steps, tuple(rest), count, new)
        count, new = 1, [replace(around, steps=inner)] if inner else []
    return (*parts[:head], *new, *parts[head + count :])


def _put(sequence: Sequence, index: int, new: Iterable[Step | Repeat]) -> Sequence:
    return changed(sequence, steps=_spliced(sequence.steps, _path(sequence.steps, index), 1, new))


def _step(sequence: Sequence, index: int) -> Step:
    if not 0 <= index < len(sequence.each):
        raise InvalidInput("There is no such step any more; look again.")
    return sequence.each[index]


def _step_after(parts: Parts, path: Path, depth: int) -> int:
    """The number of the step after the part at `path`, cut to `depth`."""
    inside = parts
    count = 0
    for level, place in enumerate(path[: depth + 1]):
        count += sum(1 for _ in each_step(inside[: place + (level == depth)]))
        part = inside[place]
        inside = part.steps if isinstance(part, Repeat) else ()
    return count


# Times in whole ms.


def _ms(seconds: float) -> int:
    return round(seconds * 1000)


def _whole_ms(value: Any) -> int:
    return round(number("The time", value, 0.0, 1e9, "ms"))


def _height(value: float | None) -> float | None:
    return None if value is None else round(number("The height", value), 3)


def _room(step: Step) -> int:
    """ms that it can give."""
    hold = _ms(step.until.seconds) if isinstance(step.until, After) and is_wait(step) else 0
    return max(0, _ms(step.ramp) + hold - LEAST_MS)


def _shorter(step: Step, by: int) -> Step:
    """`by` ms shorter, or longer where it is below 0: its ramp, then, of one that only waits, its wait."""
    ramp = _ms(step.ramp)
    if by < 0 and ramp - by > _MS_MAX:
        raise InvalidInput(
            f"The step after it would ramp for more than {SECONDS_MAX:g} s; add a keyframe between them."
        )
    taken = min(by, ramp if is_wait(step) else ramp - min(ramp, LEAST_MS))
    until = step.until
    if by > taken and isinstance(until, After):
        until = After((_ms(until.seconds) - by + taken) / 1000)
    return replace(step, ramp=(ramp - taken) / 1000, until=until)


def _cut(
    step: Step, moment: Moment, time_ms: int, alone: list[float | None], now: list[float]
) -> tuple[list[Step | Repeat], int]:
    """`step` as parts, one of which arrives at `time_ms` with the targets `alone`, and which; `now` is what it had there."""
    if time_ms <= moment.arrival or not isinstance(step.until, After):
        targets = step.targets_mm if step.targets_mm is not None else [None] * len(alone)
        through = [
            here if one is None and target is not None else one
            for one, target, here in zip(alone, targets, now, strict=True)
        ]
        ramp = time_ms - moment.begin
        left = max(_ms(step.ramp) - ramp, 0 if step.longest > step.ramp else LEAST_MS)
        return [Step(through, ramp / 1000, step.easing, After(0.0), step.name), replace(step, ramp=left / 1000)], 0
    parts, begin = list[Step | Repeat](), moment.begin
    if step.ramp or not is_wait(step):
        before = replace(step, until=After(0.0))
        parts, begin = [before], begin + _ms(before.shortest)
    left = max(moment.end - max(time_ms, begin), 0)
    return [*parts, Step(alone, max(time_ms - begin, 0) / 1000, until=After(left / 1000))], len(parts)
