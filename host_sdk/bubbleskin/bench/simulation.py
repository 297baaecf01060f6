"""How fast simulated wristbands run: virtual seconds per second of one core."""

import time

import numpy as np

from bubbleskin.bench.rows import Row
from bubbleskin.boards import DEFAULT, NAMES
from bubbleskin.link.link import run_sync
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import AsyncSkin, Skin

_VIRTUAL = 20.0  # seconds
_EVERY = 2.0  # seconds between two shows


def rows() -> list[Row]:
    """The firmware in process, with a new random shape every 2 s, and at rest."""
    return [
        *(
            _run(f"sim://{name}, a new shape every 2 s", name, moving=True, target="≥ 20" if name == DEFAULT else "")
            for name in NAMES
        ),
        _run(f"sim://{DEFAULT}, at rest", DEFAULT, moving=False, target=""),
    ]


def _run(name: str, board_name: str, *, moving: bool, target: str) -> Row:
    board = SimulatedBoard(board_name, seed=1)
    skin = Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, board_name), 2.0)))
    rng = np.random.default_rng(1)
    skin.sleep(0.5)  # compiled, cached and warm
    begin, cpu = board.time, time.process_time()
    while board.time - begin < _VIRTUAL:
        if moving:
            skin.show(rng.uniform(5.5, 12.5, len(skin.layout)), wait=False)
        skin.sleep(_EVERY)
    spent = time.process_time() - cpu
    return Row(name, (board.time - begin) / spent, "× real time", target)
