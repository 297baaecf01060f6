"""The panel of calibration and repair: measure all bubbles or one, step through what was found, accept it or measure again."""

from functools import partial

from nicegui import background_tasks, ui
from nicegui.elements.mixins.text_element import TextElement

from bubbleskin.calibrate.fit import UNITS
from bubbleskin.calibrate.result import BubbleCalibration
from bubbleskin.studio.array import Array
from bubbleskin.studio.assistant import Assistant
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.widgets import button, choice, text

_REPAIR = (
    "Vent, and wait until it is flat.",
    "Pull its tube off, change the bubble, push the tube on again as far as it goes.",
    "Choose it here, lay the wristband down, touch nothing, and measure: about 7 s.",
    "Look at its curve below, and accept it, or measure it again.",
)


class CalibrationPanel:
    """What to measure, how far it is, and a result for each bubble."""

    def __init__(self, desk: Desk, array: Array):
        skin = desk.owner.skin
        assert skin
        self._owner = desk.owner
        self._assistant = desk.assistant
        self._told: object = None
        self._shown: BubbleCalibration | None = None
        with ui.element("section").classes("card"):
            text("h2", "Calibration and repair")
            text(
                "p", "The wristband measures valves, lines, rubber and leaks with its own sensors. Nobody may touch it."
            )
            options = [
                ("all", "All bubbles"),
                *((str(bubble), f"Bubble {bubble}") for bubble in range(skin.info.bubbles)),
            ]
            wanted = self._assistant.wanted
            choice("What to measure", options, "all" if wanted is None else str(wanted), self._want)
            with ui.element("div").classes("row"):
                button("Measure", self._measure, "btn main")
                self._said = text("p", "", "fine").props('role="status"').style("margin: 0; flex: 1")
            self._bar = (
                ui.element("progress").props('max="1" value="0" aria-label="Measured"').style("margin-top: 10px")
            )
            with ui.element("details").classes("repair"):
                text("summary", "To replace a bubble")
                with ui.element("ol"):
                    for step in _REPAIR:
                        text("li", step)
        self._place = ui.element("div").style("margin-top: 18px")
        self.refresh()

    def _want(self, value: str) -> None:
        self._assistant.wanted = None if value == "all" else int(value)

    def _measure(self) -> None:
        self._do(self._assistant.measure(self._assistant.wanted))

    def _do(self, problem: str) -> None:
        self._owner.problem = problem
        self.refresh()

    def refresh(self) -> None:
        """Say how far it is; the results again only where they are others."""
        assistant = self._assistant
        now = assistant.progress
        self._said.text = _words(assistant)
        self._bar.set_visibility(now is not None)
        if now:
            self._bar.props["value"] = round(now.done, 3)
        found = [assistant.of(bubble) for bubble in assistant.bubbles]
        if found and assistant.chosen not in assistant.bubbles:
            assistant.chosen = assistant.bubbles[0]
        if found != self._told:
            self._told = found
            self._shown = None
            self._place.clear()
            if found:
                with self._place, ui.element("section").classes("card"):
                    self._build(found)
        if found:
            self._refresh_results()

    def _build(self, found: list[BubbleCalibration]) -> None:
        self._title = text("h2", "")
        with ui.element("div").classes("row").props('role="group" aria-label="Bubbles that were measured"'):
            button("Previous", lambda: self._step(-1))
            self._marks = {each.bubble: button("", partial(self._look, each.bubble), "btn small") for each in found}
            button("Next", lambda: self._step(1))
        self._picture = ui.element("img").classes("fitted")
        self._verdict = text("p", "").props('aria-live="polite"')
        with ui.element("div").classes("row"):
            self._accept = button("", self._accept_one, "btn main")
            self._redo = button("", lambda: self._do(self._assistant.measure(self._assistant.chosen)))
            self._accept_all = button("", lambda: self._do(self._assistant.accept(self._assistant.usable)))
            button("Discard all", self._discard)
        with ui.element("details").classes("figures"):
            text("summary", "Figures with 95 % intervals")
            self._figures = ui.element("div").classes("scroll").props('tabindex="0" role="region" aria-label="Figures"')

    def _step(self, by: int) -> None:
        bubbles = self._assistant.bubbles
        self._look(bubbles[(bubbles.index(self._assistant.chosen) + by) % len(bubbles)])

    def _look(self, bubble: int) -> None:
        self._assistant.chosen = bubble
        self.refresh()

    def _accept_one(self) -> None:
        self._do(self._assistant.accept([self._assistant.chosen]))

    def _discard(self) -> None:
        self._assistant.discard()
        self.refresh()

    def _refresh_results(self) -> None:
        assistant = self._assistant
        bubble = assistant.chosen
        each = assistant.of(bubble)
        for other, mark in self._marks.items():
            words = _standing(assistant, other)
            mark.text = f"{other}{_SIGNS[words]}"
            mark.props["aria-label"] = f"Bubble {other}, {words}"
            mark.props["aria-pressed"] = "true" if other == bubble else "false"
        usable = assistant.usable
        self._title.text = f"Bubble {bubble}: {_standing(assistant, bubble)}"
        self._verdict.text = each.verdict.advice or "Nothing of it is out of family."
        _offer(self._accept, f"Accept bubble {bubble}", bubble in usable)
        _offer(self._redo, f"Measure bubble {bubble} again", True)
        _offer(self._accept_all, f"Accept all {len(usable)} that can be used", len(usable) > 1)
        if each is not self._shown:
            self._shown = each
            self._fill_figures(each)
            background_tasks.create(self._draw(bubble), name="picture")

    async def _draw(self, bubble: int) -> None:
        drawn = await self._assistant.picture(bubble)
        if self._assistant.chosen == bubble and not self._picture.is_deleted:
            alt = f"Bubble {bubble}: pressure across, height up; measured, model, fitted curve and band of memory"
            self._picture.props.update(src=drawn, alt=alt)

    def _fill_figures(self, each: BubbleCalibration) -> None:
        self._figures.clear()
        with self._figures, ui.element("table"):
            with ui.element("tr"):
                for heading in ("Figure", "Value", "±", "Unit"):
                    text("th", heading).props('scope="col"')
            for (name, (value, sd)), unit in zip(each.parameters.items(), UNITS, strict=False):
                with ui.element("tr"):
                    for cell in (name.replace("_", " "), f"{value:.4g}", f"{1.96 * sd:.2g}", unit):
                        text("td", cell)


_SIGNS = {"in use": " ✓", "can be accepted": "", "redo": " ↻", "out of family": " !"}


def _standing(assistant: Assistant, bubble: int) -> str:
    """How it stands with a bubble, in words of `_SIGNS`."""
    if assistant.is_used(bubble):
        return "in use"
    verdict = assistant.of(bubble).verdict
    return "can be accepted" if verdict.accepted else verdict.verdict


def _words(assistant: Assistant) -> str:
    now = assistant.progress
    if not now:
        return assistant.said
    which = f" of {', '.join(map(str, now.bubbles))}" if now.bubbles else ""
    return f"{now.what.capitalize()}{which}: {100 * now.done:.0f} %. Stop, vent or Escape end it."


def _offer(one: TextElement, words: str, there: bool) -> None:
    one.text = words
    one.set_visibility(there)
