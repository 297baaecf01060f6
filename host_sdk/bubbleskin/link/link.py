"""The link to one device: each request is applied once and answered, or its caller is told that it was not."""

import asyncio
import contextlib
import math
import secrets
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TypeVar

from bubble_protocol.schema import messages
from bubble_protocol.schema.errors import OVERTAKEN
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.errors import DeviceRefused, DeviceSilent, LinkError, Overtaken, WrongDevice
from bubbleskin.link import errors, keepalive
from bubbleskin.link.inbox import UNASKED, Inbox
from bubbleskin.link.message import Message, Reader, crc32, describe_refusal, encode, session_key
from bubbleskin.link.pings import Pings
from bubbleskin.link.send_window import Request, Window
from bubbleskin.link.ticks import DeviceTicks
from bubbleskin.link.transport import Transport

KEEP_ALIVE = 0.1
"""Seconds without anything sent after which the device hears a PING."""

_UNANSWERED = 3
"""PINGs in a row without a reply after which the device may have restarted."""
_EVENTS_KEPT = 4096
_SLICE = 0.02
"""Seconds for which one task reads before another has its turn; and between two attempts to open a lost port."""

_T = TypeVar("_T")
Call = tuple[str, Sequence[int], Sequence[Sequence[int]]]


class Link:
    """One device at the other end of `transport`.

    Everything is a coroutine. Without an event loop the transport is read in place and no coroutine ever
    suspends, so that `drive` can run it. With one, other tasks have their turn while this one waits: a
    transport that waits by the wall's clock is read in a thread.

    `on_open(reply)` is called with the reply to HELLO whenever a session has been opened, and
    `on_ping(sent_at, reply, received_at)` with every reply to a PING and the transport's time at both ends,
    from whatever thread or task reads.
    """

    def __init__(self, transport: Transport, timeout: float, *, event_loop: bool = False):
        self.transport = transport
        self.timeout = timeout
        self.telemetry = Inbox()
        self.on_open: Callable[[Message], None] | None = None
        self.on_ping: Callable[[float, Message, float], None] | None = None
        self.events: deque[Message] = deque(maxlen=_EVENTS_KEPT)
        """What has happened to a sequence, as the device told it."""
        self._event_loop = event_loop
        # The thread that keeps the link alive between calls must not read or write during one.
        self.guard: Any = contextlib.nullcontext() if event_loop or not transport.blocks else threading.RLock()
        self.closed = False
        self.open = False
        self._window = Window()
        self._reader = Reader()
        self._heard = False
        self._session = 0
        self._boot_id: int | None = None
        self.restart_asked = False
        """A restart that was asked for is not told as one that was not."""
        self._hellos: dict[int, float] = {}  # when those were sent that asked for this session, by number
        self._hello = 0
        self._greeting: Message | None = None
        self._pings = Pings()
        self._sent_at = 0.0
        self._asked_at = 0.0  # whether the device still is the same
        self._gone: LinkError | None = None  # why the port has gone
        self._ticks = DeviceTicks()
        self._reading = asyncio.Lock()
        self._opening = asyncio.Lock()
        self._thread: asyncio.Future[None] | None = None
        self._background: keepalive.Background | None = None

    async def hello(self) -> Message:
        """Open a session. `WrongDevice` where there is no wristband, or one we cannot talk to."""
        with self.guard:
            try:
                return await self._open(self.transport.now() + self.timeout)
            except DeviceSilent:
                heard = "It sends data, but not ours." if self._heard else "It says nothing at all."
                raise WrongDevice(
                    f"What is at {self.transport.name} does not answer as a wristband within {self.timeout:g} s. {heard} "
                    "Check that it is the right port and that the wristband runs bubbleskin firmware."
                ) from None

    async def call(
        self, name: str, fixed: Sequence[int] = (), repeated: Sequence[Sequence[int]] = (), timeout: float | None = None
    ) -> Message:
        """Send a request and wait for its reply; see `calls`."""
        (reply,) = await self.calls([(name, fixed, repeated)], timeout)
        return reply

    async def calls(self, calls: Sequence[Call], timeout: float | None = None) -> list[Message]:
        """Send requests, as many at once as the device takes, and wait for all replies.

        They are applied in this order, each once. `DeviceRefused` where one is refused, `Overtaken` where STOP
        or VENT came first, and a `LinkError` where there is no reply within `timeout`: its `outcome_unknown` says
        whether the request may have been applied. `DeviceRestarted` where the device has forgotten everything.
        Where several have failed, the first one's error is raised.
        """
        with self.guard:
            patience = self.timeout if timeout is None else timeout
            deadline = self.transport.now() + patience
            requests = [Request(*call, deadline, patience) for call in calls]
            if requests[0].name == "PING":
                return [await self._call_ping(request) for request in requests]
            try:
                for request in requests:
                    self._window.submit(request)
                while open_ones := [request for request in requests if not request.done]:
                    if self.transport.now() >= deadline:
                        break
                    await self._ready(open_ones[0])  # again, where another call's silence has ended the session
                    await self.wait(deadline, lambda: not self.open or all(request.done for request in requests))
            finally:
                for request in requests:
                    if not request.done:
                        self._window.withdraw(request)
            return [self._outcome(request) for request in requests]

    def post(self, name: str, fixed: Sequence[int]) -> None:
        """Send a request that nobody waits for; it ends with the session."""
        self._window.submit(Request(name, fixed, (), math.inf, self.timeout))

    async def wait(self, until: float, done: Callable[[], bool] = lambda: False) -> None:
        """Take what comes until `done()` or the transport's clock stands at `until`; keep the link alive meanwhile."""
        with self.guard:
            while not done() and (now := self.transport.now()) < until:
                self.service(now)
                async with self._reading:
                    if not done():
                        left = min(until, self._due()) - self.transport.now()
                        await self._receive(max(left, 0.0))

    async def close(self) -> None:
        """Let go of the transport."""
        self.closed = True
        self.open = False
        try:
            if self._background:
                await self._background.end()
            if self._thread:  # a port must not close under its reader
                with contextlib.suppress(LinkError):
                    await asyncio.shield(self._thread)
        finally:
            with self.guard:
                self.transport.close()

    # A session.

    async def _ready(self, request: Request) -> None:
        """See to it that a session is open."""
        if self.closed:
            self.transport.read(0.0)  # says so
        if self.open:
            return
        async with self._opening:
            while not self.open and not request.done:
                try:
                    await self._open(request.deadline)
                except DeviceSilent:
                    raise self._silence(request) from None

    async def _open(self, deadline: float) -> Message:
        self._window.end(lambda request: errors.abandoned(request, self.transport.name))
        self.open = False
        self._new_session()
        trip = self._window.trip
        patience = trip.timeout
        while (now := self.transport.now()) < deadline:
            self._say_hello(now)
            await self.wait(min(deadline, now + patience), lambda: self._greeting is not None)
            reply = self._greeting
            if reply is None:
                patience = trip.longer(patience)
                continue
            if reply.id == messages.ERROR:
                if reply["error"] != OVERTAKEN:
                    raise errors.refused_hello(reply)
                self._new_session()
                continue
            low, high = reply["protocol_min"], reply["protocol_max"]
            if high < PROTOCOL_MIN or low > PROTOCOL_MAX:
                raise WrongDevice(errors.version(low, high))
            self._begin(reply)
            if self.transport.blocks and not self._background:
                self._background = keepalive.start(self, self._event_loop)
            return reply
        raise DeviceSilent("")

    def _new_session(self) -> None:
        if self.transport.blocks:
            self._session = secrets.randbits(32) or 1
        else:  # the same run twice gives the same bytes
            self._session = crc32(struct.pack("<dH", self.transport.now(), self._hello)) or 1
        self._hellos.clear()

    def _say_hello(self, now: float) -> None:
        self._hello = self._hello + 1 & 0xFFFF
        if self.open:
            self._hellos.clear()  # an answer to an earlier one may be of an earlier boot
        self._hellos[self._hello] = now
        self._greeting = None
        self._asked_at = now
        # The zero ends whatever half frame stands on the line.
        self._write(b"\0" + encode("HELLO", self._hello, (PROTOCOL_MIN, PROTOCOL_MAX, self._session)), now)

    def _greeted(self, message: Message) -> None:
        """A reply to HELLO, or its refusal: what opening waits for, or whether the device still is the same."""
        sent_at = self._hellos.get(message.sequence)
        if sent_at is None:
            return
        self._window.trip.measured(self.transport.now() - sent_at)
        if not self.open:
            self._greeting = message
        elif message.id == messages.ERROR:
            self.open = False
            self._window.end(lambda request: errors.taken(request, self.transport.name))
        elif message["boot_id"] != self._boot_id:
            self._begin(message)

    def _begin(self, reply: Message) -> None:
        if self._boot_id not in (None, reply["boot_id"]):
            asked, self.restart_asked = self.restart_asked, False
            self._window.end(lambda request: errors.restarted(request, self.transport.name), waiting=not asked)
        self._boot_id = reply["boot_id"]
        key = session_key(reply["boot_id"], self._session)
        self._window.begin(key, max(1, reply["window"]))
        self._reader.use(key)
        self._pings.forget()
        self.open = True
        if self.on_open:
            self.on_open(reply)

    # What happened to a request.

    def _outcome(self, request: Request) -> Message:
        if request.error:
            raise request.error
        reply = request.reply
        if reply is None:
            raise self._silence(request)
        if reply.id == messages.ERROR:
            kind = Overtaken if reply["error"] == OVERTAKEN else DeviceRefused
            raise kind(describe_refusal(reply))
        return reply

    def _silence(self, request: Request) -> LinkError:
        """Its deadline has passed. What was sent in this session and not answered must never be applied after this."""
        self.open = False
        self._window.end(lambda other: errors.abandoned(other, self.transport.name))
        if self._gone:
            return errors.lost(request, self._gone)
        return errors.silent(request, self.transport.name)

    # Keeping it alive.

    def service(self, now: float) -> None:
        """Send what is due: new requests, those that have not been answered, PING when nothing else was sent."""
        if (self._gone and not self._reopen(now)) or not self.open:
            return
        late = self._window.expired(now)
        if late:
            late.error = self._silence(late)
            return
        data = self._window.outgoing(now)
        if data:
            self._write(data, now)
        lost = self._window.overdue or self._pings.unanswered > _UNANSWERED
        if lost and now - self._asked_at >= self._window.trip.timeout:  # is it still the same?
            self._say_hello(now)
        if now >= self._sent_at + self._quiet:
            self._send_ping(0, now)

    def _due(self) -> float:
        """When `service` has something to do."""
        if self._gone:
            return self.transport.now() + _SLICE
        return min(self._window.due(), self._sent_at + self._quiet) if self.open else float("inf")

    @property
    def _quiet(self) -> float:
        """KEEP_ALIVE, less a few ms that differ: pings in step with the device's ticks would tell the clock the same again."""
        return KEEP_ALIVE - self._pings.number % 7 * 1.3e-3

    def tend(self) -> None:
        """What the thread that keeps the link alive does between calls; and take the reply to a PING when it comes."""
        now = self.transport.now()
        self.service(now)
        if self._pings.waiting:
            run_sync(self.wait(now + _SLICE, lambda: not self._pings.waiting))
        run_sync(self.wait(now + max(0.001, self.transport.behind)))

    def next_beat(self) -> float:
        """Seconds until `tend` is wanted."""
        return min(max(self._due() - self.transport.now(), 0.005), KEEP_ALIVE / 2)

    def _send_ping(self, token: int, now: float) -> None:
        self._write(self._pings.frame(token, now, self._window.key), now)

    async def _call_ping(self, request: Request) -> Message:
        """PING has no place among the other requests: it changes nothing and is answered at once."""
        await self._ready(request)
        while (now := self.transport.now()) < request.deadline and self.open:
            self._send_ping(request.fixed[0], now)
            request.sends += 1
            number = self._pings.number
            until = min(request.deadline, now + self._window.trip.timeout)
            await self.wait(until, lambda n=number: self._pings.answer(n) is not None)  # type: ignore[misc]
            if reply := self._pings.answer(number):
                return reply
            if request.sends >= 2:
                self._say_hello(now)
        raise self._silence(request)

    # Bytes.

    def _take(self, data: bytes) -> None:
        self._heard = self._heard or bool(data)
        now = self.transport.now()
        for message in self._reader.feed(data):
            self._ticks.unwrap(message)
            what = message["request"] if message.id == messages.ERROR else message.id & ~messages.REPLY
            if message.id in UNASKED:
                self.telemetry.append(message)
            elif message.id == messages.SEQUENCE_EVENT:
                self.events.append(message)
            elif message.id < messages.REPLY and message.id != messages.ERROR:
                continue  # an echo
            elif what == messages.HELLO:
                self._greeted(message)
            elif what == messages.PING:
                self._answered(message, now)
            elif self.open:
                self._window.settle(message, now)

    def _answered(self, message: Message, now: float) -> None:
        """A reply to a PING."""
        sent_at = self._pings.settle(message)
        if sent_at is not None:
            self._window.trip.measured(now - sent_at)
            if self.on_ping:
                self.on_ping(sent_at, message, now)

    def _write(self, data: bytes, now: float) -> None:
        self._sent_at = now
        if self._gone:
            return
        try:
            self.transport.write(data)
        except LinkError as problem:
            self._lose(problem)

    def _lose(self, problem: LinkError) -> None:
        """The port has gone. A session that was open may go on when it comes back."""
        if self.closed or self._boot_id is None or not self.transport.reopens:
            raise problem
        self._gone = problem

    def _reopen(self, now: float) -> bool:
        try:
            self.transport.reopen()
        except LinkError:
            return False
        self._gone = None
        self._reader.reset()
        self._say_hello(now)  # is it still the same?
        self._window.hurry(now)
        return True

    async def _receive(self, timeout: float) -> None:
        """Take what comes within `timeout`; with an event loop, within a slice of it."""
        try:
            if self._gone:
                await self._pause(min(timeout, _SLICE))
            elif not self._event_loop:
                self._take(self.transport.read(timeout))
            elif not self.transport.blocks:
                self._take(self.transport.read(min(timeout, _SLICE)))
                await asyncio.sleep(0)
            else:
                await self._receive_beside(timeout)
        except LinkError as problem:
            self._lose(problem)

    async def _pause(self, seconds: float) -> None:
        if self._event_loop:
            await asyncio.sleep(seconds)
        else:
            time.sleep(seconds)

    async def _receive_beside(self, timeout: float) -> None:
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


def run_sync(coroutine: Coroutine[Any, Any, _T]) -> _T:
    """Run a coroutine that never suspends, as all of a `Link` without an event loop are."""
    try:
        coroutine.send(None)
    except StopIteration as finished:
        return finished.value
    coroutine.close()
    raise RuntimeError("a coroutine of the synchronous link has suspended")
