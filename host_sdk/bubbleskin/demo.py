"""The demonstration: a few shapes in a row, and how the bubbles got there."""

from collections.abc import Callable
from contextlib import closing
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.device.state import State
from bubbleskin.errors import DeviceFault
from bubbleskin.layout import Layout
from bubbleskin.shape import shapes
from bubbleskin.skin import Skin

DEMO: dict[str, Callable[[Layout], NDArray[np.float64]]] = {"dome": shapes.dome, "tilted plane": shapes.plane}

SECONDS = 1.0
"""How long each shape is watched; it stands after about half of that."""

_RATE_HZ = 50


class Show(NamedTuple):
    """One shape: its title and the states from the command to `SECONDS` later.

    `height_mm`: of every state, (states, n): where bubbles truly stood on a simulated board, else what was told. `true`: which.
    """

    title: str
    states: list[State]
    height_mm: NDArray[np.float64]
    true: bool


def watch(skin: Skin, title: str, heights_mm: NDArray[np.float64], report: Callable[[State, float], None]) -> Show:
    """Show `heights_mm` and collect the states; `report` gets each with the seconds since the command.

    Raises `DeviceFault` where the shape does not stand at the end.
    """
    board = skin.simulated

    def heights(state: State) -> NDArray[np.float64]:
        return state.height_mm if board is None else board.height_mm.copy()

    states = [skin.state()]
    stood = [heights(states[0])]
    skin.show(heights_mm, wait=False)
    with closing(skin.telemetry(_RATE_HZ)) as telemetry:  # a Ctrl-C in a generator that is forgotten would be, too
        for state in telemetry:
            states.append(state)
            stood.append(heights(state))
            since = state.time - states[0].time
            report(state, since)
            if since >= SECONDS:
                break
    if not states[-1].arrived:
        raise DeviceFault(
            f"The {title} does not stand after {SECONDS:g} s. Run `bubbleskin info` and look at supply pressure and faults."
        )
    return Show(title, states, np.array(stood), board is not None)
