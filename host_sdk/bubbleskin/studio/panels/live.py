"""The panel of the wristband itself: one bubble or all by hand, faults with cause and remedy, and which wristband it is."""

import numpy as np
from nicegui import background_tasks, ui

from bubbleskin import boards
from bubbleskin.fault_guide import guide
from bubbleskin.link.serial import attached
from bubbleskin.studio.array import Array
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.owner import as_asked
from bubbleskin.studio.widgets import Range, Slider, button, choice, field, text


class LivePanel:
    """Heights by hand, faults, device."""

    def __init__(self, desk: Desk, array: Array):
        self._owner = desk.owner
        self._array = array
        array.on_choose = self._chose
        skin = desk.owner.skin
        assert skin
        rest_mm = skin.info.height_rest_mm
        heights = Range(rest_mm, skin.info.height_max_mm, 0.1, "mm")
        with ui.element("section").classes("card"):
            text("h2", "Heights by hand")
            self._one = Slider("Chosen bubble", heights, rest_mm, self._raise_one)
            self._all = Slider("All bubbles", heights, rest_mm, self._raise_all)
        with ui.element("section").classes("card").props('aria-live="polite"'):
            text("h2", "Faults")
            self._faults = ui.element("div")
        with ui.element("section").classes("card"):
            choose_device(desk)
        self._told: object = None
        self._chose()
        self.refresh()

    def _raise_one(self, height_mm: float) -> None:
        self._owner.ask_one(self._array.chosen, height_mm)

    def _raise_all(self, height_mm: float) -> None:
        state = self._owner.state
        if state is not None:
            self._owner.ask(np.full(len(state.target_mm), height_mm))

    def _chose(self) -> None:
        heights = self._owner.wanted_mm
        if heights is not None and self._array.chosen < len(heights):
            self._one.set(round(float(heights[self._array.chosen]), 1), f"Bubble {self._array.chosen}")

    def refresh(self) -> None:
        """Say which faults there are; again only where they have changed."""
        state = self._owner.state
        self._chose()
        found = {f"Bubble {bubble}": names for bubble, names in enumerate(state.faults) if names} if state else {}
        if state and state.board_faults:
            found["Board"] = state.board_faults
        if found == self._told:
            return
        self._told = found
        self._faults.clear()
        with self._faults:
            for where, names in found.items():
                for name in names:
                    cause, remedy = guide(name)
                    with ui.element("div").classes("fault"):
                        text("b", f"{where}: {name.replace('_', ' ')}")
                        text("p", f"Cause: {cause}.")
                        text("p", f"{remedy}.")
            if found:
                button("Clear faults", self._owner.clear_faults)
            else:
                text("p", "None.")


def choose_device(desk: Desk) -> None:
    """The device picker: simulated boards with their options, the ports that are found, any other URL."""
    current, _, options = as_asked(desk.owner.url).partition("?")
    choices = [(port, f"Wristband at {port}") for port in attached()]
    choices += [(f"sim://{name}", f"Simulated {name}") for name in boards.NAMES]
    if current and current not in dict(choices):
        choices.insert(0, (current, current))
    wanted = {"device": current or choices[0][0], "options": options, "other": ""}

    def connect() -> None:
        device = wanted["other"].strip() or wanted["device"]
        chosen = wanted["options"].strip().lstrip("?")
        if device == wanted["device"] and device.startswith("sim://") and chosen:
            device = f"{device}?{chosen}"
        background_tasks.create(desk.owner.open(device), name="connect")

    text("h2", "Wristband")
    choice("Device", choices, wanted["device"], lambda value: wanted.update(device=value))
    hint = "seed=3&spread=0.1&rubber=real"
    field("Options of a simulated one", wanted["options"], lambda value: wanted.update(options=value), hint)
    field("Or any URL", "", lambda value: wanted.update(other=value), "/dev/ttyACM0, socket://host:7707")
    button("Connect", connect, "btn main")
