"""Buttons, sliders and choices: the browser's own, which keyboards and screen readers know."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement
from nicegui.events import GenericEventArguments


class Range(NamedTuple):
    """What a slider goes through, and the unit it says."""

    low: float
    high: float
    step: float
    unit: str


def text(tag: str, words: str, classes: str = "") -> TextElement:
    """An element with words in it, its `text`."""
    element = TextElement(tag=tag, text=words)
    return element.classes(classes)


def button(words: str, act: Callable[[], Any], classes: str = "btn") -> TextElement:
    """A button that does something."""
    element = text("button", words, classes).props('type="button"')
    return element.on("click", lambda: act(), js_handler="() => emit()")


class Slider:
    """A number that is chosen with a slider. `change(value)` is called with what a person chooses, not with `set`."""

    def __init__(self, label: str, extent: Range, value: float, change: Callable[[float], None]):
        self._extent = extent
        self._change = change
        with ui.element("label").classes("field"):
            text("span", label)
            self._output = text("span", "", "value").props("aria-hidden=true")
            low, high, step, _ = extent
            self._input = ui.element("input").props(f'type=range min={low} max={high} step={step} aria-label="{label}"')
            self._input.on("input", self._moved, js_handler="(event) => emit(event.target.value)")
        self.value = value
        self.set(value)

    def set(self, value: float) -> None:
        """Stand at `value`."""
        if self._input.props.get("value") != value:
            self._input.props["value"] = value
        self._say(value)

    def _say(self, value: float) -> None:
        self.value = value
        decimals = len(f"{self._extent.step:g}".partition(".")[2])
        self._output.text = f"{value:.{decimals}f} {self._extent.unit}"

    def _moved(self, event: GenericEventArguments) -> None:
        value = min(max(float(event.args), self._extent.low), self._extent.high)
        with self._input.props.suspend_updates():  # what comes back late would pull the slider from under the hand
            self._input.props["value"] = value
        self._say(value)
        self._change(value)


def choice(label: str, options: Sequence[tuple[str, str]], value: str, change: Callable[[str], None]) -> None:
    """One of several: (value, words) each."""
    with ui.element("label").classes("field"):
        text("span", label)
        with ui.element("select") as select:
            for name, words in options:
                text("option", words).props["value"] = name
        select.props["value"] = value
        select.on("change", lambda event: change(str(event.args)), js_handler="(event) => emit(event.target.value)")


def field(label: str, value: str, hint: str = "") -> Callable[[], str]:
    """A line of text to be typed; returns what tells it."""
    typed = value

    def take(event: GenericEventArguments) -> None:
        nonlocal typed
        typed = str(event.args)

    with ui.element("label").classes("field"):
        text("span", label)
        line = ui.element("input").props('type=text spellcheck=false autocomplete=off')
        line.props["value"] = value
        line.props["placeholder"] = hint
        line.on("input", take, js_handler="(event) => emit(event.target.value)")
    return lambda: typed
