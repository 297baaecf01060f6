"""What keeps a link alive while nobody calls: PINGs, and a thread or a task that sends them. It ends with the link."""

import asyncio
import contextlib
import logging
import threading
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from bubble_protocol.schema import messages
from bubbleskin.errors import LinkError
from bubbleskin.link.message import Message, encode

_log = logging.getLogger(__name__)

KEEP_ALIVE = 0.1
"""Seconds without anything sent after which the device hears a PING."""

_UNANSWERED = 3
"""PINGs in a row without a reply after which the device may have restarted."""
_REMEMBERED = 16
"""PINGs whose replies are waited for, and replies that wait for whoever asked, at most."""
_STAGGER_S = 1.3e-3
"""PINGs in step with the device's ticks would tell the clock the same again: they differ by multiples of this."""
_FIRST_S = 0.1
"""Seconds after which the thread, or the task after an error, looks at the link."""
_PAUSE_S = 0.01
"""Seconds between two looks while a call has the link, and keeps it alive by itself."""


class Pings:
    """The PINGs that have been sent and not been answered yet. PING has no turn among the requests. No I/O, no clock."""

    def __init__(self) -> None:
        self.number = 0
        """Of the last one sent."""
        self._unanswered = 0  # how many have been sent since one was answered
        self._sent: dict[int, float] = {}  # when, by number
        self._answers: dict[int, Message] = {}

    @property
    def waiting(self) -> bool:
        """Whether the last one has not been answered."""
        return self.number in self._sent

    @property
    def overdue(self) -> bool:
        """Whether so many have not been answered that the device may have restarted."""
        return self._unanswered > _UNANSWERED

    @property
    def quiet(self) -> float:
        """Seconds without anything sent after which the next one is due: up to 8 ms less than `KEEP_ALIVE`."""
        return KEEP_ALIVE - self.number % 7 * _STAGGER_S

    def answer(self, number: int) -> Message | None:
        """The reply to PING `number`, where it has come."""
        return self._answers.get(number)

    def forget(self) -> None:
        """A new session: what was sent before is not answered any more."""
        self._unanswered = 0
        self._sent.clear()
        self._answers.clear()

    def frame(self, token: int, now: float, key: bytes) -> bytes:
        """One more, to be sent at `now`, s."""
        self.number = self.number + 1 & 0xFFFF
        if len(self._sent) > _REMEMBERED:
            self._sent.clear()
        self._sent[self.number] = now
        self._unanswered += 1
        frame = encode("PING", self.number, (token,), key=key)
        if _log.isEnabledFor(logging.DEBUG):
            _log.debug("sent PING %d, %d bytes", self.number, len(frame))
        return frame

    def settle(self, message: Message) -> float | None:
        """When the PING was sent that this replies to, s; None where there is none."""
        sent_at = self._sent.pop(message.sequence, None)
        if sent_at is None or message.id != messages.PING | messages.REPLY:
            return None
        self._unanswered = 0
        if len(self._answers) > _REMEMBERED:
            self._answers.clear()
        self._answers[message.sequence] = message
        return sent_at


class Serviced(ABC):
    """What is kept alive: a link, as the thread or task sees it."""

    closed: bool
    guard: Any
    """A lock that whoever uses the link holds."""

    @abstractmethod
    def service_idle(self) -> None:
        """Send what is due, and take what has come, while nobody calls."""

    @abstractmethod
    def next_wakeup(self) -> float:
        """Seconds until `service_idle` is wanted."""

    @abstractmethod
    async def wait(self, until: float, done: Callable[[], bool] = lambda: False) -> None:
        """Take what comes and send what is due until `done()`, or the transport's clock stands at `until`, s."""


class Keeper(ABC):
    """A thread or a task that keeps a link alive."""

    @abstractmethod
    async def end(self) -> None:
        """Keep alive no longer."""


class ThreadKeeper(Keeper):
    """A thread, for a script without an event loop. A link that nobody holds any more is not kept alive, nor kept."""

    def __init__(self, link: Serviced):
        self._halt = threading.Event()
        threading.Thread(
            target=_keep, args=(weakref.ref(link), self._halt), name="bubbleskin keep-alive", daemon=True
        ).start()

    async def end(self) -> None:
        """Keep alive no longer."""
        self._halt.set()


def _keep(reference: "weakref.ref[Serviced]", halt: threading.Event) -> None:
    pause = _FIRST_S
    while not halt.wait(pause):
        link = reference()
        if link is None or link.closed:
            return
        pause = _PAUSE_S
        if link.guard.acquire(blocking=False):  # during a call the call itself keeps the link alive
            try:
                with contextlib.suppress(LinkError):
                    if not link.closed:
                        link.service_idle()
                pause = link.next_wakeup()
            finally:
                link.guard.release()
        del link


class TaskKeeper(Keeper):
    """A task of the event loop that runs."""

    def __init__(self, link: Serviced):
        self._task = asyncio.get_running_loop().create_task(self._listen(link))

    @staticmethod
    async def _listen(link: Serviced) -> None:
        while not link.closed:
            with contextlib.suppress(LinkError):
                await link.wait(float("inf"))
            await asyncio.sleep(_FIRST_S)

    async def end(self) -> None:
        """Keep alive no longer."""
        if self._task is not asyncio.current_task():
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
