"""Playing a sequence: upload, arm, start, and what the device tells of it on the way."""

import contextlib
import dataclasses
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

from bubble_protocol.schema import sequences
from bubbleskin.device.records import Health, Info, State
from bubbleskin.errors import DeviceFault, DeviceRefused, InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.link.link import Call, Link
from bubbleskin.link.message import Message, crc32
from bubbleskin.sequence.compile import Program
from bubbleskin.sequence.model import Playable, Settled, playable

_STATES = {number: name for number, name, _ in sequences.STATES}
_REASONS = {number: name for number, name, _ in sequences.REASONS}
_WORDS_PER_MESSAGE = 121
_TOGETHER = 8  # messages on their way at once: each has as long as any other call
_POLL = 0.2
"""Seconds after which the device is asked, news or not: it must hear from its host, and an event can be lost."""
_NAMED = 3  # heights in a sentence
_TOP_UP = 0.05
"""Seconds between two looks at whether a stream's memory has room."""


@dataclass(frozen=True)
class Playing:
    """How far a sequence is."""

    state: str
    """empty, loading, armed, waiting, playing, paused or ended."""
    reason: str
    """How it ended: complete, by_timeout, cancelled or underrun; unended while it has not."""
    step: int
    """The step being played, counted from 0 as written; -1 before the first, or where another host uploaded it."""
    begun: float
    """Device time at which the step began, s."""
    time: float
    """Device time, s."""
    unsettled: tuple[int, ...]
    """Bubbles that were not there when the last step with a timeout ended by it."""
    timeouts: int
    """Steps that ended by their timeout."""
    played: int = 0
    """Steps begun so far, those of repeats every time, as `play` has counted them."""
    name: str = ""
    """The step's."""
    steps: int = 0
    """Steps that will be played in all; 0 where there is no end."""


Progress = Callable[[Playing], None]


@dataclass(frozen=True)
class Played:
    """What became of a sequence that was played to its end; times are the device's, s."""

    steps: tuple[int, ...]
    """The steps in the order in which they were played."""
    began: tuple[float, ...]
    """When each of them began."""
    ended: float
    timeouts: tuple[str, ...]
    """A sentence for each step that ended by its timeout."""
    lost: int
    """Events that did not arrive: so many steps may be missing here."""


class Player:
    """Plays sequences on the device at the other end of `link`."""

    def __init__(self, link: Link, info: Info, layout: Layout):
        self._link = link
        self._info = info
        self._layout = layout
        self._feed: _Feed | None = None  # of the sequence played last

    async def play(self, what: Playable, at: float | None, wait: bool, progress: Progress) -> Played | None:
        """See `Skin.play`."""
        sequence = playable(what)
        program = Program.of(sequence, self._info, self._layout)
        start = self._tick(at)
        link = self._link
        state = await link.call("SEQUENCE_STATE")
        feed = _Feed(link, state["sequence"] + 1 & 0xFFFF, program, state["capacity"])
        if feed.streams and not wait:
            raise InvalidInput(
                f"The sequence takes {len(program)} records and the memory of this {self._info.board} holds "
                f"{state['capacity']}: the rest is sent while it plays. Play it with wait=True, or use repeats."
            )
        board = crc32(self._info.board.encode()) if sequence.board else 0
        await link.call("SEQUENCE_BEGIN", (feed.id, sequence.bubbles, board, feed.total, program.crc))
        self._feed = feed
        await feed.fill()
        await link.call("SEQUENCE_ARM", (feed.id,))
        link.events.clear()  # of the sequence before
        await link.call("SEQUENCE_START", (feed.id, start))
        return await self._follow(feed, progress) if wait else None

    def _tick(self, at: float | None) -> int:
        if at is None:
            return 0
        if not (math.isfinite(at) and 0 < at < 2**30 * self._info.tick):
            raise InvalidInput(
                f"A sequence cannot start at {at} s; give a device time in s, as of `state().time`, or None."
            )
        return max(1, round(at / self._info.tick))

    async def state(self) -> Playing:
        """See `Skin.playing`."""
        reply = await self._link.call("SEQUENCE_STATE")
        feed = self._feed if self._feed and self._feed.id == reply["sequence"] else None
        state = _STATES.get(reply["state"], "unknown")
        begun = state in ("playing", "paused") or (state == "ended" and reply["begun_ticks"] > 0)
        step = feed.step(reply["record"]) if feed and begun else -1
        return Playing(
            state=state,
            reason=_REASONS.get(reply["reason"], "unknown"),
            step=step,
            begun=reply["begun_ticks"] * self._info.tick,
            time=reply["ticks"] * self._info.tick,
            unsettled=_bits(reply["unsettled"]),
            timeouts=reply["timeouts"],
            name=feed.sequence.each[step].name if feed and step >= 0 else "",
            steps=feed.program.played if feed else 0,
        )

    async def control(self, action: int) -> None:
        """Pause, resume or end the sequence that runs, whoever uploaded it."""
        running = await self._link.call("SEQUENCE_STATE")
        await self._link.call("SEQUENCE_CONTROL", (running["sequence"], action))

    async def _follow(self, feed: "_Feed", progress: Progress) -> Played:
        """Take the device's events until the sequence has ended; where none come, ask."""
        link = self._link
        now = link.transport.now
        told = _Told(feed, self._layout, self._info.tick)
        asked = now()
        while True:
            await link.wait(now() + _TOP_UP if feed.unsent else asked + _POLL, lambda: bool(link.events))
            with contextlib.suppress(DeviceRefused):  # it has ended meanwhile: the device will say why
                await feed.fill()
            playing = told.take(link.events.popleft()) if link.events else None
            if now() >= asked + _POLL:
                state = await self.state()
                asked = now()
                if not playing and not link.events:
                    if state.state == "ended":
                        told.lost += 1  # the event that says so
                    playing = dataclasses.replace(state, played=len(told.steps))
            if playing:
                if playing.state == "ended":
                    return await self._end(told, playing)
                progress(playing)

    async def _end(self, told: "_Told", end: Playing) -> Played:
        """What there is to say of the end; `DeviceFault` where it was not the sequence's own."""
        link = self._link
        step = told.steps[-1] if told.steps else 0
        where = told.feed.sequence.say(step).lower()
        if end.reason == "by_timeout":
            state = State.of(await link.call("STATE"), self._info.tick)
            until = told.feed.sequence.each[step].until
            assert isinstance(until, Settled)
            now = {"hold": "its shape is held", "vent": "everything vents", "stop": "all valves are closed"}[until.then]
            raise DeviceFault(
                f"{told.timeout(step, end.unsettled, state)} The sequence ended there and {now}. "
                "Check the supply pressure in `health()`, leaks and kinked tubes."
            )
        if end.reason == "underrun":
            raise DeviceFault(
                f"The sequence ran dry after {where}: its steps are shorter than the link can bring them. The last shape is "
                "held. Make steps longer, or use repeats."
            )
        if end.reason == "cancelled":
            faults = ", ".join(Health.of(await link.call("INFO"), self._info.tick).board_faults)
            why = (
                f"faults of the board: {faults}" if faults else "it was stopped or vented, or something else was shown"
            )
            raise DeviceFault(f"The sequence ended in {where}: {why}.")
        if end.unsettled and told.steps:
            told.timeouts.append(told.timeout(step, end.unsettled))
        return Played(tuple(told.steps), tuple(told.began), end.time, tuple(told.timeouts), told.lost)


class _Told:
    """What the device has told of a sequence so far."""

    def __init__(self, feed: "_Feed", layout: Layout, tick: float):
        self.feed = feed
        self.steps: list[int] = []
        self.began: list[float] = []
        self.timeouts: list[str] = []
        self.lost = 0
        self._layout = layout
        self._tick = tick
        self._expected: int | None = None

    def take(self, event: Message) -> Playing | None:
        """How far the sequence is by this event; None where it is another's."""
        feed = self.feed
        if event["sequence"] != feed.id:
            return None
        if self._expected is not None:
            self.lost += event.sequence - self._expected & 0xFFFF
        self._expected = event.sequence + 1
        time, unsettled = event["ticks"] * self._tick, _bits(event["unsettled"])
        reason = _REASONS.get(event["reason"], "unknown")
        state = {sequences.SEQUENCE_PAUSED: "paused", sequences.SEQUENCE_ENDED: "ended"}.get(event["event"], "playing")
        if event["event"] == sequences.STEP_BEGUN:
            if reason == "by_timeout" and self.steps:
                self.timeouts.append(self.timeout(self.steps[-1], unsettled))
            self.steps.append(feed.step(event["record"]))
            self.began.append(time)
        step = self.steps[-1] if self.steps else -1
        return Playing(
            state=state,
            reason=reason if state == "ended" else "unended",
            step=step,
            played=len(self.steps),
            begun=self.began[-1] if self.began else time,
            time=time,
            unsettled=unsettled,
            timeouts=len(self.timeouts),
            name=feed.sequence.each[step].name if step >= 0 else "",
            steps=feed.program.played,
        )

    def timeout(self, step: int, unsettled: tuple[int, ...], state: State | None = None) -> str:
        """A sentence for a step that ended by its timeout."""
        until = self.feed.sequence.each[step].until
        limit = f" within {until.timeout_s:g} s" if isinstance(until, Settled) else ""
        where = ""
        if state:
            off = [f"{state.height_mm[b]:.2f} instead of {state.target_mm[b]:.2f} mm" for b in unsettled[:_NAMED]]
            where = f" at {', '.join(off)}{' …' * (len(unsettled) > _NAMED)}"
        return f"{self.feed.sequence.say(step)} did not settle{limit}: {self._layout.names(unsettled)}{where}."


class _Feed:
    """Brings a program's records to the device: all of them, or those of a stream as there is room for them."""

    def __init__(self, link: Link, identity: int, program: Program, capacity: int):
        self.id = identity
        self.program = program
        self.sequence = program.sequence
        self.streams = len(program) > capacity
        self.total = program.played if self.streams else len(program)
        self.unsent = True
        self._link = link
        self._order = program.stream() if self.streams else iter(range(len(program)))
        self._most = _WORDS_PER_MESSAGE // program.records.shape[1]
        self._sent: list[int] = []  # records, in the order in which they were sent
        self._free = capacity

    def step(self, record: int) -> int:
        """The step that the device's record is."""
        return int(self.program.steps[self._sent[record]]) if record < len(self._sent) else -1

    async def fill(self) -> None:
        """Send all that there is room for."""
        if not self.unsent:
            return
        if not self._free:
            self._free = (await self._link.call("SEQUENCE_STATE"))["free"]
        while self._free:
            calls: list[Call] = []
            sent: list[int] = []
            while len(calls) < _TOGETHER:
                part = list(itertools.islice(self._order, min(self._most, self._free - len(sent))))
                if not part:
                    break
                words = self.program.records[part].reshape(-1, 1).tolist()
                calls.append(("SEQUENCE_WRITE", (self.id, len(self._sent) + len(sent) & 0xFFFF), words))
                sent += part
            if not calls:
                break
            replies = await self._link.calls(calls)
            self._sent += sent
            self._free = replies[-1]["free"]
        self.unsent = self.total == 0 or len(self._sent) < self.total


def _bits(mask: int) -> tuple[int, ...]:
    return tuple(bit for bit in range(32) if mask >> bit & 1)
