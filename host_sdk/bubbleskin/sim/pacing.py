"""Virtual time at the wall clock's pace, for boards that are simulated in real time."""

import time

from bubbleskin.sim.board import Simulated

_BEHIND_MAX = 0.1
"""Seconds that a board may be behind the wall clock before it gives up catching up."""


class Pace:
    """Keeps the virtual time of `board` at the wall clock's, tick by tick."""

    def __init__(self, board: Simulated):
        self._board = board
        self._start = time.monotonic() - board.time

    def behind(self) -> float:
        """Seconds that the board is behind the wall clock; below zero where it is ahead."""
        behind = time.monotonic() - self._start - self._board.time
        if behind > _BEHIND_MAX:  # the machine is too slow, or was asleep: virtual time slips
            self._start += behind
            return 0.0
        return behind

    def wait(self) -> None:
        """Sleep until the next tick is due."""
        ahead = -self.behind()
        if ahead > 0:
            time.sleep(ahead)
