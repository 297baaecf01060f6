"""Files that are made of a recording while the page goes on: Parquet, GIF, MP4."""

import asyncio
import contextlib
import importlib.util
import shutil
from collections.abc import Sequence
from pathlib import Path

from bubbleskin.device.state import State
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.files import guarded
from bubbleskin.layout import Layout
from bubbleskin.telemetry.recording import to_parquet

FILM_S = 30.0
"""Seconds of a film at most: all its pictures are in memory until it is written."""
LEAST_FILM_S = 0.2
FILMS = ("gif", "mp4")
KINDS = {"parquet": "Parquet", "gif": "GIF", "mp4": "MP4"}
"""What can be made, and what it is called."""


def lacks(kind: str) -> str:
    """What is missing here for files of this kind, as a sentence; nothing where it can be made."""
    if kind == "parquet" and importlib.util.find_spec("pyarrow") is None:
        return "Parquet needs pyarrow: `pip install 'bubbleskin[parquet]'`."
    if kind == "mp4" and shutil.which("ffmpeg") is None:
        return "MP4 needs the program ffmpeg, which is not here."
    return ""


class _CancelledError(Exception):
    """Nobody wants it any more."""


class Export:
    """One file of a recording: made in a thread, so that pages and wristband go on; `share` tells how far it is."""

    def __init__(self, kind: str, source: Path, path: Path, title: str):
        self.kind = kind
        self.path = path
        self.share = 0.0
        """Of 1."""
        self.problem = ""
        self._source = source
        self._title = title
        self._cancelled = False
        self._work: asyncio.Task[None] | None = None

    @property
    def works(self) -> bool:
        """Whether it is being made."""
        return self._work is not None and not self._work.done()

    @property
    def ready(self) -> bool:
        """Whether it is whole."""
        return self._work is not None and self._work.done() and not self.problem and not self._cancelled

    def begin(self, layout: Layout, states: Sequence[State]) -> None:
        """Make it, of `states` where it is a film."""
        self._work = asyncio.create_task(self._make(layout, list(states)))

    def cancel(self) -> None:
        """End it soon, and leave no file."""
        self._cancelled = True

    async def ended(self) -> None:
        """Wait until it is made, or cancelled."""
        if self._work:
            await self._work

    async def _make(self, layout: Layout, states: list[State]) -> None:
        try:
            await asyncio.to_thread(self._write, layout, states)
        except _CancelledError:
            pass
        except BubbleskinError as error:
            self.problem = str(error)
        if self._cancelled or self.problem:
            with contextlib.suppress(OSError):
                self.path.unlink(missing_ok=True)

    def _write(self, layout: Layout, states: list[State]) -> None:
        if missing := lacks(self.kind):
            raise InvalidInput(missing)
        if self.kind == "parquet":
            with guarded(self.path, "the recording"):
                to_parquet(self._source, self.path)
            return
        from bubbleskin.plot.sequence import animate, of_states

        frames = of_states(layout, states, seconds=FILM_S)

        def tell(done: int) -> None:
            if self._cancelled:
                raise _CancelledError
            self.share = done / len(frames)

        animate(layout, frames, self.path, title=self._title, progress=tell)
