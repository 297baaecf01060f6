"""A transport as the link uses it: read with and without an event loop, lost and found again."""

import asyncio
import contextlib
import logging
import time
import weakref
from collections.abc import Callable

from bubbleskin.errors import LinkError
from bubbleskin.link.transport import Transport

_log = logging.getLogger(__name__)

SLICE = 0.02
"""Seconds for which one task reads before another has its turn; and between two attempts to open a lost port."""


class Line:
    """Bytes to and from `transport`; the method `take(data)` is called with all that comes.

    Without an event loop the transport is read in place and nothing here suspends. With one, other tasks have their
    turn while this one waits: for the transport's descriptor, or, where a transport that waits by the wall clock has none, for
    a thread that reads it, which costs as much as a round trip.
    """

    def __init__(self, transport: Transport, take: Callable[[bytes], None], *, event_loop: bool):
        self.transport = transport
        self.lost: LinkError | None = None
        """Why the port has gone; None while it is there."""
        self.keep = False
        """Whether a port that goes is waited for; otherwise its error is raised."""
        self._taker = weakref.WeakMethod(
            take
        )  # no circle: a link that nobody holds is gone at once, and its port with it
        self._event_loop = event_loop
        self._reading = asyncio.Lock()
        self._thread: asyncio.Future[None] | None = None
        self._watched: tuple[asyncio.AbstractEventLoop, int] | None = None
        self._waiting: set[asyncio.Future[None]] = set()  # for the descriptor that is watched

    def write(self, data: bytes) -> None:
        """Send `data`; nothing while the port has gone."""
        if self.lost:
            return
        try:
            self.transport.write(data)
        except LinkError as problem:
            self._lose(problem)

    def reopen(self) -> bool:
        """Try to open a port that has gone; whether it is back."""
        try:
            self.transport.reopen()
        except LinkError:
            return False
        self.lost = None
        _log.info("%s is back", self.transport.name)
        return True

    async def receive(self, timeout: Callable[[], float], done: Callable[[], bool]) -> None:
        """Take what comes within `timeout()` seconds, with an event loop within a slice of them; not if `done()`.

        Both are asked once it is this task's turn to read.
        """
        if not self._event_loop:  # no other task has a turn that could have to be waited for
            self._receive_in_place(max(timeout(), 0.0))
            return
        descriptor = None if self.lost else self.transport.descriptor
        if descriptor is not None:
            if not done():
                await self._receive_when_there(descriptor, min(max(timeout(), 0.0), SLICE))
            return
        async with self._reading:
            if done():
                return
            seconds = min(max(timeout(), 0.0), SLICE)
            try:
                if self.lost:
                    await asyncio.sleep(seconds)
                elif self.transport.blocks:
                    await self._receive_beside(seconds)
                else:
                    self._take(self.transport.read(seconds))
                    await asyncio.sleep(0)
            except LinkError as problem:
                self._lose(problem)

    async def settle(self) -> None:
        """Wait for nothing more, but for a thread that still reads: a port must not close under its reader."""
        self._watch_no_more()
        if self._thread:
            with contextlib.suppress(LinkError):
                await asyncio.shield(self._thread)

    def _lose(self, problem: LinkError) -> None:
        if not (self.keep and self.transport.reopens):
            raise problem
        self._watch_no_more()  # before the port is closed, and its number is another file's
        self.lost = problem
        _log.info("%s is lost and waited for: %s", self.transport.name, problem)

    def _take(self, data: bytes) -> None:
        if take := self._taker():
            take(data)

    def _receive_in_place(self, seconds: float) -> None:
        if self.lost:
            time.sleep(min(seconds, SLICE))
            return
        try:
            self._take(self.transport.read(seconds))
        except LinkError as problem:
            self._lose(problem)

    async def _receive_when_there(self, descriptor: int, timeout: float) -> None:
        """Wait until something has come, for whomever it is: all who wait are told, and look whether it was theirs."""
        loop = asyncio.get_running_loop()
        if not self._watched:
            self._watched = loop, descriptor
            loop.add_reader(descriptor, self._read_what_is_there)
        there: asyncio.Future[None] = loop.create_future()
        self._waiting.add(there)
        late = loop.call_later(timeout, _tell, there)
        try:
            await there
        finally:
            late.cancel()
            self._waiting.discard(there)
            if not self._waiting:
                self._watch_no_more()

    def _read_what_is_there(self) -> None:
        try:
            try:
                self._take(self.transport.read(0.0))
            except LinkError as problem:
                self._lose(problem)
        except Exception as problem:  # who waits raises it: nobody calls this but the event loop
            self._watch_no_more(problem)
        else:
            for there in self._waiting:
                _tell(there)

    def _watch_no_more(self, problem: Exception | None = None) -> None:
        """Watch the descriptor no longer; who waits goes on, or raises `problem`."""
        if self._watched:
            loop, descriptor = self._watched
            self._watched = None
            loop.remove_reader(descriptor)
        for there in self._waiting:
            _tell(there, problem)

    async def _receive_beside(self, timeout: float) -> None:
        # A cancelled wait must not lose what the thread is about to read: it goes on, and takes it.
        if self._thread is None:
            self._thread = asyncio.ensure_future(self._receive_in_thread(timeout))
        thread = self._thread
        try:
            await asyncio.shield(thread)
        finally:
            if thread.done():
                self._thread = None

    async def _receive_in_thread(self, timeout: float) -> None:
        self._take(await asyncio.to_thread(self.transport.read, timeout))


def _tell(there: "asyncio.Future[None]", problem: Exception | None = None) -> None:
    if there.done():
        return
    if problem:
        there.set_exception(problem)
    else:
        there.set_result(None)
