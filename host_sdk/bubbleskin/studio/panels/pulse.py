"""The panel of the pulse: at which rate, how deep; played by hand or by a notification."""

from nicegui import ui

from bubbleskin.studio.array import Array
from bubbleskin.studio.desk import DEPTH, RATE, Desk
from bubbleskin.studio.widgets import Slider, button, text


class PulsePanel:
    """The paper's pulse: the inner bubbles together, then the framing ring one after the other, and back."""

    def __init__(self, desk: Desk, array: Array):
        self._desk = desk
        pulse = desk.pulse
        with ui.element("section").classes("card"):
            text("h2", "Pulse")
            text("p", "The inner bubbles rise together, then the ring around them one after the other, and back.")
            self._rate = Slider("Rate", RATE, pulse.rate, lambda value: setattr(pulse, "rate", value))
            self._depth = Slider("Depth", DEPTH, pulse.depth_mm, lambda value: setattr(pulse, "depth_mm", value))
            with ui.element("div").classes("row"):
                button("Play the pulse", self._play, "btn main")
            self._said = text("p", "", "fine").props('role="status"')
        with ui.element("section").classes("card"):
            text("h2", "As a notification")
            text("p", "Any program that can send a request makes the wristband pulse:")
            text("code", f"curl -X POST '{desk.address}/notify?token={desk.token}'")

    def _play(self) -> None:
        problem = self._desk.notify()
        if problem:
            self._desk.owner.problem = problem

    def refresh(self) -> None:
        """Say whether it plays; stand where another page has set it."""
        self._rate.set(self._desk.pulse.rate)
        self._depth.set(self._desk.pulse.depth_mm)
        self._said.text = "Playing." if self._desk.owner.activity == "pulse" else ""
