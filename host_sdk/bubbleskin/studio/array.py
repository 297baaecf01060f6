"""The live array as an element of the page: one message a tick, and one for each moment of a recording."""

from collections.abc import Callable
from typing import Any

from nicegui.element import Element
from nicegui.events import GenericEventArguments

from bubbleskin.browser.messages import WEB, geometry, message
from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.layout import Layout

BubbleEvent = dict[str, Any]
"""`kind`: enter, leave, press or paint; `bubble`; `stamp`: when, in the browser, s since 1970."""


class Array(Element, component=WEB / "array.js"):
    """The bubbles of `layout`, the strip chart of the chosen one, and all figures as a table."""

    def __init__(self, info: Info, layout: Layout):
        super().__init__()
        self.on_bubble: Callable[[BubbleEvent], None] | None = None
        """Called with what pointer and keys do to bubbles."""
        self.chosen = 0
        """The bubble that this page has chosen."""
        self.on_choose: Callable[[], None] | None = None
        self.recorded = ""
        """Which recording it shows, in words; empty where it shows the wristband as it is now."""
        self.props.update(geometry(info, layout))
        self.on("bubble", self._bubble)
        self.on("choose", self._choose)

    def take(self, state: State) -> None:
        """Show another state, unless a recording is shown."""
        if not self.recorded:
            self.run_method("take", message(state))

    def take_history(self, states: list[State]) -> None:
        """Show what was before this page was opened, unless a recording is shown."""
        if not self.recorded:
            self.run_method("history", [message(state) for state in states])

    def show_recorded(self, what: str, state: State, before: list[State]) -> None:
        """Show a moment of the recording that is called `what`, and what was before it in it, and not what is now."""
        self.recorded = what
        self.run_method("record", what, message(state), [message(one) for one in before])

    def go_on_recorded(self, state: State) -> None:
        """Show the next moment of the recording that is shown."""
        self.run_method("take", message(state))

    def show_now(self, before: list[State]) -> None:
        """Show the wristband again; `before`: its states so far."""
        if self.recorded:
            self.recorded = ""
            self.run_method("record", "", message(before[-1]) if before else None, [message(one) for one in before])

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
