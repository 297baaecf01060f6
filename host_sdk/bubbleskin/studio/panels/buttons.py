"""The panel of the digital buttons: bubbles that peek out under the pointer, rise when they are pressed, and are painted."""

from nicegui import ui

from bubbleskin.studio.array import Array, BubbleEvent
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.widgets import Toggle, button, text

_LINES = 8


class ButtonsPanel:
    """The switch, and what was pressed; the bubbles themselves are those of the array."""

    def __init__(self, desk: Desk, array: Array):
        self._desk = desk
        array.on_bubble = self._touched
        with ui.element("section").classes("card"):
            text("h2", "Buttons")
            text(
                "p",
                "Bubbles of the array peek out under the pointer. Click to raise, drag to paint; by keys: arrows and Enter.",
            )
            with ui.element("div").classes("row"):
                self._on = Toggle("Buttons on", self._toggle)
                button("All down", self._clear)
            text("h3", "Pressed")
            self._said = text("p", "", "fine").props('aria-live="polite"').style("white-space: pre-line")
        self.refresh()

    def _toggle(self) -> None:
        owner = self._desk.owner
        if owner.activity == "buttons":
            owner.begin("")
        else:
            self._desk.new_buttons()
            owner.begin("buttons")
        self.refresh()

    def _clear(self) -> None:
        if self._desk.owner.activity == "buttons":
            self._desk.buttons.clear()

    def _touched(self, event: BubbleEvent) -> None:
        self._desk.touch(event["kind"], int(event["bubble"]), float(event["stamp"]))

    def refresh(self) -> None:
        """Say which are raised, and what was pressed last."""
        self._on.set(self._desk.owner.activity == "buttons")
        self._said.text = "\n".join(self._desk.pressed[-_LINES:][::-1]) or "None yet."
