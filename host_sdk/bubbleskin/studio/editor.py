"""The sequence editor as all pages share it: the timeline, what the model foresees of it, files, and where it plays."""

import asyncio
import re
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

from bubbleskin import patterns
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.device.state import State
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sequence.library import LIBRARY
from bubbleskin.sequence.model import Sequence
from bubbleskin.studio import edits
from bubbleskin.studio.foresight import Forecast, Foresight
from bubbleskin.studio.owner import Owner
from bubbleskin.studio.timeline import Chosen, Message, Timeline

FILES = (".json", ".csv", ".tsv", ".txt")
"""Endings of sequences that are uploaded: `Sequence.to_json`, and timelines."""
FIRST = "breathing"
"""Of the library, what a new studio shows."""
ACTIVITY = "sequence"


class Editor:
    """Pages send it changes; `listeners` are called whenever there is something else to show."""

    def __init__(self, owner: Owner):
        self._owner = owner
        self.problem = ""
        """Why the last change was not made; empty where it was."""
        self.forecast: Forecast | None = None
        """Of the sequence as it is, or lately was."""
        self.tops_mm: list[float] | None = None
        """The true tops that are foreseen under the playhead; None: nobody knows."""
        self.looks = 0
        """Another whenever the playhead or what is under it has changed."""
        self.listeners: set[Callable[[], None]] = set()
        self._timeline: Timeline | None = None
        self._foresight: Foresight | None = None
        self._skin: AsyncSkin | None = None
        self._played: Sequence | None = None
        self._thinking: asyncio.Task[None] | None = None
        self._asked = 0
        owner.listeners.add(self._follow)

    @property
    def timeline(self) -> Timeline:
        """What is edited; `InvalidInput` where there never was a wristband."""
        if self._timeline is None:
            raise InvalidInput(self._owner.problem or "No wristband is connected.")
        return self._timeline

    def meet(self) -> None:
        """Know the wristband that there is, which may be another."""
        skin = self._owner.skin
        if skin is not None and skin is not self._skin:
            self._skin = skin
            touch = skin.simulated is None or skin.simulated.contact
            self._foresight = Foresight(skin.layout, skin.info, touch=touch)
            self.forecast = self.tops_mm = None
            self._fit(skin)
            self._think()

    def _fit(self, skin: AsyncSkin) -> None:
        """Keep what is edited, whatever wristband it is for; only what nobody has touched is made for this one."""
        kept = self._timeline
        if kept is None or not (kept.can_undo or kept.can_redo or kept.sequence.bubbles == len(skin.layout)):
            self._timeline = kept = Timeline(LIBRARY[FIRST](skin.layout))
        kept.rest_mm, kept.high_mm = skin.info.height_rest_mm, skin.info.height_max_mm

    # What pages ask.

    def change(self, what: Message) -> None:
        """Do what a page asks; `problem` says why it could not be done."""
        timeline = self.timeline
        if what.get("kind") != "rows" and what.get("revision") != timeline.revision:
            self.problem = "The sequence was changed elsewhere meanwhile; this is how it is now."
            self._tell()
            return
        self._try(lambda: timeline.change(what, self._owner.skin.layout if self._owner.skin else None))

    def choose(self, what: Message) -> None:
        """Choose a keyframe or steps."""
        self._try(lambda: self.timeline.choose(*(what.get(name, 0) for name in ("step", "last", "row"))))

    def look_at(self, time_ms: float) -> None:
        """Put the playhead somewhere."""
        self._try(lambda: self.timeline.look_at(time_ms))

    def open(self, name: str) -> None:
        """Edit a sequence of the library."""
        self._try(lambda: self._become(LIBRARY[name](self._layout())))

    async def open_pattern(self, words: str, seconds: float) -> None:
        """Edit a pattern, compiled to so many seconds of keyframes."""
        try:
            sequence = await asyncio.to_thread(patterns.parse(words).sequence, self._layout(), seconds)
        except BubbleskinError as error:
            self._fail(error)
        else:
            self._try(lambda: self._become(sequence))

    async def upload(self, name: str, data: bytes) -> str:
        """Edit a sequence from a file's bytes; why it could not be, or nothing. Its name is never a path of ours."""
        ending = Path(name).suffix.lower()
        if ending not in FILES:
            return f"{ending or 'A file without an ending'} is no sequence; {', '.join(FILES)} are."
        self.meet()
        try:
            sequence = await asyncio.to_thread(_read, Path(name).stem[:40] or "sequence", ending, data)
            self._become(sequence)
        except BubbleskinError as error:
            return str(error)
        self.problem = ""
        self._think()
        return ""

    def saved(self) -> tuple[str, str]:
        """The name of a file, and what is in it."""
        self.meet()
        sequence = self.timeline.sequence
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", sequence.name).strip("-")[:40]
        return f"{name or 'sequence'}.json", sequence.to_json()

    async def play_or_stop(self) -> None:
        """Play it on the wristband; where it plays, stop that."""
        if self.plays:
            await self._owner.stop()
            return
        self._played = self.timeline.sequence
        self._owner.play(self._played, ACTIVITY)

    @property
    def plays(self) -> bool:
        """Whether what is edited is played, as it is or as it was."""
        return self._owner.activity == ACTIVITY

    def _layout(self) -> Layout:
        if self._owner.skin is None:
            raise InvalidInput(self._owner.problem or "No wristband is connected.")
        return self._owner.skin.layout

    def _become(self, sequence: Sequence) -> None:
        timeline = self.timeline
        timeline.become(sequence)
        timeline.chosen, timeline.time_ms = Chosen(), 0

    def _try(self, act: Callable[[], None]) -> None:
        try:
            act()
        except BubbleskinError as error:
            self._fail(error)
        else:
            self.problem = ""
            self._think()

    def _fail(self, error: BubbleskinError) -> None:
        self.problem = str(error)
        self.looks += 1
        self._tell()

    def _tell(self) -> None:
        for listener in list(self.listeners):
            listener()

    # What is foreseen: in a thread, always of the newest.

    def _think(self) -> None:
        """Something is another: show it, and reckon what is under the playhead."""
        self._asked += 1
        self.looks += 1
        self._tell()
        if self._thinking is None:
            self._thinking = asyncio.create_task(self._reckon())

    async def _reckon(self) -> None:
        try:
            asked = 0
            while asked != self._asked and self._timeline and self._foresight:
                asked, sequence, time_ms = self._asked, self._timeline.sequence, self._timeline.time_ms
                forecast = self.forecast
                if forecast is None or forecast.sequence is not sequence or forecast.by is not self._foresight:
                    wanted = partial(self._is_edited, sequence)
                    forecast = await asyncio.to_thread(self._foresight.follow, sequence, wanted)
                if forecast is None or forecast.by is not self._foresight:
                    continue
                self.forecast = forecast
                self.tops_mm = await asyncio.to_thread(forecast.tops_at, time_ms)
                self.looks += 1
                self._tell()
        except BubbleskinError as error:
            self._fail(error)
        finally:
            self._thinking = None

    def _is_edited(self, sequence: Sequence) -> bool:
        """Whether that is still what is edited, for the wristband that there is."""
        return self._owner.skin is self._skin and self._timeline is not None and self._timeline.sequence is sequence

    # Where it plays.

    def _follow(self, state: State) -> None:
        """Take the playhead to where the wristband is."""
        played, timeline = self._owner.played, self._timeline
        if not self.plays or played is None or played.step < 0 or timeline is None:
            return
        if timeline.sequence is self._played:
            moment = edits.moments(timeline.sequence)[played.step]
            since = max(round(1000 * (state.time - played.begun)), 0)
            timeline.time_ms = min(moment.begin + since, moment.end)
            self._think()


def _read(title: str, ending: str, data: bytes) -> Sequence:
    """A sequence from a file's bytes, which lie in a folder of their own while they are read."""
    with tempfile.TemporaryDirectory(prefix="bubbleskin-studio-") as folder:
        path = Path(folder) / f"sequence{ending}"
        path.write_bytes(data)
        try:
            return Sequence.load(path)
        except InvalidInput as error:
            raise InvalidInput(str(error).replace(str(path), title + ending)) from None
