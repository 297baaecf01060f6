"""How fast simulated wristbands run: virtual seconds per second of one core."""

import time
from collections.abc import Iterator

import numpy as np

from bubbleskin.bench.rows import Row, share_of
from bubbleskin.boards import DEFAULT, NAMES
from bubbleskin.connecting import connect

_SECONDS = 20.0
"""Of virtual time, for each row."""
_EVERY = 2.0
"""Virtual seconds between two shows."""
_TURNS = 5
"""Of those that are compared."""


def rows(size: float = 1.0) -> Iterator[Row]:
    """The firmware in process, with a new random shape every 2 s, and at rest; and what real rubber costs of ideal one."""
    for board, moving in (*((name, True) for name in NAMES), (DEFAULT, False)):
        url = f"sim://{board}"
        target = "≥ 20" if moving and board == DEFAULT else ""
        what = f"a new shape every {_EVERY:g} s" if moving else "at rest"
        yield Row(f"{url}, {what}", _speed(url, moving, size * _SECONDS), "× real time", target)
    yield Row(f"sim://{DEFAULT}?rubber=real, a new shape every {_EVERY:g} s", _cost(size), "× the time of ideal rubber")


def _cost(size: float) -> float:
    """Time of real rubber by that of ideal one: turn by turn, the fastest of each, since others use this computer too."""
    urls = [f"sim://{DEFAULT}", f"sim://{DEFAULT}?rubber=real"]
    turns = [[_speed(url, True, size * _SECONDS / _TURNS) for url in urls] for _ in range(share_of(_TURNS, size))]
    ideal, real = np.max(turns, axis=0)
    return float(ideal / real)


def _speed(url: str, moving: bool, seconds: float) -> float:
    """Virtual seconds in a second of processor time, over so many virtual ones."""
    with connect(f"{url}{'&' if '?' in url else '?'}seed=1") as skin:
        board = skin.simulated
        assert board is not None
        rng = np.random.default_rng(1)
        skin.sleep(0.5)  # Compiled, cached and warm.
        begin, cpu = board.time, time.process_time()
        while board.time - begin < seconds:
            if moving:
                skin.show(rng.uniform(5.5, 12.5, len(skin.layout)), wait=False, plan=False)
            skin.sleep(min(_EVERY, seconds))
        return (board.time - begin) / (time.process_time() - cpu)
