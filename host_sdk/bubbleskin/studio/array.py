"""The live array as an element of the page, and the one message a tick that it takes."""

import math
from collections.abc import Callable
from typing import Any

from nicegui.element import Element
from nicegui.events import GenericEventArguments
from numpy.typing import NDArray

from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.layout import Layout
from bubbleskin.studio.files import STATIC

BubbleEvent = dict[str, Any]
"""`kind`: enter, leave, press or paint; `bubble`; `stamp`: when, in the browser, s since 1970."""


class Array(Element, component=STATIC / "array.js"):
    """The bubbles of `layout`, the strip chart of the chosen one, and all figures as a table."""

    def __init__(self, info: Info, layout: Layout):
        super().__init__()
        self.on_bubble: Callable[[BubbleEvent], None] | None = None
        """Called with what pointer and keys do to bubbles."""
        self.chosen = 0
        """The bubble that this page has chosen."""
        self.on_choose: Callable[[], None] | None = None
        centred = layout.positions_mm - layout.positions_mm.mean(axis=0)
        self.props.update(
            positions=centred.round(3).tolist(),
            pitch=layout.pitch_mm,
            rest=info.height_rest_mm,
            max=info.height_max_mm,
            pressure=info.pressure_max_kpa,
        )
        self.on("bubble", self._bubble)
        self.on("choose", self._choose)

    def take(self, state: State) -> None:
        """Show another state."""
        self.run_method("take", message(state))

    def take_history(self, states: list[State]) -> None:
        """Show what was before this page was opened."""
        self.run_method("history", [message(state) for state in states])

    def foresee(self, tops_mm: list[float] | None) -> None:
        """Show besides where the bubbles would stand, (n,); None: nothing besides."""
        self.run_method("foresee", tops_mm)

    def _bubble(self, event: GenericEventArguments) -> None:
        if self.on_bubble:
            self.on_bubble(event.args)

    def _choose(self, event: GenericEventArguments) -> None:
        self.chosen = int(event.args["bubble"])
        if self.on_choose:
            self.on_choose()


def message(state: State) -> dict[str, Any]:
    """What a page is sent of a state: short names, hundredths of a mm and of a kPa, and only the faults that there are."""
    short: dict[str, Any] = {
        "t": round(state.time, 3),
        "h": _rounded(state.height_mm),
        "a": _rounded(state.alone_mm),
        "g": _rounded(state.target_mm),
        "p": _rounded(state.pressure_kpa),
        "s": state.status,
        "f": {bubble: faults for bubble, faults in enumerate(state.faults) if faults},
    }
    if state.sd_mm is not None:
        short["sd"] = _rounded(state.sd_mm)
    return short


def _rounded(values: NDArray[Any]) -> list[float]:
    """JSON has no nan: what is not known is 0."""
    return [round(value, 2) if math.isfinite(value) else 0.0 for value in values.tolist()]
