"""The panel of the recorder: record, look at what was recorded, replay it on the page, download it."""

from functools import partial
from urllib.parse import quote

from nicegui import ui

from bubbleskin.studio.array import Array
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.exports import FILM_S, KINDS, Export, lacks
from bubbleskin.studio.owner import HISTORY_S
from bubbleskin.studio.recorder import Take
from bubbleskin.studio.widgets import Range, Slider, Toggle, button, text

_REDRAWN_S = 0.05
_STEP_S = 0.05
_GO_ON_S = 0.5
"""A moment that comes so soon after the one that is shown is added to it; of any other, what was before it is sent too."""
_PAST = 100
"""States before a moment that are sent at most."""


class RecorderPanel:
    """The switch, the recordings of this run, and the one that is looked at."""

    def __init__(self, desk: Desk, array: Array):
        self._desk = desk
        self._recorder = desk.recorder
        self._array = array
        self._listed: list[int] | None = None
        self._rows: dict[int, tuple[ui.element, ui.element]] = {}
        self._take: Take | None = None
        self._at: tuple[int, int] | None = None  # number of the recording and of the state that the array shows
        self._sure: int | None = None
        with ui.element("section").classes("card"):
            text("h2", "Recorder")
            text("p", "Records what the wristband does, whatever plays and whichever panel is open.")
            with ui.element("div").classes("row"):
                self._switch = Toggle("Record", self._toggle)
                self._said = text("p", "", "fine").style("margin: 0")
            text("h3", "Recordings of this run")
            text("p", f"Files stay in {self._recorder.folder}." if self._recorder.stays else _GO, "fine")
            self._list = ui.element("ul").classes("takes")
        self._place = ui.element("div")
        ui.timer(_REDRAWN_S, self._show)
        self.refresh()

    def _toggle(self) -> None:
        if self._recorder.current:
            self._recorder.end()
        else:
            self._desk.owner.problem = self._recorder.start()
        self.refresh()

    def _delete(self, number: int) -> None:
        """Deleted is what was asked for twice."""
        if self._sure == number:
            self._recorder.delete(number)
        self._sure = None if self._sure == number else number
        self.refresh()

    def _look(self, number: int) -> None:
        self._recorder.look(number)
        self.refresh()

    def refresh(self) -> None:
        """Say what is recorded, which recordings there are, and how far downloads are."""
        recorder = self._recorder
        self._switch.set(recorder.current is not None)
        now = recorder.current
        self._said.text = f"Recording {now.number}: {now.seconds:.1f} s" if now else "Not recording."
        if list(recorder.takes) != self._listed:
            self._listed = list(recorder.takes)
            self._sure = None
            self._fill_list()
        for number, (choose, delete) in self._rows.items():
            chosen = recorder.shown is recorder.takes[number]
            choose.props["aria-pressed"] = "true" if chosen else "false"
            delete.props["aria-label"] = f"{'Really delete' if self._sure == number else 'Delete'} recording {number}"
            delete.text = "Really delete?" if self._sure == number else "Delete"  # type: ignore[attr-defined]
        if recorder.shown is not self._take:
            self._take = recorder.shown
            self._place.clear()
            self._downloads: dict[str, _Download] = {}
            if self._take:
                with self._place:
                    self._build(self._take)
        for kind, download in self._downloads.items() if self._take else ():
            assert self._take
            download.refresh(self._take.exports.get(kind))

    def _fill_list(self) -> None:
        self._list.clear()
        self._rows = {}
        with self._list:
            for number, take in self._recorder.takes.items():
                with ui.element("li"):
                    words = f"Recording {number}: {take.begun}, {take.seconds:.1f} s, {len(take.layout)} bubbles"
                    choose = button(words, partial(self._look, number))
                    self._rows[number] = choose, button("Delete", partial(self._delete, number))
            if not self._recorder.takes:
                text("li", "None yet.", "fine")

    def _build(self, take: Take) -> None:
        with ui.element("section").classes("card").style("margin-top: 18px"):
            text("h2", f"Recording {take.number}")
            if self._fits(take):
                text("p", "The array shows what was recorded, and not the wristband, which a replay does not move.")
                extent = Range(0.0, round(take.seconds, 2), _STEP_S, "s")
                self._position = Slider("Position", extent, round(self._recorder.at_s, 2), self._recorder.seek)
                with ui.element("div").classes("row"):
                    self._replay = Toggle("Replay", self._toggle_replay)
                    button("Back to now", self._back)
            else:
                text("p", f"It is of a {take.board}; connect one to look at it.")
            text("h3", "Download")
            with ui.element("div").classes("downloads"):
                text("span", "CSV")
                _link(take.path.name)
                self._downloads = {kind: _Download(self._desk, kind) for kind in KINDS}
            text("p", f"Films begin where the slider stands, and have {FILM_S:.0f} s at most.", "fine")

    def _fits(self, take: Take) -> bool:
        skin = self._desk.owner.skin
        return skin is not None and skin.layout == take.layout

    def _toggle_replay(self) -> None:
        if self._recorder.replays:
            self._recorder.seek(self._recorder.at_s)
        else:
            self._recorder.replay()
        self._show()

    def _back(self) -> None:
        self._recorder.leave()
        self._show()
        self.refresh()

    def _show(self) -> None:
        """Let array, slider and button be where the recorder is."""
        recorder, take = self._recorder, self._recorder.shown
        if take is None or not self._fits(take):
            self._at = None
            if self._array.recorded:
                self._array.show_now(list(self._desk.owner.history)[::2])
            return
        if take is not self._take:
            self.refresh()
        seconds = recorder.at_s
        self._position.set(round(seconds, 2))
        self._replay.set(recorder.replays)
        index = take.index(seconds)
        if (take.number, index) == self._at:
            return
        before, self._at = self._at, (take.number, index)
        state = take.states[index]
        if before and before[0] == take.number and 0 < state.time - take.states[before[1]].time < _GO_ON_S:
            for one in take.states[before[1] + 1 : index + 1]:
                self._array.go_on_recorded(one)
            return
        past = take.states[take.index(seconds - HISTORY_S) : index]
        self._array.show_recorded(f"Recording {take.number}", state, past[:: -(-len(past) // _PAST) or 1])


_GO = "They go when the studio ends: download what you want to keep, or start the studio with --recordings FOLDER."


def _link(name: str) -> ui.element:
    return text("a", name).props(f'href="/recordings/{quote(name)}" download')


class _Download:
    """One kind of file: a button that makes it, how far it is, and where it is; or why it cannot be made."""

    def __init__(self, desk: Desk, kind: str):
        self._told: object = None
        missing = lacks(kind)
        if missing:
            text("span", KINDS[kind])
            text("p", missing, "fine")
        else:
            button(f"Make {KINDS[kind]}", lambda: setattr(desk.owner, "problem", desk.recorder.export(kind)))
            self._place = ui.element("div").props('aria-live="polite"')

    def refresh(self, export: Export | None) -> None:
        """Say how far it is."""
        if export is None:
            return
        words = "" if export.ready else export.problem or f"{100 * export.share:.0f} % done"
        if (export, words) == self._told:
            return
        self._told = export, words
        self._place.clear()
        with self._place:
            if export.ready:
                _link(export.path.name)
                return
            text("p", words, "fine")
            if not export.problem:
                ui.element("progress").props(f'value="{export.share:.3f}" max="1" aria-label="{KINDS[export.kind]}"')
