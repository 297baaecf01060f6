"""Playing a sequence: upload, arm, start, and following it to its end."""

import contextlib
import dataclasses

from bubble_protocol.schema import sequences
from bubble_protocol.schema.system import TICKS_WRAP
from bubbleskin import checks
from bubbleskin.device.health import Health
from bubbleskin.device.info import Info
from bubbleskin.device.state import State, bubbles_of
from bubbleskin.errors import DeviceFault, DeviceRefused, InvalidInput
from bubbleskin.fault_guide import remedies
from bubbleskin.layout import Layout
from bubbleskin.link.framing import crc32
from bubbleskin.link.link import Link
from bubbleskin.sequence.compile import Compiled
from bubbleskin.sequence.event_log import REASONS, EventLog
from bubbleskin.sequence.library import LIBRARY
from bubbleskin.sequence.model import Playable, Sequence, playable
from bubbleskin.sequence.playback import PlaybackReport, PlaybackStatus, Progress
from bubbleskin.sequence.steps import Settled
from bubbleskin.sequence.uploader import Uploader

AT_MAX = 1e9  # seconds: some thirty years
_STATES = {number: name for number, name, _ in sequences.STATES}
_AFTER_TIMEOUT = {"hold": "its shape is held", "vent": "everything vents", "stop": "all valves are closed"}
_POLL = 0.2
"""Seconds after which the device is asked, news or not: it must hear from its host, and an event can be lost."""
_TOP_UP = 0.05
"""Seconds between two looks at whether a stream's memory has room."""


class Player:
    """Plays sequences on the device at the other end of `link`."""

    def __init__(self, link: Link, info: Info, layout: Layout):
        self._link = link
        self._info = info
        self._layout = layout
        self._upload: Uploader | None = None  # of the sequence played last

    def sequence_of(self, what: Playable) -> Sequence:
        """What is meant: a sequence of the library by its name, or what `playable` knows."""
        return LIBRARY[what](self._layout) if isinstance(what, str) and what in LIBRARY else playable(what)

    async def start(self, what: Playable, at: float | None, *, follow: bool) -> Uploader:
        """Upload a sequence, arm and start it; `follow`: whether its rest can be sent while it plays. See `Skin.play`."""
        sequence = self.sequence_of(what)
        compiled = Compiled.of(sequence, self._info, self._layout)
        start = self._tick(at)
        link = self._link
        state = await link.call("SEQUENCE_STATE")
        upload = Uploader(link, state["sequence"] + 1 & 0xFFFF, compiled, state["capacity"])
        if upload.streams and not follow:
            raise InvalidInput(
                f"The sequence takes {len(compiled)} records and the memory of this {self._info.board} holds "
                f"{state['capacity']}: the rest is sent while it plays. Play it with wait=True, or use repeats."
            )
        board = crc32(self._info.board.encode()) if sequence.board else 0
        await link.call("SEQUENCE_BEGIN", (upload.id, sequence.bubbles, board, upload.total, compiled.crc))
        self._upload = upload
        await upload.fill()
        await link.call("SEQUENCE_ARM", (upload.id,))
        link.events.clear()  # of the sequence before
        await link.call("SEQUENCE_START", (upload.id, start))
        return upload

    def _tick(self, at: float | None) -> int:
        if at is None:
            return 0
        at = checks.number("at", at, high=AT_MAX, unit="s")
        if at <= 0:
            raise InvalidInput(
                f"A sequence cannot start at {at} s; give a device time in s, as of `state().time`, or None."
            )
        # Device time on the wire goes on from 0, and 0 says "at once": what falls on it starts a tick later.
        return round(at / self._info.tick) % TICKS_WRAP or 1

    async def status(self) -> PlaybackStatus:
        """See `Skin.playing`."""
        reply = await self._link.call("SEQUENCE_STATE")
        upload = self._upload if self._upload and self._upload.id == reply["sequence"] else None
        state = _STATES.get(reply["state"], "unknown")
        begun = state in ("playing", "paused") or (state == "ended" and reply["begun_ticks"] > 0)
        step = upload.step(reply["record"]) if upload and begun else -1
        return PlaybackStatus(
            state=state,
            reason=REASONS.get(reply["reason"], "unknown"),
            step=step,
            begun=reply["begun_ticks"] * self._info.tick,
            time=reply["ticks"] * self._info.tick,
            unsettled=bubbles_of(reply["unsettled"]),
            timeouts=reply["timeouts"],
            name=upload.name(step) if upload else "",
            steps=upload.compiled.total if upload else 0,
        )

    async def control(self, action: int) -> None:
        """Pause, resume or end the sequence that runs, whoever uploaded it."""
        running = await self._link.call("SEQUENCE_STATE")
        await self._link.call("SEQUENCE_CONTROL", (running["sequence"], action))

    async def follow(self, upload: Uploader, progress: Progress | None) -> PlaybackReport:
        """Take the device's events until the sequence has ended; where none come, ask."""
        link = self._link
        now = link.transport.now
        log = EventLog(upload, self._layout, self._info.tick)
        asked = now()
        while True:
            await link.wait(now() + _TOP_UP if upload.unsent else asked + _POLL, lambda: bool(link.events))
            with contextlib.suppress(DeviceRefused):  # it has ended meanwhile: the device will say why
                await upload.fill()
            status = log.take(link.events.popleft()) if link.events else None
            if now() >= asked + _POLL:
                polled = await self.status()
                asked = now()
                if not status and not link.events:
                    if polled.state == "ended":
                        log.lost += 1  # the event that says so
                    status = dataclasses.replace(polled, begun_steps=len(log.steps))
            if status and status.state == "ended":
                return await self._report(log, status)
            if status and progress:
                progress(status)

    async def _report(self, log: EventLog, end: PlaybackStatus) -> PlaybackReport:
        """What there is to say of the end; `DeviceFault` where it was not the sequence's own."""
        if end.reason == "by_timeout":
            raise await self._ended_by_timeout(log, end)
        where = log.upload.sequence.say(log.steps[-1] if log.steps else 0).lower()
        if end.reason == "underrun":
            raise DeviceFault(
                f"The sequence ran dry after {where}: its steps are shorter than the link can bring them. The last shape is "
                "held. Make steps longer, or use repeats."
            )
        if end.reason == "cancelled":
            raise await self._cancelled(where)
        if end.unsettled and log.steps:
            log.timeouts.append(log.timeout(log.steps[-1], end.unsettled))
        return PlaybackReport(tuple(log.steps), tuple(log.began), end.time, tuple(log.timeouts), log.lost)

    async def _ended_by_timeout(self, log: EventLog, end: PlaybackStatus) -> DeviceFault:
        state = State.of(await self._link.call("STATE"), self._info.tick)
        step = log.steps[-1] if log.steps else 0
        until = log.upload.sequence.each[step].until
        assert isinstance(until, Settled)
        return DeviceFault(
            f"{log.timeout(step, end.unsettled, state)} The sequence ended there and {_AFTER_TIMEOUT[until.then]}. "
            "Check the supply pressure in `health()`, leaks and kinked tubes."
        )

    async def _cancelled(self, where: str) -> DeviceFault:
        faults = Health.of(await self._link.call("INFO"), self._info.tick).board_faults
        if faults:
            return DeviceFault(
                f"The sequence ended in {where}: faults of the board: {', '.join(faults)}. {remedies(faults)}"
            )
        return DeviceFault(f"The sequence ended in {where}: it was stopped or vented, or something else was shown.")
