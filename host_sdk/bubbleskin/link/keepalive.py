"""What keeps a link alive while nobody calls: a thread, or a task of the event loop. It ends with the link."""

import asyncio
import contextlib
import threading
import weakref
from typing import TYPE_CHECKING

from bubbleskin.errors import LinkError

if TYPE_CHECKING:
    from bubbleskin.link.link import Link

_RETRY = 0.1


class Background:
    """A thread or a task that keeps a link alive."""

    def __init__(self, task: "asyncio.Task[None] | None" = None, halt: threading.Event | None = None):
        self._task = task
        self._halt = halt

    async def end(self) -> None:
        """Keep alive no longer."""
        if self._halt:
            self._halt.set()
        if self._task and self._task is not asyncio.current_task():
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task


def start(link: "Link", event_loop: bool) -> Background:
    """Keep `link` alive from now on."""
    if event_loop:
        return Background(task=asyncio.get_running_loop().create_task(_listen(link)))
    halt = threading.Event()
    # A link that nobody holds any more is not kept alive, nor kept.
    threading.Thread(target=_beat, args=(weakref.ref(link), halt), name="bubbleskin keep-alive", daemon=True).start()
    return Background(halt=halt)


def _beat(reference: "weakref.ref[Link]", halt: threading.Event) -> None:
    pause = _RETRY
    while not halt.wait(pause):
        link = reference()
        if link is None or link.closed:
            return
        pause = 0.01
        if link.guard.acquire(blocking=False):  # during a call the call itself keeps the link alive
            try:
                with contextlib.suppress(LinkError):
                    if not link.closed:
                        link.tend()
                pause = link.next_beat()
            finally:
                link.guard.release()
        del link


async def _listen(link: "Link") -> None:
    while not link.closed:
        with contextlib.suppress(LinkError):
            await link.wait(float("inf"))
        await asyncio.sleep(_RETRY)
