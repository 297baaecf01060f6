"""Whoever sits before a simulated board: does what is asked, and says what there is to see and to hear."""

from typing import TYPE_CHECKING

import numpy as np

from bubbleskin.bringup.questions import Question

if TYPE_CHECKING:
    from bubbleskin.sim.board import Simulated


class Person:
    """The person at a simulated board."""

    def __init__(self, board: "Simulated"):
        self._board = board
        self._off: int | None = None

    def do(self, question: Question) -> None:
        """Do what the question asks for; what was pulled off before is pushed on first."""
        act, board = question.act, self._board
        if act in ("pull", "all_on") and self._off is not None:
            board.inject("pop_off", self._off, 0.0)
            self._off = None
        if act == "pull" and question.bubble is not None:
            board.inject("pop_off", question.bubble, 1.0)
            self._off = question.bubble
        elif act in ("press", "release"):
            board.inject("estop", 0, float(act == "press"))
        elif act in ("pump_off", "pump_on"):
            board.inject("pump_off", 0, float(act == "pump_off"))

    def look(self, question: Question) -> bool:
        """What there is to see or to hear."""
        bubble = question.bubble or 0
        if question.act == "listen":
            coils = self._board.wiring.coils(len(self._board.plant.pressure_pa))
            return bool((coils[2 * bubble : 2 * bubble + 2] >= 0).any())
        return int(np.argmax(self._board.height_mm)) == bubble
