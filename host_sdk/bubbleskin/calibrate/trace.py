"""What telemetry has told of one group of bubbles, tick by tick: the raw data that everything is fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bubbleskin.device.state import State

FIELDS = ("pressure", "fill", "vent", "status", "faults")
"""Columns of telemetry that are needed."""

Floats = NDArray[np.float64]

EMPTIED_S = 1.5
"""After which what was full before is empty."""
SOME_PA = 3000.0
SEVERAL = 20
"""Readings."""


@dataclass(frozen=True, eq=False)
class Trace:
    """Readings of some bubbles, one row a tick, (k, m); the supply's are (k,)."""

    bubbles: tuple[int, ...]
    tick_s: float
    pressure_pa: Floats
    fill_us: Floats
    """For how long the fill valve is energised in the period after the one that begins with the reading."""
    vent_us: Floats
    supply_pa: Floats
    """As the device filters it: each time a quarter of what is new."""
    fitted_from: int
    """Readings before this are of rubber that is stretched for the first time."""
    lost: int
    """Readings that have not come."""
    faults: dict[int, tuple[str, ...]]
    """What bubbles have reported meanwhile."""
    others_pa: dict[int, float]
    """What sensors of bubbles that were to be empty said, Pa: the highest of each that had some pressure."""

    def column(self, bubble: int) -> int:
        """Where a bubble stands."""
        return self.bubbles.index(bubble)

    @property
    def supply_now_pa(self) -> Floats:
        """The supply's readings before they were filtered."""
        filtered = self.supply_pa
        return np.concatenate([filtered[:1], filtered[:-1] + 4.0 * np.diff(filtered)])


def of_states(states: Sequence[State], bubbles: Sequence[int], tick_s: float, fitted_from_s: float) -> Trace:
    """A trace of what has come; what is lost between two readings is put in between them, and counted."""
    ticks = np.array([round(state.time / tick_s) for state in states])
    every = np.arange(ticks[0], ticks[-1] + 1)
    columns = list(bubbles)

    def table(name: str, unit: float) -> Floats:
        rows = np.array([getattr(state, name) for state in states], float)[:, columns] * unit
        return np.column_stack([np.interp(every, ticks, rows[:, k]) for k in range(len(columns))])

    late = [state.pressure_kpa for state in states if state.time - states[0].time > EMPTIED_S]
    highest = 1e3 * np.median(_highest(late), axis=0) if len(late) >= SEVERAL else np.zeros(len(states[0].pressure_kpa))
    others = {k: float(p) for k, p in enumerate(highest) if k not in bubbles and p > SOME_PA}
    faults: dict[int, tuple[str, ...]] = {}
    for state in states:
        for bubble in bubbles:
            if state.faults[bubble]:
                faults.setdefault(bubble, state.faults[bubble])
    return Trace(
        bubbles=tuple(bubbles),
        tick_s=tick_s,
        pressure_pa=table("pressure_kpa", 1e3),
        fill_us=table("fill_ms", 1e3),
        vent_us=table("vent_ms", 1e3),
        supply_pa=np.interp(every, ticks, [1e3 * (state.supply_kpa or 0.0) for state in states]),
        fitted_from=round(fitted_from_s / tick_s),
        lost=len(every) - len(ticks),
        faults=faults,
        others_pa=others,
    )


def _highest(rows: Sequence[Floats]) -> Floats:
    """The few highest readings of each sensor: one alone may be noise."""
    return np.sort(np.array(rows), axis=0)[-SEVERAL:]
