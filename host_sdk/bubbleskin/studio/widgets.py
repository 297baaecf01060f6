"""Buttons, sliders and choices: the browser's own, which keyboards and screen readers know."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from nicegui import ui
from nicegui.element import Element
from nicegui.elements.mixins.text_element import TextElement

from bubbleskin.studio.files import STATIC


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


class Control(Element, component=STATIC / "control.js"):
    """What a person sets: the browser's own slider, line of text or choice. `chosen(value)` is called with what they choose."""

    def __init__(self, label: str, kind: str, value: float | str, chosen: Callable[[str], None], **more: Any):
        super().__init__()
        self.props.update(label=label, kind=kind, value=value, **more)
        self.on("chosen", lambda event: chosen(str(event.args)))


class Slider:
    """A number that is chosen with a slider. `change(value)` is called with what a person chooses, not with `set`."""

    def __init__(self, label: str, extent: Range, value: float, change: Callable[[float], None]):
        self._extent = extent
        self._change = change
        low, high, step, _ = extent
        with ui.element("div").classes("field"):
            self._label = text("span", label)
            self._said = text("span", "", "value")
            self._control = Control(label, "range", value, self._moved, min=low, max=high, step=step)
        self.set(value)

    def set(self, value: float, label: str = "") -> None:
        """Stand at `value`; `label`: be called something else."""
        self.value = value
        if self._control.props["value"] != value:
            self._control.props["value"] = value
        decimals = len(f"{self._extent.step:g}".partition(".")[2])
        self._said.text = f"{value:.{decimals}f} {self._extent.unit}"
        if label:
            self._label.text = label

    def _moved(self, chosen: str) -> None:
        value = min(max(float(chosen), self._extent.low), self._extent.high)
        self.set(value)
        self._change(value)


def choice(label: str, options: Sequence[Sequence[str]], value: str, change: Callable[[str], None]) -> Control:
    """One of several: (value, words) each."""
    with ui.element("div").classes("field"):
        text("span", label)
        return Control(label, "", value, change, options=[list(option) for option in options])


def field(label: str, value: str, change: Callable[[str], None], hint: str = "") -> Control:
    """A line of text to be typed."""
    with ui.element("div").classes("field"):
        text("span", label)
        return Control(label, "text", value, change, hint=hint)


class Toggle:
    """A button that is pressed or not, as `set` says; `act()` is called when somebody presses it."""

    def __init__(self, words: str, act: Callable[[], Any]):
        self._button = button(words, act)
        self.set(False)

    def set(self, pressed: bool) -> None:
        """Look pressed, or not."""
        said = "true" if pressed else "false"
        if self._button.props.get("aria-pressed") != said:
            self._button.props["aria-pressed"] = said
