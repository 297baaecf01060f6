"""The one owner of the wristband: pages send it intentions and get snapshots, and none of them ever holds the device."""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin import boards
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.connecting import SIMULATED, aconnect
from bubbleskin.device.health import Health
from bubbleskin.device.state import State
from bubbleskin.errors import BubbleskinError, InvalidInput, LinkError
from bubbleskin.sequence.model import Playable
from bubbleskin.sequence.playback import PlaybackStatus
from bubbleskin.surface.shows import STREAM_S
from bubbleskin.telemetry.fields import USUAL, most

RATE_HZ = 20.0
"""Snapshots a second."""
HISTORY_S = 20.0
"""Seconds of snapshots that a page is given when it is opened."""
GRACE_S = 3.0
"""Seconds without any page after which everything vents: a page that is reloaded is back sooner."""
_PACE = "realtime=1"
_RETRY_S = 1.0
_STREAM_S = 0.05
"""Of a change that is asked for at once: as long as the page takes for a tick."""
_CARE_S = 0.5
_ASKED_S = 0.1
"""Between two states of a wristband that is lent: its telemetry is then another's."""
_READ_S = 6.0
_LENT = "A calibration has the wristband; stop or vent ends it, and then it plays again."
_LATENCIES = 500


class Intention(NamedTuple):
    """Heights that somebody wants now, and when they did: seconds since 1970, 0 where nobody has measured it."""

    heights_mm: NDArray[np.float64]
    over: float
    stamp: float


def in_real_time(url: str) -> str:
    """`url`, where a simulated board keeps the wall clock's pace: people look at it."""
    if url.partition("://")[0].lower() not in SIMULATED or "realtime=" in url:
        return url
    return f"{url}{'&' if '?' in url else '?'}{_PACE}"


def as_asked(url: str) -> str:
    """`url` without the pace that `in_real_time` has given it."""
    return url.removesuffix(_PACE).rstrip("?&") if url.endswith(_PACE) else url


class Owner:
    """Holds the skin, follows its telemetry and sends it what pages want: of heights only the newest, stop and vent at once.

    All of it runs in one event loop. `attended()` tells whether any page is open.
    """

    def __init__(self, attended: Callable[[], bool] = lambda: True):
        self.skin: AsyncSkin | None = None
        self.url = ""
        self.problem = ""
        """Why there is no device, or what it refused last; empty where all is well."""
        self.note = ""
        """What the SDK has warned of lately, such as heights that neighbours do not allow."""
        self.state: State | None = None
        self.health: Health | None = None
        self.activity = ""
        """What plays: pulse, terrain, buttons, pattern, sequence; empty after stop and vent, which end it."""
        self.played: PlaybackStatus | None = None
        """How far the sequence is that plays, told at every step; of the last one where none does."""
        self.history: deque[State] = deque(maxlen=round(RATE_HZ * HISTORY_S))
        self.latencies: deque[float] = deque(maxlen=_LATENCIES)
        """Seconds from a pointer's move in the browser to the wristband's answer that its target is another."""
        self.listeners: set[Callable[[State], None]] = set()
        """Called with each new state, in the event loop."""
        self.leavers: set[Callable[[], None]] = set()
        """Called where a wristband is let go of."""
        self._attended = attended
        self._left_at: float | None = None
        self._noted_at = 0.0
        self._wanted: Intention | None = None
        self._wake = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []
        self._playing: asyncio.Task[None] | None = None
        self._lent: asyncio.Task[None] | None = None
        self._showing: asyncio.Task[bool] | None = None
        self._changing = asyncio.Lock()

    # The device.

    async def open(self, url: str) -> None:
        """Vent and let go of the wristband there is, and take the one at `url`; where it cannot be had, `problem` says why."""
        async with self._changing:
            await self._release()
            self.url = in_real_time(url or f"sim://{boards.DEFAULT}")
            self.problem = "Connecting …"
            try:
                self.skin = await aconnect(self.url)
            except BubbleskinError as error:
                self.problem = str(error)
                return
            self.problem = ""
            self._tasks = [asyncio.create_task(work) for work in (self._follow(), self._drive(), self._care())]

    async def close(self) -> None:
        """Vent, and let go of the wristband."""
        async with self._changing:
            await self._release()

    async def _release(self) -> None:
        self._forget()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, *([self._lent] if self._lent else []), return_exceptions=True)
        self._tasks, self._lent = [], None
        skin, self.skin = self.skin, None
        for leaver in list(self.leavers):
            leaver()
        self.state = self.health = None
        self.history.clear()
        if skin:
            with contextlib.suppress(BubbleskinError):
                await skin.vent()
            with contextlib.suppress(BubbleskinError):
                await skin.aclose()

    # Intentions.

    def ask(self, heights_mm: NDArray[np.float64], over: float = 0.0, stamp: float = 0.0) -> None:
        """Want these heights, (n,), mm, from now on. What was wanted before and has not been sent is not sent any more."""
        if self.is_lent:
            self.problem = _LENT
            return
        self._end_playing()
        self._wanted = Intention(heights_mm, over, stamp)
        self._wake.set()

    def ask_one(self, bubble: int, height_mm: float, stamp: float = 0.0) -> None:
        """Want bubble `bubble` at another height and the others where they are wanted."""
        heights = self.wanted_mm
        if heights is not None and 0 <= bubble < len(heights):
            heights[bubble] = height_mm
            self.ask(heights, stamp=stamp)

    @property
    def wanted_mm(self) -> NDArray[np.float64] | None:
        """The heights that are wanted, as far as is known; None before anything is."""
        if self._wanted:
            return self._wanted.heights_mm.copy()
        return self.state.target_mm.copy() if self.state else None

    @property
    def plays(self) -> bool:
        """Whether a sequence plays."""
        return self._playing is not None

    def play(self, sequence: Playable, activity: str) -> None:
        """Play a sequence by the wristband's clock; it takes over from whatever is played. `InvalidInput` where it is lent."""
        if self.is_lent:
            raise InvalidInput(_LENT)
        self._forget()
        self.activity, self.played = activity, None
        self._playing = asyncio.create_task(self._play(sequence))

    def begin(self, activity: str) -> None:
        """From now on pointer and keys of the page of `activity` move bubbles."""
        if self.is_lent:
            self.problem = _LENT
            return
        self._end_playing()
        self.activity = activity

    @property
    def is_lent(self) -> bool:
        """Whether somebody has the wristband alone."""
        return self._lent is not None and not self._lent.done()

    def lend(self, work: Callable[[AsyncSkin], Coroutine[Any, Any, None]], activity: str) -> None:
        """Let `work` have the wristband alone until it is done: nobody else moves it meanwhile, but stop and vent cancel it.

        `InvalidInput` where there is no wristband, or it is lent already.
        """
        if self.skin is None or self.is_lent:
            raise InvalidInput(_LENT if self.skin else self.problem or "No wristband is connected.")
        self._forget()
        self.activity = activity
        self._lent = asyncio.create_task(self._lend(work(self.skin)))

    async def stop(self) -> None:
        """Close all valves: before all else that is asked, which is dropped."""
        await self._halt(AsyncSkin.stop)

    async def vent(self) -> None:
        """Open all vent valves: before all else that is asked, which is dropped."""
        await self._halt(AsyncSkin.vent)

    async def clear_faults(self) -> None:
        """Acknowledge all faults."""
        await self._say(self.skin.clear_faults() if self.skin else None)

    async def _halt(self, how: Callable[[AsyncSkin], Coroutine[Any, Any, None]]) -> None:
        self._forget()
        await self._say(how(self.skin) if self.skin else None)

    def _forget(self) -> None:
        """Nothing is wanted any more."""
        self._end_playing()
        self._wanted = None
        self.activity = ""
        if self._lent:
            self._lent.cancel()
        if self._showing:
            self._showing.cancel()  # or it would be sent after a stop

    def _end_playing(self) -> None:
        """Nobody follows the sequence any more; the wristband ends it at what comes next."""
        playing, self._playing = self._playing, None
        if playing:
            playing.cancel()
            self.activity = ""

    async def _lend(self, work: Coroutine[Any, Any, None]) -> None:
        try:
            await self._say(work)
        finally:
            self.activity = ""

    async def _play(self, sequence: Playable) -> None:
        skin = self.skin
        if skin:
            await self._say(skin.play(sequence, progress=partial(setattr, self, "played")))
        self.activity = ""
        self._playing = None

    async def _say(self, work: Coroutine[Any, Any, Any] | None) -> bool:
        """Do it, and say why it could not be done; whether it was."""
        if work is None:
            return False
        try:
            await work
        except BubbleskinError as error:
            self.problem = str(error)
            return False
        self.problem = ""
        return True

    def warn(self, sentence: str) -> None:
        """Keep a warning for as long as it takes to read it."""
        self.note = sentence
        self._noted_at = time.monotonic()

    # What runs all the time.

    async def _follow(self) -> None:
        """Take the wristband's states and hand them on; where it is silent, ask again until it is not."""
        skin = self.skin
        assert skin
        fields = USUAL[: most(skin.info.bubbles)]
        while True:
            try:
                while self.is_lent:
                    self._tell(await skin.state())
                    await asyncio.sleep(_ASKED_S)
                async for state in skin.telemetry(RATE_HZ, fields):
                    self._tell(state)
            except LinkError as error:
                self.problem = str(error)
                self._forget()
            if not self.is_lent:
                await asyncio.sleep(_RETRY_S)

    def _tell(self, state: State) -> None:
        self.state = state
        self.history.append(state)
        for listener in list(self.listeners):
            listener(state)

    async def _drive(self) -> None:
        """Send what is wanted, one at a time, always the newest."""
        skin = self.skin
        assert skin
        sent: Intention | None = None
        while True:
            await self._wake.wait()
            self._wake.clear()
            wanted = self._wanted
            if wanted is None or wanted is sent:
                continue
            sent = wanted
            # As one of a stream: what neighbours do is reckoned beside this loop, in one step. Stop and vent end that.
            over = min(max(wanted.over, _STREAM_S), STREAM_S)
            self._showing = asyncio.create_task(self._say(skin.show(wanted.heights_mm, over=over, wait=False)))
            await asyncio.wait([self._showing])
            if not self._showing.cancelled() and self._showing.result() and wanted.stamp:
                self.latencies.append(time.time() - wanted.stamp)

    async def _care(self) -> None:
        """Now and then ask how the device is; and vent where nobody looks any more."""
        skin = self.skin
        assert skin
        while True:
            with contextlib.suppress(BubbleskinError):
                self.health = await skin.health()
            self._left_at = None if self._attended() or self._playing else self._left_at or time.monotonic()
            if self._left_at and time.monotonic() - self._left_at > GRACE_S and not self._is_flat():
                await self.vent()
            if time.monotonic() - self._noted_at > _READ_S:
                self.note = ""
            await asyncio.sleep(_CARE_S)

    def _is_flat(self) -> bool:
        return self.state is not None and self.state.mode in ("idle", "venting")
