"""Telemetry of one wristband: asked for, read by an iterator or recorded; one at a time."""

import asyncio
import contextlib
import os
from collections.abc import AsyncGenerator, Callable, Iterable

from bubble_protocol.schema import messages
from bubbleskin import checks
from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.layout import Layout
from bubbleskin.link.link import Link
from bubbleskin.link.message import Message
from bubbleskin.telemetry.fields import USUAL, mask, most, state
from bubbleskin.telemetry.recording import Recording, Table

LEAST_HZ = 0.01
"""Slowest telemetry: every 100 s. Who waits longer takes `state`."""


class Telemetry:
    """What `AsyncSkin` asks of telemetry."""

    def __init__(self, link: Link, info: Info, tell: Callable[[State], State]):
        self._link = link
        self._info = info
        self._tell = tell  # from what the device believes to what is told
        self._iterator = 0  # number of the newest
        self._recording: Recording | None = None
        self._wanted: tuple[str, tuple[int, ...]] | None = None  # what is subscribed to

    def opened(self) -> None:
        """The link has opened another session, in which the device knows of no subscription: it goes on."""
        if self._wanted:
            self._link.telemetry.go_on()
            self._link.post(*self._wanted)

    async def states(self, rate_hz: float, fields: Iterable[str] | None) -> AsyncGenerator[State]:
        """See `Skin.telemetry`."""
        request, period = self._subscription(rate_hz, fields)
        link = self._link
        self._iterator = mine = self._iterator + 1
        patience = period * self._info.tick + link.timeout
        try:
            await self._subscribe(*request)
            while True:
                await link.wait(link.transport.now() + patience, lambda: bool(link.telemetry) or mine != self._iterator)
                if mine != self._iterator:
                    return
                if link.telemetry:
                    yield self._state_of(link.telemetry.popleft(), link.telemetry.lost)
                else:
                    await self._subscribe(*request)  # forgotten there, or nobody is there: then this says so
        except (GeneratorExit, asyncio.CancelledError):
            if mine == self._iterator:
                with contextlib.suppress(LinkError):
                    await self._unsubscribe()
            raise

    async def record(
        self,
        path: str | os.PathLike[str],
        layout: Layout,
        rate_hz: float,
        seconds: float | None,
        fields: Iterable[str] | None,
    ) -> Recording:
        """See `Skin.record`."""
        request, period = self._subscription(rate_hz, fields)
        if seconds is not None:
            seconds = checks.above_zero("seconds", seconds, unit="s")
        link = self._link
        recording = Recording(Table(path, self._info, layout, 1 / (period * self._info.tick)), self._unrecord)
        self._iterator += 1  # an iterator that reads telemetry ends
        self._recording = recording
        link.telemetry.listeners.append(self._to_recording)
        try:
            await self._subscribe(*request)
            if seconds is not None:
                ends = link.transport.now() + seconds
                while (now := link.transport.now()) < ends:
                    rows = recording.rows
                    await link.wait(min(ends, now + period * self._info.tick + link.timeout))
                    if recording.rows == rows and link.transport.now() < ends:
                        await self._subscribe(*request)  # as in `telemetry`
                await recording.aclose()
        except BaseException:
            await recording.aclose()
            raise
        return recording

    def _to_recording(self, message: Message, lost: int) -> None:
        if self._recording:
            self._recording.write(self._state_of(message, lost))

    async def _unrecord(self) -> None:
        self._recording = None
        self._link.telemetry.listeners.remove(self._to_recording)
        await self._unsubscribe()

    def _subscription(self, rate_hz: float, fields: Iterable[str] | None) -> tuple[tuple[str, tuple[int, ...]], int]:
        """The request for telemetry, and its period in ticks."""
        if self._recording:
            raise InvalidInput(f"{self._recording.path} is being recorded; there is one telemetry at a time.")
        highest = 1 / self._info.tick
        rate_hz = checks.number("rate_hz", rate_hz, LEAST_HZ, highest, "a second")
        period = max(1, round(highest / rate_hz))
        if fields is None and self._info.tells_sd and most(self._info.bubbles) >= len(USUAL):
            fields = USUAL
        if fields is None:
            return ("SUBSCRIBE", (period,)), period
        return ("SUBSCRIBE_FIELDS", (period, mask(fields, self._info.bubbles))), period

    async def _subscribe(self, request: str, values: tuple[int, ...]) -> None:
        await self._unsubscribe()  # so that nothing of an older one is still on its way
        self._link.telemetry.begin()
        await self._link.call(request, values)
        self._wanted = request, values

    async def _unsubscribe(self) -> None:
        self._wanted = None
        await self._link.call("SUBSCRIBE", (0,))

    def _state_of(self, message: Message, lost: int) -> State:
        if message.id == messages.TELEMETRY:
            return self._tell(State.of(message, self._info.tick, lost))
        return self._tell(state(message, self._info.tick, self._info.bubbles, lost))

    async def aclose(self) -> None:
        """Finish a recording."""
        if self._recording:
            await self._recording.aclose()
