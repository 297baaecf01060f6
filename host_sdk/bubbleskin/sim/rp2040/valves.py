"""What the pins of a board do to its plant: coils, pump and dump valve, each at the very time its level changes."""

from collections.abc import Callable

import numpy as np

from bubbleskin.sim.plant import Plant

FILL, VENT = 0, 1


class Valves:
    """Keeps `plant` up to date with what is commanded. `now()` is the time in s, the plant's and the pins'.

    The plant is stepped in intervals in which a valve closes at most once, and may only begin open; that is all
    `Plant.advance` knows. So an interval ends where a valve opens, and where somebody looks.
    """

    def __init__(self, plant: Plant, now: Callable[[], float], pump: Callable[[], float]):
        n = len(plant.parameters.mu)
        self.plant = plant
        self._now = now
        self._pump = pump
        self._open = np.zeros((n, 2), bool)
        """What the valves are told: fill and vent of each bubble."""
        self._until = np.zeros((n, 2))
        """When those that were told to close in this interval were told so, s."""
        self._dump = False

    def set(self, bubble: int, valve: int, open_: bool) -> None:
        """Tell a valve to open or to close, now."""
        if self._open[bubble, valve] == open_:
            return
        if open_:
            self.advance()
        else:
            self._until[bubble, valve] = self._now()
        self._open[bubble, valve] = open_

    def dump(self, open_: bool) -> None:
        """Open or close the dump valve, now."""
        self.advance()
        self._dump = open_

    def advance(self) -> Plant:
        """Bring the plant to this moment; returns it."""
        plant = self.plant
        dt = self._now() - plant.time
        if dt > 1e-12:
            on = np.where(self._open, dt, np.clip(self._until - plant.time, 0.0, dt))
            plant.advance(dt, on[:, FILL], on[:, VENT], self._pump(), self._dump)
        return plant
