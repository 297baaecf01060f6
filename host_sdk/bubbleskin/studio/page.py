"""One page: the bar with stop and vent, the live array, and beside it the panel that was chosen. All of it is rebuilt at will."""

from collections.abc import Callable
from typing import Protocol

from nicegui import ui
from nicegui.client import Client

from bubbleskin.device.state import State
from bubbleskin.link.clock import Clock
from bubbleskin.studio.array import Array
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.owner import as_asked
from bubbleskin.studio.panels.buttons import ButtonsPanel
from bubbleskin.studio.panels.calibration import CalibrationPanel
from bubbleskin.studio.panels.live import LivePanel, choose_device
from bubbleskin.studio.panels.patterns import PatternPanel
from bubbleskin.studio.panels.pulse import PulsePanel
from bubbleskin.studio.panels.recorder import RecorderPanel
from bubbleskin.studio.panels.sequence import SequencePanel
from bubbleskin.studio.panels.terrain import TerrainPanel
from bubbleskin.studio.widgets import text

REFRESH_S = 0.4
_HISTORY_EVERY = 2  # a page that is opened is given every second state: half the bytes, and as much to see


class Panel(Protocol):
    """What stands beside the array: it builds itself where it is made, and `refresh` brings it up to date."""

    def refresh(self) -> None:
        """Say what is so now."""


PANELS: dict[str, tuple[str, Callable[[Desk, Array], Panel]]] = {
    "live": ("Live", LivePanel),
    "pulse": ("Pulse", PulsePanel),
    "terrain": ("Terrain", TerrainPanel),
    "buttons": ("Buttons", ButtonsPanel),
    "patterns": ("Patterns", PatternPanel),
    "sequence": ("Sequence", SequencePanel),
    "recorder": ("Recorder", RecorderPanel),
    "calibration": ("Calibration", CalibrationPanel),
}
"""By the name in the address: what its tab says, and what makes it."""


class Page:
    """A page that somebody has opened."""

    def __init__(self, desk: Desk, tab: str):
        self._desk = desk
        self._skin = desk.owner.skin
        self._client: Client = ui.context.client
        self._array: Array | None = None
        self._panel: Panel | None = None
        self._tab = tab if tab in PANELS else "live"
        with ui.element("div").classes("studio").style("width: 100%"):
            self._bar()
            with ui.element("div").classes("desk"):
                if self._skin:
                    with ui.element("section").classes("card").props('aria-label="The array"'):
                        self._array = Array(self._skin.info, self._skin.layout)
                self._side()
        self._client.on_connect(self._connected)
        self._client.on_delete(lambda: desk.owner.listeners.discard(self._take))
        ui.timer(REFRESH_S, self._refresh)

    def _bar(self) -> None:
        with ui.element("div").classes("bar").props('role="banner"'):
            text("h1", "bubbleskin studio")
            with ui.element("div").classes("told"):
                self._where = text("span", "", "where")
                self._facts = _Facts(("doing", "recording", "supply", "link", "clock", "pointer"))
            with ui.element("div").classes("safety"):
                for what, key in (("stop", "Esc"), ("vent", "Esc Esc")):
                    with ui.element("button").classes(f"btn {what}").props(f'type="button" data-act="{what}"'):
                        text("span", what.capitalize())
                        text("kbd", key)
        text("div", "").props('id="alarm" role="alert" hidden')
        self._notice = text("div", "", "notice").props('role="status"')

    def _side(self) -> None:
        with ui.element("div").classes("side"):
            with ui.element("nav").classes("tabs").props('aria-label="Panels"'):
                self._tabs = {name: self._tab_button(name, title) for name, (title, _) in PANELS.items()}
            self._place = ui.element("div").classes("side")
        self._show(self._tab)

    def _tab_button(self, name: str, title: str) -> ui.element:
        keep = f"() => {{ history.replaceState(null, '', '?tab={name}'); emit(); }}"
        return text("button", title).props('type="button"').on("click", lambda: self._show(name), js_handler=keep)

    def _show(self, name: str) -> None:
        self._tab = name
        for other, tab in self._tabs.items():
            tab.props.set_optional("aria-current", "page" if other == name else None)
        self._place.clear()
        if self._array:
            self._array.on_bubble = self._array.on_choose = None
            self._array.show_now(self._history())
            if self._client.has_socket_connection:
                self._array.foresee(None)
        with self._place:
            if self._array:
                self._panel = PANELS[name][1](self._desk, self._array)
            else:
                with ui.element("section").classes("card"):
                    choose_device(self._desk)
        self._refresh()

    # What comes from the wristband.

    def _connected(self) -> None:
        if self._array:
            self._array.take_history(self._history())
            self._desk.owner.listeners.add(self._take)

    def _history(self) -> list[State]:
        return list(self._desk.owner.history)[::_HISTORY_EVERY]

    def _take(self, state: State) -> None:
        if self._array and self._client.has_socket_connection:
            self._array.take(state)

    def _refresh(self) -> None:
        owner = self._desk.owner
        if owner.skin is not self._skin:  # another wristband: another page
            self._skin = owner.skin
            ui.navigate.reload()
            return
        self._notice.text = owner.problem or owner.note
        self._notice.set_visibility(bool(owner.problem or owner.note))
        self._where.text = as_asked(owner.url)
        self._facts.say(
            doing=_doing(owner.state, owner.activity),
            recording=f"{recorded.seconds:.0f} s" if (recorded := self._desk.recorder.current) else "",
            supply=f"{owner.health.supply_kpa:.0f} kPa" if owner.health else "–",
            pointer=f"{1e3 * sorted(owner.latencies)[len(owner.latencies) // 2]:.0f} ms" if owner.latencies else "",
            **(_clock(owner.skin.clock, owner.state) if owner.skin else {}),
        )
        if self._panel:
            self._panel.refresh()


class _Facts:
    """Names and values in a row; one without a value is not shown."""

    def __init__(self, names: tuple[str, ...]):
        self._values = {}
        with ui.element("div").classes("facts"):
            for name in names:
                with ui.element("span") as fact:
                    text("span", f"{name} ")
                    self._values[name] = (fact, text("b", ""))

    def say(self, **values: str) -> None:
        for name, (fact, value) in self._values.items():
            value.text = values.get(name, "")
            fact.set_visibility(bool(values.get(name)))


def _doing(state: State | None, activity: str) -> str:
    if state is None:
        return "nothing yet"
    return f"{state.mode}, {activity}" if activity else state.mode


def _clock(clock: Clock, state: State | None) -> dict[str, str]:
    """How good link and clock are, in words."""
    if not clock.pings:
        return {}
    lost = f", {state.lost} lost" if state and state.lost else ""
    return {
        "link": f"{clock.round_trip * 1e3:.1f} ms{lost}",
        "clock": f"± {clock.uncertainty * 1e3:.1f} ms",
    }
