"""A recorded trace of what `Bubbles` is given and decides, to be replayed anywhere."""

from array import array
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bubbleskin import boards
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware

BOOT_ID = 1


class Tick(NamedTuple):
    """One tick: a shape asked before it, (heights µm, ticks), or None; then what `step` is given and gives."""

    phase: str
    show: tuple[list[int], int] | None
    counts: array
    supply_pa: int
    mode: int
    pulses: list[int]


def record(name: str, phases: Sequence[tuple[str, float, float, float]], seed: int = 1) -> list[Tick]:
    """Ticks of a simulated `name` that goes through `phases`: (name, seconds, s between two shapes, s of a ramp).

    A phase with no shapes, 0 s between them, holds what there is.
    """
    firmware = InProcessFirmware(boards.load(name), BOOT_ID)
    bubbles = firmware.app.bubbles
    step = bubbles.step
    ticks: list[Tick] = []
    asked: list[tuple[list[int], int]] = []

    def recorded(counts: array, supply_pa: int, mode: int) -> None:
        step(counts, supply_pa, mode)
        ticks.append(
            Tick(phase, asked.pop() if asked else None, array("H", counts), supply_pa, mode, bubbles.pulses.tolist())
        )

    bubbles.step = recorded  # type: ignore[assignment]
    board = SimulatedBoard(name, seed=seed, firmware=firmware)
    rng = np.random.default_rng(seed)
    for phase, seconds, every, ramp in phases:  # noqa: B007 - `recorded` uses it
        for tick in range(round(seconds / board.tick_s)):
            if every and tick % round(every / board.tick_s) == 0:
                heights = rng.integers(5500, 12500, board.data.BUBBLES).tolist()
                firmware.app.commands.show(array("i", heights), 0, round(1000 * ramp))
                asked = [(heights, max(1, round(ramp / board.tick_s)))]
            firmware.app.deadman.host_activity()  # no host speaks here: without it, what moves is held after a while
            board.tick()
    return ticks
