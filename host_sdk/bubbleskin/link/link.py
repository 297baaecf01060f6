"""The link to one device: each request is applied once and answered, or its caller is told that it was not."""

import asyncio
import contextlib
import logging
import math
import threading
import warnings
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TypeVar

from bubble_protocol.schema import messages
from bubble_protocol.schema.errors import OVERTAKEN
from bubbleskin.errors import DeviceRefused, DeviceSilent, LinkError, Overtaken
from bubbleskin.link import errors
from bubbleskin.link.clock import DeviceTicks
from bubbleskin.link.handshake import Handshake, is_accepted
from bubbleskin.link.keepalive import KEEP_ALIVE, Keeper, Pings, Serviced, TaskKeeper, ThreadKeeper
from bubbleskin.link.line import SLICE, Line
from bubbleskin.link.message import Message, name_of
from bubbleskin.link.process import Owner
from bubbleskin.link.reader import Reader
from bubbleskin.link.refusals import describe_refusal
from bubbleskin.link.rtt import RttEstimator
from bubbleskin.link.send_window import Request, SendWindow
from bubbleskin.link.telemetry_queue import UNASKED, TelemetryQueue
from bubbleskin.link.transport import Transport

_log = logging.getLogger(__name__)

_EVENTS = 4096
"""Events that wait at most: of more, the oldest are dropped."""
_PAUSE_S = 1.3e-3
"""Seconds between two PINGs of `send_pings`, and up to seven times that: not in step with the device's ticks."""
_SHORTEST_S = 5e-3
"""Least seconds between two looks at an idle link."""

_T = TypeVar("_T")
Call = tuple[str, Sequence[int], Sequence[Sequence[int]]]
"""A request: its name, its fixed fields, its repeated fields row by row."""


class Link(Serviced):
    """One device at the other end of `transport`, which answers every request within `timeout` s or is called silent.

    Everything is a coroutine. Without an event loop the transport is read in place and no coroutine ever
    suspends, so that `run_sync` can run it. With one, other tasks have their turn while this one waits: see `Line`.

    `on_open(reply)` is called with the reply to HELLO whenever a session has been opened, and
    `on_ping(sent_at, reply, received_at)` with every reply to a PING and the transport's time at both ends, s,
    from whatever thread or task reads.
    """

    def __init__(self, transport: Transport, timeout: float, *, event_loop: bool = False):
        self.transport = transport
        self.timeout = timeout
        self.telemetry = TelemetryQueue()
        self.events: deque[Message] = deque(maxlen=_EVENTS)
        """What has happened to a sequence, as the device told it."""
        self.on_open: Callable[[Message], None] | None = None
        self.on_ping: Callable[[float, Message, float], None] | None = None
        self.restart_asked = False
        """A restart that was asked for is not told as one that was not."""
        self.closed = False
        self.open = False
        self.warns = False
        """Whether it says so when nobody holds it any more and nobody has closed it."""
        # Threads of a script take turns, and the one that keeps the link alive has its own between calls. Tasks need none.
        self.guard: Any = contextlib.nullcontext() if event_loop else threading.RLock()
        self.event_loop = event_loop
        self._rtt = RttEstimator()
        self.window = SendWindow(self._rtt)
        """The requests that wait and those under way, for those who test the link."""
        self._handshake = Handshake()
        self._pings = Pings()
        self._reader = Reader()
        self._ticks = DeviceTicks()
        self._line = Line(transport, self._take, event_loop=event_loop)
        self._heard = False  # whether anything has come at all
        self._sent_at = 0.0
        self._opening = asyncio.Lock()
        self._keeper: Keeper | None = None
        self._owner = Owner(transport)

    def __del__(self) -> None:
        if getattr(self, "warns", False) and self.open and not self._owner.left_behind:
            warnings.warn(
                f"{self.transport.name} was not closed; use it in a with block.", ResourceWarning, stacklevel=2
            )
            with contextlib.suppress(Exception):
                self.transport.close()

    @property
    def session(self) -> int:
        """The number of the session that is open, or was last."""
        return self._handshake.session

    # Requests.

    async def hello(self) -> Message:
        """Open a session. `WrongDevice` where there is no wristband, or one we cannot talk to."""
        self._owner.check()
        with self.guard:
            try:
                return await self._open(self.transport.now() + self.timeout)
            except DeviceSilent:
                raise errors.no_wristband(self.transport.name, self.timeout, self._heard) from None
            except LinkError as problem:
                raise errors.turned_away(problem, self.transport.name, self._reader.said) from None

    async def call(
        self, name: str, fixed: Sequence[int] = (), repeated: Sequence[Sequence[int]] = (), timeout: float | None = None
    ) -> Message:
        """Send a request and wait for its reply; see `calls`."""
        (reply,) = await self.calls([(name, fixed, repeated)], timeout)
        return reply

    async def calls(self, calls: Sequence[Call], timeout: float | None = None) -> list[Message]:
        """Send requests, as many at once as the device takes, and wait for all replies.

        They are applied in this order, each once. `DeviceRefused` where one is refused, `Overtaken` where STOP
        or VENT came first, and a `LinkError` where there is no reply within `timeout` s: its `outcome_unknown` says
        whether the request may have been applied. `DeviceRestarted` where the device has forgotten everything.
        Where several have failed, the first one's error is raised.
        """
        self._owner.check()
        with self.guard:
            patience = self.timeout if timeout is None else timeout
            deadline = self.transport.now() + patience
            requests = [Request(*call, deadline, patience) for call in calls]
            if requests[0].name == "PING":
                return [await self._call_ping(request) for request in requests]
            try:
                for request in requests:
                    self.window.submit(request)
                left = requests[:]
                while not _all_done(left) and self.transport.now() < deadline:
                    if not self.open:  # for the first time, or another call's silence has ended the session
                        await self._ready(left[-1])
                    await self.wait(deadline, lambda: _all_done(left) or not self.open)
            finally:
                for request in requests:
                    if not request.done:
                        self.window.withdraw(request)
            return [self._outcome(request) for request in requests]

    def post(self, name: str, fixed: Sequence[int]) -> None:
        """Send a request that nobody waits for; it ends with the session."""
        self.window.submit(Request(name, fixed, (), math.inf, self.timeout))

    async def send_pings(self, count: int) -> None:
        """Send so many PINGs one after another; `on_ping` hears of each reply."""
        for number in range(count):
            await self.call("PING", (number,))
            await self.wait(self.transport.now() + _PAUSE_S * (1 + number % 7))

    async def wait(self, until: float, done: Callable[[], bool] = lambda: False) -> None:
        """Take what comes until `done()`, or the transport's clock stands at `until`, s; keep the link alive meanwhile."""
        self._owner.check()
        with self.guard:
            while not done() and (now := self.transport.now()) < until:
                self._service(now)
                await self._line.receive(lambda: min(until, self._due()) - self.transport.now(), done)

    async def close(self) -> None:
        """Let go of the transport."""
        self.closed = True
        self.open = False
        if self._owner.left_behind:
            return
        self._line.keep = False
        try:
            if self._keeper:
                await self._keeper.end()
            await self._line.settle()
        finally:
            with self.guard:
                self.transport.close()

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
        self.window.end(lambda other: errors.abandoned(other, self.transport.name))
        if self._line.lost:
            return errors.lost(request, self._line.lost)
        return errors.silent(request, self.transport.name)

    async def _call_ping(self, request: Request) -> Message:
        """PING has no place among the other requests: it changes nothing and is answered at once."""
        if not self.open:
            await self._ready(request)
        while (now := self.transport.now()) < request.deadline and self.open:
            self._send_ping(request.fixed[0], now)
            request.sends += 1
            number = self._pings.number
            until = min(request.deadline, now + self._rtt.timeout)
            await self.wait(until, lambda n=number: self._pings.answer(n) is not None)  # type: ignore[misc]
            if reply := self._pings.answer(number):
                return reply
            if request.sends >= 2:
                self._say_hello(now)
        raise self._silence(request)

    # A session.

    async def _ready(self, request: Request) -> None:
        """Open a session, unless another task does."""
        if self.closed:
            self.transport.read(0.0)  # says so
        async with self._opening:
            while not self.open and not request.done:
                try:
                    await self._open(request.deadline)
                except DeviceSilent:
                    raise self._silence(request) from None

    async def _open(self, deadline: float) -> Message:
        self.window.end(lambda request: errors.abandoned(request, self.transport.name))
        self.open = False
        self._new_session()
        patience = self._rtt.timeout
        while (now := self.transport.now()) < deadline:
            self._say_hello(now)
            await self.wait(min(deadline, now + patience), lambda: self._handshake.reply is not None)
            reply = self._handshake.reply
            if reply is None:
                patience = self._rtt.backoff(patience)
            elif is_accepted(reply):
                self._begin(reply)
                if self.transport.blocks and not self._keeper:
                    self._keeper = TaskKeeper(self) if self.event_loop else ThreadKeeper(self)
                return reply
            else:
                self._new_session()
        raise DeviceSilent("")

    def _new_session(self) -> None:
        self._handshake.new_session(None if self.transport.blocks else self.transport.now())

    def _say_hello(self, now: float) -> None:
        self._write(self._handshake.hello(now, again=self.open), now)

    def _begin(self, reply: Message) -> None:
        if self._handshake.is_restart(reply):
            asked, self.restart_asked = self.restart_asked, False
            self.window.end(lambda request: errors.restarted(request, self.transport.name), waiting=not asked)
        key = self._handshake.began(reply)
        self.window.begin(key, max(1, reply["window"]))
        self._reader.use(key)
        self._pings.forget()
        self._line.keep = not self.closed  # the session may go on when a port that has gone comes back
        self.open = True
        if self.on_open:
            self.on_open(reply)

    # Keeping it alive.

    def _service(self, now: float) -> None:
        """Send what is due: new requests, those that have not been answered, PING when nothing else was sent."""
        if (self._line.lost and not self._reopen(now)) or not self.open:
            return
        late = self.window.expired(now)
        if late:
            late.error = self._silence(late)
            return
        data = self.window.outgoing(now)
        if data:
            self._write(data, now)
        lost = self.window.overdue or self._pings.overdue
        if lost and now - self._handshake.asked_at >= self._rtt.timeout:  # is it still the same?
            self._say_hello(now)
        if now >= self._sent_at + self._pings.quiet:
            self._send_ping(0, now)

    def _due(self) -> float:
        """When `_service` has something to do."""
        if self._line.lost:
            return self.transport.now() + SLICE
        return min(self.window.due(), self._sent_at + self._pings.quiet) if self.open else float("inf")

    def service_idle(self) -> None:
        """Send what is due while nobody calls; and take the reply to a PING when it comes."""
        now = self.transport.now()
        self._service(now)
        if self._pings.waiting:
            run_sync(self.wait(now + SLICE, lambda: not self._pings.waiting))
        run_sync(self.wait(now + max(0.001, self.transport.behind)))

    def next_wakeup(self) -> float:
        """Seconds until `service_idle` is wanted."""
        return min(max(self._due() - self.transport.now(), _SHORTEST_S), KEEP_ALIVE / 2)

    def _send_ping(self, token: int, now: float) -> None:
        self._write(self._pings.frame(token, now, self.window.key), now)

    def _reopen(self, now: float) -> bool:
        if not self._line.reopen():
            return False
        self._reader.reset()
        self._say_hello(now)  # is it still the same?
        self.window.hurry(now)
        return True

    # What comes and goes.

    def _write(self, data: bytes, now: float) -> None:
        self._sent_at = now
        self._line.write(data)

    def _take(self, data: bytes) -> None:
        if not data:
            return
        self._heard = True
        now = self.transport.now()
        debug = _log.isEnabledFor(logging.DEBUG)
        for message in self._reader.feed(data):
            if debug:
                size = self._reader.frame_size
                _log.debug("received %s %d, %d bytes", name_of(message.id), message.sequence, size)
            self._ticks.unwrap(message)
            self._dispatch(message, now)

    def _dispatch(self, message: Message, now: float) -> None:
        """Give a message to whoever waits for it; what is none of theirs is dropped."""
        if message.id in UNASKED:
            self.telemetry.append(message)
            return
        if message.id == messages.SEQUENCE_EVENT:
            self.events.append(message)
            return
        if message.id < messages.REPLY and message.id != messages.ERROR:
            return  # an echo
        request = message["request"] if message.id == messages.ERROR else message.id & ~messages.REPLY
        if request == messages.HELLO:
            self._greeted(message, now)
        elif request == messages.PING:
            self._answered(message, now)
        elif self.open:
            self.window.settle(message, now)

    def _greeted(self, message: Message, now: float) -> None:
        """A reply to HELLO, or its refusal: what opening waits for, or whether the device still is the same."""
        sent_at = self._handshake.sent_at(message)
        if sent_at is None:
            return
        self._rtt.update(now - sent_at)
        if not self.open:
            self._handshake.reply = message
        elif message.id == messages.ERROR:
            self.open = False
            self.window.end(lambda request: errors.taken(request, self.transport.name))
        elif self._handshake.is_restart(message):
            self._begin(message)

    def _answered(self, message: Message, now: float) -> None:
        """A reply to a PING."""
        sent_at = self._pings.settle(message)
        if sent_at is not None:
            self._rtt.update(now - sent_at)
            if self.on_ping:
                self.on_ping(sent_at, message, now)


def _all_done(left: list[Request]) -> bool:
    """Whether none of these waits for its answer any more; drops those at the end that do not."""
    while left and left[-1].done:
        left.pop()
    return not left


def run_sync(coroutine: Coroutine[Any, Any, _T]) -> _T:
    """Run a coroutine that never suspends, as all of a `Link` without an event loop are."""
    try:
        coroutine.send(None)
    except StopIteration as finished:
        return finished.value
    coroutine.close()
    raise RuntimeError("a coroutine of the synchronous link has suspended")
