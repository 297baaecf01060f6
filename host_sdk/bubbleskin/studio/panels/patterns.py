"""The panel of patterns: heights that move, typed in a few words, and felt at once."""

from functools import partial

from nicegui import ui

from bubbleskin.patterns import WORDS
from bubbleskin.studio.array import Array
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.widgets import button, field, text

EXAMPLES = (
    "ripple",
    "wave.rotate(30).slow(2)",
    "noise(2) * 0.8",
    "seq(ripple, wave, each=4)",
    "(ripple + wave.fast(2)) * 0.5",
)


class PatternPanel:
    """A line to type into, examples, and what is wrong with what was typed."""

    def __init__(self, desk: Desk, array: Array):
        self._desk = desk
        with ui.element("section").classes("card"):
            text("h2", "Patterns")
            text(
                "p",
                f"Words: {', '.join(WORDS)}. Then .slow(2), .fast(2), .rotate(30), .mirror(), .shift(x=1), and + and *.",
            )
            self._line = field("Pattern", desk.pattern, self._typed, "ripple.slow(2)")
            button("Play", self._play, "btn main")
            self._said = text("p", "", "fine").props('role="status"')
            text("h3", "Try")
            with ui.element("div").classes("row"):
                for example in EXAMPLES:
                    button(example, partial(self._try, example))
        self.refresh()

    def _typed(self, words: str) -> None:
        self._desk.pattern = words

    async def _try(self, words: str) -> None:
        self._desk.pattern = words
        self._line.props["value"] = words
        await self._play()

    async def _play(self) -> None:
        self._desk.owner.problem = await self._desk.play_pattern()

    def refresh(self) -> None:
        """Say what plays."""
        playing = self._desk.owner.activity == "pattern"
        self._said.text = f"Playing {self._desk.pattern}." if playing else ""
