"""The recorder of a run: what the wristband does goes into a file, whatever plays, and stays to be looked at and downloaded."""

import asyncio
import bisect
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from bubbleskin.device.state import State
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.files import guarded
from bubbleskin.layout import Layout
from bubbleskin.studio.exports import FILMS, LEAST_FILM_S, Export
from bubbleskin.studio.owner import RATE_HZ, Owner
from bubbleskin.telemetry.recording import Table

TAKE_MOST_S = 600.0
"""Seconds of one recording at most: it is kept in memory too, to be looked at. `Skin.record` has no such limit."""
ALL_MOST_S = 3600.0
"""Seconds of all recordings of a run together."""


@dataclass(eq=False)
class Take:
    """One recording: its states, oldest first, and its file."""

    number: int
    board: str
    layout: Layout
    path: Path
    begun: str
    """Time of day."""
    states: list[State] = field(default_factory=list)
    exports: dict[str, Export] = field(default_factory=dict)
    """By kind: what has been made of it to be downloaded, or is being made."""

    @property
    def seconds(self) -> float:
        """How long it is."""
        return self.states[-1].time - self.states[0].time if self.states else 0.0

    def index(self, seconds: float) -> int:
        """Which state is the one at `seconds` since its beginning: the last before."""
        at = self.states[0].time + seconds + 1e-6
        return max(bisect.bisect_right(self.states, at, key=lambda state: state.time) - 1, 0)


class Recorder:
    """Records what comes from the wristband of `owner`, and knows which recording is looked at and where; for all pages.

    `folder`: where files go and stay; without one they lie in a temporary folder, which `close` removes.
    """

    def __init__(self, owner: Owner, folder: Path | None = None):
        self._owner = owner
        self._temporary = None if folder else tempfile.TemporaryDirectory(prefix="bubbleskin-studio-")
        self.stays = folder is not None
        """Whether files stay when the studio ends."""
        self.folder = folder or Path(self._temporary.name if self._temporary else "")
        self.takes: dict[int, Take] = {}
        """Those that are finished, by number."""
        self.current: Take | None = None
        """The one that is being made."""
        self.shown: Take | None = None
        """The one that is looked at."""
        self.replays = False
        """Whether it is replayed."""
        self._table: Table | None = None
        self._from_s = 0.0
        self._since = 0.0
        self._made = 0
        owner.leavers.add(self.end)

    # Recording.

    def start(self) -> str:
        """Record from now on; why that cannot be, or nothing."""
        skin = self._owner.skin
        if self.current or not skin:
            return "" if skin else "No wristband is connected, so there is nothing to record."
        if sum(take.seconds for take in self.takes.values()) >= ALL_MOST_S:
            return f"There are {ALL_MOST_S / 60:.0f} minutes of recordings, which are the most; delete one of them."
        self._made += 1
        path = self.folder / f"{time.strftime('%Y-%m-%d-%H%M%S')}-recording-{self._made}.csv"
        try:
            self._table = Table(path, skin.info, skin.layout, RATE_HZ)
        except InvalidInput as error:
            return str(error)
        self.current = Take(self._made, skin.info.board, skin.layout, path, time.strftime("%H:%M:%S"))
        self._owner.listeners.add(self._hear)
        return ""

    def end(self) -> None:
        """Finish what is being recorded."""
        self._owner.listeners.discard(self._hear)
        take, self.current = self.current, None
        table, self._table = self._table, None
        if not (take and table):
            return
        try:
            table.close()
        except InvalidInput as error:
            self._owner.warn(str(error))
        if len(take.states) > 1:
            self.takes[take.number] = take
            self.look(take.number)
        else:
            take.path.unlink(missing_ok=True)

    def _hear(self, state: State) -> None:
        take, table = self.current, self._table
        assert take
        assert table
        if take.states and state.time <= take.states[-1].time:
            self._owner.warn(f"The wristband has restarted, so recording {take.number} ends before that.")
            self.end()
            return
        try:
            table.write(state)
        except InvalidInput as error:
            self._owner.warn(str(error))
            self.end()
            return
        take.states.append(state)
        if take.seconds >= TAKE_MOST_S:
            self._owner.warn(
                f"Recording {take.number} has {TAKE_MOST_S / 60:.0f} minutes, which are the most; it has ended."
            )
            self.end()

    # Looking.

    def look(self, number: int) -> None:
        """Look at a recording from its beginning; nothing where there is none of that number."""
        if number in self.takes:
            self.shown = self.takes[number]
            self.seek(0.0)

    def leave(self) -> None:
        """Look at none."""
        self.shown, self.replays = None, False

    def seek(self, seconds: float) -> None:
        """Look at the moment `seconds` after the beginning, and stay there."""
        self.replays = False
        self._from_s = min(max(seconds, 0.0), self.shown.seconds) if self.shown else 0.0

    def replay(self) -> None:
        """Go on at real time from where it stands, or from the beginning where that is the end."""
        if self.shown:
            self._from_s = 0.0 if self.at_s >= self.shown.seconds else self.at_s
            self._since = time.monotonic()
            self.replays = True

    @property
    def at_s(self) -> float:
        """Where it stands, s since the beginning."""
        if self.replays and self.shown:
            at = self._from_s + time.monotonic() - self._since
            if at < self.shown.seconds:
                return at
            self.seek(self.shown.seconds)
        return self._from_s

    # Files.

    def export(self, kind: str) -> str:
        """Begin to make a file of the recording that is looked at, see `bubbleskin.studio.exports`; why not, or nothing."""
        take = self.shown
        if not take:
            return "No recording is chosen."
        last = take.exports.get(kind)
        if last and last.works:
            return ""
        first = take.index(min(self.at_s, take.seconds - LEAST_FILM_S)) if kind in FILMS else 0
        begins = f"{take.states[first].time - take.states[0].time:.2f}" if first else ""
        path = self.folder / f"{take.path.stem}{begins and f'-from-{begins}s'}.{kind}"
        title = f"recording {take.number}{begins and f' from {begins} s'}:"
        take.exports[kind] = Export(kind, take.path, path, title)
        take.exports[kind].begin(take.layout, take.states[first:])
        return ""

    def file(self, name: str) -> Path | None:
        """The file of a recording by its name, where there is one that is whole: names are looked up, and never paths."""
        for take in self.takes.values():
            made = [one.path for one in take.exports.values() if one.ready]
            for path in (take.path, *made):
                if path.name == name and path.is_file():
                    return path
        return None

    def delete(self, number: int) -> None:
        """Delete a recording, and the files that were made of it."""
        take = self.takes.pop(number, None)
        if not take:
            return
        if self.shown is take:
            self.leave()
        for export in take.exports.values():
            export.cancel()
        for path in (take.path, *(export.path for export in take.exports.values())):
            try:
                with guarded(path, "the recording"):
                    path.unlink(missing_ok=True)
            except BubbleskinError as error:
                self._owner.warn(str(error))

    async def close(self) -> None:
        """Finish what is recorded, and end what is being exported; temporary files go."""
        self.end()
        works = [export for take in self.takes.values() for export in take.exports.values() if export.works]
        for export in works:
            export.cancel()
        await asyncio.gather(*(export.ended() for export in works))
        if self._temporary:
            self._temporary.cleanup()
