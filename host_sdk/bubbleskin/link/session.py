"""Requests and replies over one transport: each request has one reply or one error, in time."""

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TypeVar

from bubble_protocol import codec, messages
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.errors import DeviceRefused, DeviceSilent, LinkError, WrongDevice
from bubbleskin.link import wire
from bubbleskin.link.ticks import DeviceTicks
from bubbleskin.link.transport import Transport

RESEND = 0.25
"""Seconds after which a request without a reply is sent again. Every request of this version may be
handled twice with the same outcome."""

KEEP_ALIVE = 0.1
"""Seconds without a request after which a waiting link says PING: the wristband vents where its host is silent."""

_TELEMETRY_KEPT = 4096
_SLICE = 0.02
"""Seconds for which one task reads before another has its turn."""

_T = TypeVar("_T")


class Link:
    """One device at the other end of `transport`.

    Everything is a coroutine. Without an event loop the transport is read in place and no coroutine ever
    suspends, so that `drive` can run it. With one, other tasks have their turn while this one waits: a
    transport that waits by the wall's clock is read in a thread.
    """

    def __init__(self, transport: Transport, timeout: float, *, event_loop: bool = False):
        self.transport = transport
        self.timeout = timeout
        self.telemetry: deque[wire.Received] = deque(maxlen=_TELEMETRY_KEPT)
        self._event_loop = event_loop
        self._reader = wire.Reader()
        self._heard = False
        self._replies: dict[int, wire.Received] = {}
        self._sequence = 0
        self._spoke = transport.now()
        self._clock = DeviceTicks()
        self._reading = asyncio.Lock()
        self._thread: asyncio.Future[None] | None = None

    async def hello(self) -> wire.Received:
        """Ask who is there. `WrongDevice` where that is no wristband or one we cannot talk to."""
        self.transport.write(b"\0")  # whatever half frame stood on the line ends here
        try:
            reply = await self.call("HELLO", (PROTOCOL_MIN, PROTOCOL_MAX))
        except DeviceSilent:
            heard = "It sends data, but not ours." if self._heard else "It says nothing at all."
            raise WrongDevice(
                f"What is at {self.transport.name} does not answer as a wristband within {self.timeout:g} s. {heard} "
                "Check that it is the right port and that the wristband runs bubbleskin firmware."
            ) from None
        low, high = reply["protocol_min"], reply["protocol_max"]
        if high < PROTOCOL_MIN or low > PROTOCOL_MAX:
            raise WrongDevice(_version_sentence(low, high))
        return reply

    async def call(
        self, name: str, fixed: Sequence[int] = (), repeated: Sequence[Sequence[int]] = (), timeout: float | None = None
    ) -> wire.Received:
        """Send a request and wait for its reply. `DeviceRefused` or `DeviceSilent` where there is none."""
        sequence = self._sequence = self._sequence + 1 & 0xFFFF
        self._replies.pop(sequence, None)  # a late one, to the request that had this number 65536 requests ago
        request = codec.BY_NAME[name].id
        frame = wire.encode(name, sequence, fixed, repeated)
        patience = self.timeout if timeout is None else timeout
        deadline = self.transport.now() + patience
        while (now := self.transport.now()) < deadline:
            self._send(frame)
            await self.wait(min(deadline, now + RESEND), lambda: sequence in self._replies)
            reply = self._replies.pop(sequence, None)
            if reply is None:
                continue
            if reply.id == messages.ERROR:
                if reply["error"] == messages.NO_COMMON_PROTOCOL:
                    raise WrongDevice(_version_sentence(reply["low"], reply["high"]))
                raise DeviceRefused(wire.explain(reply))
            if reply.id == request | messages.REPLY:
                return reply
        raise DeviceSilent(
            f"The wristband at {self.transport.name} has not answered {name} within {patience:g} s. "
            "Check its cable and power, then connect again."
        )

    async def wait(self, until: float, done: Callable[[], bool] = lambda: False) -> None:
        """Take what comes until `done()` or the transport's clock stands at `until`."""
        while not done() and (now := self.transport.now()) < until:
            if now >= self._spoke + KEEP_ALIVE - 1e-9:
                self._sequence = self._sequence + 1 & 0xFFFF
                self._send(wire.encode("PING", self._sequence, (0,)))
            async with self._reading:
                left = min(until, self._spoke + KEEP_ALIVE) - self.transport.now()
                if left > 0 and not done():
                    await self._receive(left)

    def _send(self, frame: bytes) -> None:
        self.transport.write(frame)
        self._spoke = self.transport.now()

    async def close(self) -> None:
        """Let go of the transport."""
        try:
            if self._thread:  # a port must not close under its reader
                with contextlib.suppress(LinkError):
                    await asyncio.shield(self._thread)
        finally:
            self.transport.close()

    def _take(self, data: bytes) -> None:
        self._heard = self._heard or bool(data)
        for message in self._reader.feed(data):
            self._clock.unwrap(message)
            if message.id == messages.TELEMETRY:
                self.telemetry.append(message)
            elif message.id & messages.REPLY or message.id == messages.ERROR:
                if len(self._replies) > 64:
                    self._replies.clear()
                self._replies[message.sequence] = message

    async def _receive(self, timeout: float) -> None:
        """Take what comes within `timeout`; with an event loop, within a slice of it."""
        if not self._event_loop:
            self._take(self.transport.read(timeout))
        elif not self.transport.blocks:
            self._take(self.transport.read(min(timeout, _SLICE)))
            await asyncio.sleep(0)
        else:
            # A cancelled wait must not lose what the thread is about to read: it goes on, and takes it.
            if self._thread is None:
                self._thread = asyncio.ensure_future(self._receive_in_thread(min(timeout, _SLICE)))
            thread = self._thread
            try:
                await asyncio.shield(thread)
            finally:
                if thread.done():
                    self._thread = None

    async def _receive_in_thread(self, timeout: float) -> None:
        self._take(await asyncio.to_thread(self.transport.read, timeout))


def drive(coroutine: Coroutine[Any, Any, _T]) -> _T:
    """Run a coroutine that never suspends, as all of a `Link` without threads are."""
    try:
        coroutine.send(None)
    except StopIteration as finished:
        return finished.value
    coroutine.close()
    raise RuntimeError("a coroutine of the synchronous link has suspended")


def _version_sentence(low: int, high: int) -> str:
    theirs = f"protocol {low}" if low == high else f"protocols {low} to {high}"
    if high < PROTOCOL_MIN:
        return f"The wristband speaks {theirs}, this SDK {PROTOCOL_MIN} and newer: update the wristband's firmware."
    return f"The wristband speaks {theirs}, this SDK at most {PROTOCOL_MAX}: update it with `pip install --upgrade bubbleskin`."
