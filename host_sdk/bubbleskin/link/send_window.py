"""Requests of one session: their numbers, a window of them under way, and when to send again. No I/O, no clock."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from bubble_protocol import codec
from bubble_protocol.frame import NO_KEY
from bubble_protocol.schema import messages
from bubbleskin.errors import BubbleskinError, Overtaken
from bubbleskin.link.message import Message, encode

URGENT = ("STOP", "VENT")
BYTES = 512
"""In flight at most, beside one request: a VENT sent now waits no longer than these take to be read."""
KEPT = 16
"""Replies that a device keeps: STOP and VENT may be so far ahead of the oldest request without an answer."""
LOST = 3
"""Times that a request is sent before the device is asked whether it still is the same."""


@dataclass(eq=False)
class Request:
    """One request, from the call to its answer. `deadline`: when the caller gives up, after `allowed` seconds."""

    name: str
    fixed: Sequence[int]
    repeated: Sequence[Sequence[int]]
    deadline: float
    allowed: float
    number: int = -1
    """Counts on without end; on the wire modulo 65536. -1: not sent."""
    frame: bytes = b""
    sends: int = 0
    sent: float = 0.0
    resent: float = 0.0
    due: float = 0.0
    """When it is sent again."""
    patience: float = 0.0
    reply: Message | None = None
    error: BubbleskinError | None = None
    id: int = field(init=False)

    def __post_init__(self) -> None:
        self.id = codec.BY_NAME[self.name].id

    @property
    def done(self) -> bool:
        """Whether it is answered, or never will be."""
        return self.reply is not None or self.error is not None

    @property
    def urgent(self) -> bool:
        """Whether it overtakes all others."""
        return self.name in URGENT


class RoundTrip:
    """How long to wait for an answer before sending again: RFC 6298, with Karn's rule. Seconds.

    Only answers to what was sent once, or that tell which sending they answer as those to PING and HELLO do, are
    measured; so waiting longer for one request says nothing of the next.
    """

    FIRST = 0.25
    FLOOR = 0.03
    MOST = 0.25

    def __init__(self) -> None:
        self.smoothed: float | None = None
        self.variation = 0.0

    @property
    def timeout(self) -> float:
        """For a request that is sent now."""
        if self.smoothed is None:
            return self.FIRST
        return max(self.FLOOR, self.smoothed + 4 * self.variation)

    def longer(self, patience: float) -> float:
        """How long to wait the next time, when nothing has come within `patience`."""
        return min(2 * patience, max(self.MOST, self.timeout))

    def measured(self, seconds: float) -> None:
        """An answer came after so long."""
        if self.smoothed is None:
            self.smoothed, self.variation = seconds, seconds / 2
        else:
            self.variation += (abs(self.smoothed - seconds) - self.variation) / 4
            self.smoothed += (seconds - self.smoothed) / 8


class Window:
    """The requests that wait and those under way. `size`: how many the device takes at once."""

    def __init__(self) -> None:
        self.trip = RoundTrip()
        self.size = 1
        self.key = NO_KEY
        self._next = 1
        self._waiting: deque[Request] = deque()
        self._flight: dict[int, Request] = {}  # by the number on the wire, oldest first

    def begin(self, key: bytes, size: int) -> None:
        """A new session: numbers begin anew. Nothing may be in flight; what waits goes on waiting."""
        assert not self._flight
        self.key, self.size, self._next = key, size, 1

    def submit(self, request: Request) -> None:
        """Take a request; it is sent when its turn comes. An urgent one ends all that wait."""
        if not request.urgent:
            self._waiting.append(request)
            return
        for other in [other for other in self._waiting if not other.urgent]:
            self._waiting.remove(other)
            other.error = Overtaken(f"{other.name} was overtaken by {request.name}; it was not applied.")
        self._waiting.append(request)

    def withdraw(self, request: Request) -> None:
        """Nobody waits for it any more: it is not sent, or, where it has been, kept going until it is answered."""
        if request in self._waiting:
            self._waiting.remove(request)

    def outgoing(self, now: float) -> bytes:
        """The frames to send now."""
        frames = []
        for request in self._flight.values():
            if request.due <= now:
                if now >= request.resent + request.patience:
                    request.patience = self.trip.longer(request.patience)
                frames.append(self._send(request, now))
        while self._waiting and self._has_room(self._waiting[0]):
            request = self._waiting.popleft()
            request.number = self._next
            self._next += 1
            sequence = request.number & 0xFFFF
            request.frame = encode(request.name, sequence, request.fixed, request.repeated, self.key)
            request.sent = now
            request.patience = self.trip.timeout
            self._flight[sequence] = request
            frames.append(self._send(request, now))
        return b"".join(frames)

    def due(self) -> float:
        """When the next request is sent again."""
        return min((request.due for request in self._flight.values()), default=math.inf)

    def hurry(self, now: float) -> None:
        """Send everything that is under way again at once, as after a reconnect."""
        for request in self._flight.values():
            request.due = now

    @property
    def overdue(self) -> bool:
        """Whether the oldest request has been sent again and again."""
        return bool(self._flight) and self._oldest().sends >= LOST

    def expired(self, now: float) -> Request | None:
        """A request that is under way and whose deadline has passed."""
        return next((request for request in self._flight.values() if request.deadline <= now), None)

    def settle(self, message: Message, now: float) -> None:
        """Give a reply or an error to its request; one that nobody waits for is dropped."""
        request = self._flight.get(message.sequence)
        if request is None:
            return
        if message.id == messages.ERROR:
            if message["request"] != request.id:
                return
        elif message.id != request.id | messages.REPLY:
            return
        del self._flight[message.sequence]
        if request.sends == 1:
            self.trip.measured(now - request.sent)
        request.reply = message
        # The device keeps the order: what is older has been answered too, or overtaken, and the answer got lost.
        for other in self._flight.values():
            if other.number < request.number and other.resent <= request.resent:
                other.due = now

    def end(self, reason: Callable[[Request], BubbleskinError], *, waiting: bool = False) -> None:
        """The session is over: everything in flight fails, and with `waiting` what has not been sent and is not urgent."""
        for request in self._flight.values():
            request.error = reason(request)
        self._flight.clear()
        if waiting:
            for request in [request for request in self._waiting if not request.urgent]:
                request.error = reason(request)
                self._waiting.remove(request)

    def _oldest(self) -> Request:
        return next(iter(self._flight.values()))

    def _has_room(self, request: Request) -> bool:
        if not self._flight:
            return True
        ahead = self._next - self._oldest().number
        if request.urgent:
            return ahead < KEPT
        return ahead < self.size and sum(len(other.frame) for other in self._flight.values()) < BYTES

    def _send(self, request: Request, now: float) -> bytes:
        request.sends += 1
        request.resent = now
        request.due = now + request.patience
        return request.frame
