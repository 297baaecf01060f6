"""Digital buttons by the keys of a terminal."""

import re

from bubbleskin.demonstrations.buttons import Buttons

HELP = "arrows move, space presses, p paints on the way, 0-9 press a bubble, c lets all down, q ends"
_MOVES = {
    "\x1b[A": (0, 1),  # arrows, as terminals send them
    "\x1b[B": (0, -1),
    "\x1b[C": (1, 0),
    "\x1b[D": (-1, 0),
    "k": (0, 1),  # and the letters of editors, for terminals without
    "j": (0, -1),
    "l": (1, 0),
    "h": (-1, 0),
}
_PRESSES = (" ", "\r", "\n")
_ENDS = ("q", "\x1b", "\x04", "")
_KEY = re.compile(r"\x1b\[[A-D]|.", re.DOTALL)


def keys(typed: str) -> list[str]:
    """What was typed at once, key by key; empty at the end of the input, which is a key too."""
    return _KEY.findall(typed) or [""]


class Keyboard:
    """Buttons by keys: arrows move, space or Enter presses, p paints while moving, c lets all down, digits press their bubble."""

    def __init__(self, buttons: Buttons):
        self.buttons = buttons
        self.paints = False
        """Whether moving raises what is on the way."""

    def take(self, key: str) -> bool:
        """What a key does; whether it goes on."""
        buttons = self.buttons
        if key in _MOVES:
            self._move(*_MOVES[key])
        elif key in _PRESSES:
            bubble = buttons.beside(None, 0, 0) if buttons.hovered is None else buttons.hovered
            buttons.hover(bubble)
            buttons.press(bubble)
        elif key.isdecimal() and int(key) < len(buttons.layout):
            buttons.hover(int(key))
            buttons.press(int(key))
        elif key == "p":
            self.paints = not self.paints
        elif key == "c":
            buttons.clear()
        return key not in _ENDS

    def _move(self, x: float, y: float) -> None:
        to = self.buttons.beside(self.buttons.hovered, x, y)
        if self.paints:
            self.buttons.drag(to)
        else:
            self.buttons.hover(to)
