"""The panel of the sequence editor: what is edited, its timeline, and playing it. What it comes to is shown on the array."""

from nicegui import ui

from bubbleskin.errors import InvalidInput
from bubbleskin.sequence.library import LIBRARY
from bubbleskin.studio.array import Array
from bubbleskin.studio.chart import Chart
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.timeline import Message
from bubbleskin.studio.widgets import Range, Slider, Toggle, button, choice, field, text

SECONDS = Range(1.0, 60.0, 1.0, "s")
"""Of a pattern that is taken over."""


class SequencePanel:
    """The editor of `desk`, which all pages share; this page shows it."""

    def __init__(self, desk: Desk, array: Array):
        self._desk, self._editor, self._array = desk, desk.editor, array
        self._editor.meet()
        self._foreseen: object = self  # what was shown last on the array: nothing yet
        self._named = next(iter(LIBRARY))
        self._seconds = 8.0
        with ui.element("section").classes("card editor"):
            text("h2", "Sequence")
            with ui.element("div").classes("row"):
                self._plays = Toggle("Play", self._play)
                text("a", "Save", "btn").props('href="/sequence" download')
                self._said = text("span", "", "fine").props('role="status"')
            self._chart = Chart(self._editor, desk.layout, self._asked)
        with ui.element("section").classes("card"):
            text("h2", "Another sequence")
            with ui.element("div").classes("pair"):
                with ui.element("div"):
                    names = [(name, name.capitalize()) for name in LIBRARY]
                    choice("Of the library", names, self._named, lambda name: setattr(self, "_named", name))
                    button("Open it", self._open)
                with ui.element("div"):
                    field("Of a pattern", desk.pattern, lambda words: setattr(desk, "pattern", words), "ripple.slow(2)")
                    Slider("Length", SECONDS, self._seconds, lambda value: setattr(self, "_seconds", value))
                    button("Make keyframes of it", self._open_pattern)
            text("p", "Undo brings back what was there before.", "fine")
        self._editor.listeners.add(self._changed)
        self.refresh()

    # What a hand does.

    def _asked(self, kind: str, what: Message) -> None:
        if kind == "edit":
            self._chart.answer(lambda: self._editor.change(what))
        elif kind == "choose":
            self._editor.choose(what)
        else:
            self._editor.look_at(what.get("time", 0))

    def _open(self) -> None:
        self._editor.open(self._named)

    async def _open_pattern(self) -> None:
        await self._editor.open_pattern(self._desk.pattern, self._seconds)

    async def _play(self) -> None:
        try:
            await self._editor.play_or_stop()
        except InvalidInput as error:
            self._desk.owner.problem = str(error)
        self.refresh()

    # What there is to show.

    def _changed(self) -> None:
        """The editor has something else; this page may have gone meanwhile."""
        if self._chart.is_deleted:
            self._editor.listeners.discard(self._changed)
        elif self._chart.client.has_socket_connection:
            self._chart.show()
            self._foresee()

    def _foresee(self) -> None:
        tops = self._editor.tops_mm
        if tops is not self._foreseen:
            self._foreseen = tops
            self._array.foresee(tops)

    def refresh(self) -> None:
        """Say what plays; show what may have been missed while the page was not there."""
        self._plays.set(self._editor.plays)
        played = self._desk.owner.played
        self._said.text = f"Playing step {max(played.step, 0)}." if self._editor.plays and played else ""
        self._changed()
