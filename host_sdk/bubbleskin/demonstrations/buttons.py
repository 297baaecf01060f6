"""Digital buttons: bubbles that peek out under a pointer, rise when they are pressed, and do something."""

from collections import defaultdict
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin import checks
from bubbleskin.layout import Layout
from bubbleskin.skin import Skin

REST_MM, PEEK_MM, RAISED_MM = 0.0, 7.0, 12.0
"""A bubble that nobody is at has no pressure: it is as soft as it can be."""
OVER_S = 0.15
"""In which a bubble goes from one to another."""
_NEAR = 0.5
"""Share of the pitch within which a place belongs to a bubble."""
_TOWARDS = 0.4
"""Cosine of the angle within which a neighbour lies in a direction."""


class Buttons:
    """The bubbles of a wristband as buttons, and what they do.

    `show`: what takes one height per bubble to the skin, such as a function that calls `skin.show`; it is called whenever
    one changes. Heights are mm: of a bubble that nobody is at, one under the pointer, and one that was pressed.
    """

    def __init__(
        self,
        layout: Layout,
        show: Callable[[NDArray[np.float64]], Any],
        *,
        rest_mm: float = REST_MM,
        peek_mm: float = PEEK_MM,
        raised_mm: float = RAISED_MM,
    ):
        self.layout = checks.instance("layout", layout, Layout, "a Layout, such as skin.layout")
        self._show = checks.function("show", show, "a function of one height per bubble")
        self.rest_mm = checks.number("rest_mm", rest_mm, 0.0, unit="mm")
        self.peek_mm = checks.number("peek_mm", peek_mm, self.rest_mm, unit="mm")
        self.raised_mm = checks.number("raised_mm", raised_mm, self.peek_mm, unit="mm")
        self.hovered: int | None = None
        """The bubble under the pointer."""
        self._raised: set[int] = set()
        self._callbacks: dict[int, list[Callable[[int], Any]]] = defaultdict(list)

    @classmethod
    def on(cls, skin: Skin, **heights_mm: float) -> Self:
        """Of a wristband; `heights_mm` as of `Buttons`."""
        return cls(skin.layout, lambda heights: skin.show(heights, over=OVER_S, wait=False), **heights_mm)

    def __repr__(self) -> str:
        raised = self.layout.names(sorted(self._raised)) if self._raised else "none"
        return f"<Buttons of {len(self.layout)} bubbles, raised: {raised}>"

    @property
    def raised(self) -> frozenset[int]:
        """The bubbles that are pressed."""
        return frozenset(self._raised)

    @property
    def heights_mm(self) -> NDArray[np.float64]:
        """What is asked of each bubble, (n,)."""
        heights = np.full(len(self.layout), self.rest_mm)
        if self.hovered is not None:
            heights[self.hovered] = self.peek_mm
        heights[sorted(self._raised)] = self.raised_mm
        return heights

    def on_press(self, bubble: int, callback: Callable[[int], Any]) -> None:
        """Call `callback(bubble)` whenever this bubble rises because it was pressed or painted; several are called in order."""
        number = self._number(bubble)
        self._callbacks[number].append(checks.function("callback", callback, "a function of the bubble's number"))

    def hover(self, bubble: int | None) -> None:
        """The pointer is over this bubble, which peeks out; None: over none."""
        before, self.hovered = self.hovered, None if bubble is None else self._number(bubble)
        if self.hovered != before:
            self._show(self.heights_mm)

    def press(self, bubble: int) -> bool:
        """Raise it and do what it is for, or let it down again; returns whether it is up."""
        number = self._number(bubble)
        if number not in self._raised:
            self._raise(number)
            return True
        self._raised.remove(number)
        self._show(self.heights_mm)
        return False

    def drag(self, bubble: int) -> None:
        """The pointer is drawn over it while it is held down: it is painted, that is raised if it is not yet."""
        self.hovered = self._number(bubble)
        if self.hovered not in self._raised:
            self._raise(self.hovered)

    def clear(self) -> None:
        """Let all of them down."""
        self._raised.clear()
        self._show(self.heights_mm)

    def at(self, x_mm: float, y_mm: float) -> int | None:
        """The bubble at a place, mm as of the layout; None beside all of them."""
        place = checks.number("x_mm", x_mm), checks.number("y_mm", y_mm)
        away = np.linalg.norm(self.layout.positions_mm - np.array(place), axis=1)
        nearest = int(away.argmin())
        return nearest if away[nearest] <= _NEAR * self.layout.pitch_mm else None

    def beside(self, bubble: int | None, x: float, y: float) -> int:
        """The neighbour of a bubble in the direction (x, y), or the bubble itself; of None the one nearest to the middle."""
        away = self.layout.positions_mm - self.layout.positions_mm.mean(axis=0)
        if bubble is None:
            return int(np.linalg.norm(away, axis=1).argmin())
        others = [*self.layout.neighbours[self._number(bubble)]]
        ways = self.layout.positions_mm[others] - self.layout.positions_mm[bubble]
        towards = ways @ np.array([x, y]) / (np.linalg.norm(ways, axis=1) * np.hypot(x, y))
        return others[int(towards.argmax())] if len(others) and towards.max() > _TOWARDS else bubble

    def _raise(self, bubble: int) -> None:
        self._raised.add(bubble)
        self._show(self.heights_mm)
        for callback in self._callbacks[bubble]:
            callback(bubble)

    def _number(self, bubble: int) -> int:
        return checks.whole("The number of the bubble", bubble, 0, len(self.layout) - 1)
