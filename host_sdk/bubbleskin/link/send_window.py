"""Requests of one session: their numbers, a window of them under way, and when to send again. No I/O, no clock."""

import logging
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from bubble_protocol import codec
from bubble_protocol.frame import NO_KEY
from bubble_protocol.schema import messages, system
from bubbleskin.checks import shown
from bubbleskin.errors import BubbleskinError, InvalidInput, Overtaken
from bubbleskin.link.framing import FRAME_CONTENT
from bubbleskin.link.message import Message, numbered, pack
from bubbleskin.link.rtt import RttEstimator

_log = logging.getLogger(__name__)

URGENT = ("STOP", "VENT")
BYTES = 512
"""Bytes in flight at most, beside one request: a VENT sent now waits no longer than these take to be read."""
LOST = 3
"""Times that a request is sent before the device is asked whether it still is the same."""


@dataclass(eq=False, slots=True)
class Request:
    """One request, from the call to its answer. All times are in s, on the transport's clock.

    `name`, `fixed` and `repeated` are those of `bubbleskin.link.message.encode`. `deadline`: when the caller gives up, after
    `allowed` seconds.
    """

    name: str
    fixed: Sequence[int]
    repeated: Sequence[Sequence[int]]
    deadline: float
    allowed: float
    number: int = -1
    """Counts on without end; on the wire modulo 65536. -1: not sent."""
    frame: bytes = b""
    sends: int = 0
    """How often it has been sent."""
    sent: float = 0.0
    """When it was sent first."""
    resent: float = 0.0
    """When it was sent last."""
    due: float = 0.0
    """When it is sent again."""
    patience: float = 0.0
    """Seconds from `resent` to `due`."""
    reply: Message | None = None
    error: BubbleskinError | None = None
    id: int = field(init=False)
    content: bytes = field(init=False)
    """Packed before it has a place or a number: what cannot be packed is refused, and nothing else hears of it."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or self.name not in codec.BY_NAME:
            raise InvalidInput(f"There is no request {shown(self.name)}; they stand in the protocol's page.")
        self.id = codec.BY_NAME[self.name].id
        self.content = pack(self.name, 0, self.fixed, self.repeated)
        if len(self.content) > FRAME_CONTENT:
            raise InvalidInput(
                f"{self.name} with {len(self.repeated)} rows has {len(self.content)} bytes; a frame takes {FRAME_CONTENT}."
            )

    @property
    def done(self) -> bool:
        """Whether it is answered, or never will be."""
        return self.reply is not None or self.error is not None

    @property
    def urgent(self) -> bool:
        """Whether it overtakes all others."""
        return self.name in URGENT


class SendWindow:
    """The requests that wait and those under way. `rtt` learns from their answers how long those take."""

    def __init__(self, rtt: RttEstimator) -> None:
        self.size = 1
        """How many requests the device takes at once."""
        self.key = NO_KEY
        """What the CRCs of the open session's frames are mixed with."""
        self.next_number = 1
        """Of the next request."""
        self._rtt = rtt
        self._waiting: deque[Request] = deque()
        self._flight: dict[int, Request] = {}  # by the number on the wire, oldest first

    def begin(self, key: bytes, size: int) -> None:
        """A new session: numbers begin anew. Nothing may be in flight; what waits goes on waiting."""
        assert not self._flight
        self.key, self.size, self.next_number = key, size, 1

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
                    request.patience = self._rtt.backoff(request.patience)
                frames.append(self._send(request, now))
        while self._waiting and self._has_room(self._waiting[0]):
            request = self._waiting.popleft()
            request.number = self.next_number
            self.next_number += 1
            sequence = request.number & 0xFFFF
            request.frame = numbered(request.content, sequence, self.key)
            request.sent = now
            request.patience = self._rtt.timeout
            self._flight[sequence] = request
            frames.append(self._send(request, now))
        return b"".join(frames)

    def due(self) -> float:
        """When the next request is sent again."""
        soonest = math.inf
        for request in self._flight.values():
            soonest = min(soonest, request.due)
        return soonest

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
        for request in self._flight.values():
            if request.deadline <= now:
                return request
        return None

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
            self._rtt.update(now - request.sent)
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
        ahead = self.next_number - self._oldest().number
        if request.urgent:
            return ahead < system.REPLIES_KEPT
        return ahead < self.size and sum(len(other.frame) for other in self._flight.values()) < BYTES

    def _send(self, request: Request, now: float) -> bytes:
        request.sends += 1
        request.resent = now
        request.due = now + request.patience
        if request.sends > 1:
            _log.info("%s %d is sent again, %d times so far", request.name, request.number & 0xFFFF, request.sends)
        if _log.isEnabledFor(logging.DEBUG):
            _log.debug("sent %s %d, %d bytes", request.name, request.number & 0xFFFF, len(request.frame))
        return request.frame
