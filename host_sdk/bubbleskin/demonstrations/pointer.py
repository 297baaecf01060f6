"""A pointer that moves over a terrain by itself, and the wristband that follows it."""

from collections.abc import Callable, Iterator
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin import checks
from bubbleskin.demonstrations.terrain import Terrain
from bubbleskin.errors import InvalidInput
from bubbleskin.skin import Skin

RATE_HZ = 30.0
"""How often the wristband gets a new shape."""
SPEED_MM_S = 20.0
"""Of a pointer, where nobody says another: bubbles follow what comes with it over every terrain of the SDK."""
_INSIDE = 0.1
"""Share of the terrain at each edge that scripted pointers leave out."""
_CORNERS = 120


class Pointer:
    """A pointer that follows `points`, (k, 2) in mm, at one speed; at their end it begins again at the first."""

    def __init__(self, points_mm: ArrayLike, speed_mm_s: float = SPEED_MM_S):
        self.points_mm = checks.finite("points_mm", points_mm)
        if self.points_mm.ndim != 2 or self.points_mm.shape[1] != 2 or len(self.points_mm) < 2:
            raise InvalidInput(f"A pointer needs two or more places (x, y) in mm; it got {self.points_mm.shape}.")
        self.speed_mm_s = checks.above_zero("speed_mm_s", speed_mm_s, unit="mm/s")
        steps = np.linalg.norm(np.diff(self.points_mm, axis=0), axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(steps)])
        if not self._along[-1]:
            raise InvalidInput("A pointer's places are all the same; give it somewhere to go.")

    @property
    def duration(self) -> float:
        """Seconds from the first place to the last."""
        return float(self._along[-1] / self.speed_mm_s)

    def at(self, t: float) -> tuple[float, float]:
        """Where it is `t` seconds after its start."""
        along = (checks.number("t", t, 0.0) * self.speed_mm_s) % self._along[-1]
        x, y = (float(np.interp(along, self._along, column)) for column in self.points_mm.T)
        return x, y


def scan(terrain: Terrain) -> NDArray[np.float64]:
    """Lines from side to side, a pitch apart, from the lower edge to the upper one and back."""
    (left, low), (right, high) = _inside(terrain)
    rows = np.arange(low, high + 1e-9, terrain.layout.pitch_mm)
    up = [(x, y) for row, y in enumerate(rows) for x in ((left, right) if row % 2 == 0 else (right, left))]
    return np.array(up + up[::-1][1:])


def circle(terrain: Terrain) -> NDArray[np.float64]:
    """Once around the middle."""
    return _curve(terrain, 1, 1)


def wander(terrain: Terrain) -> NDArray[np.float64]:
    """A curve that crosses itself and comes by every part of the terrain."""
    return _curve(terrain, 3, 4)


PATHS: dict[str, Callable[[Terrain], NDArray[np.float64]]] = {"scan": scan, "circle": circle, "wander": wander}
"""By the names that the command line knows them by."""


class Moment(NamedTuple):
    """The wristband at one place of its way."""

    time: float
    """s since the start."""
    x_mm: float
    y_mm: float
    heights_mm: NDArray[np.float64]
    """What it was asked to be there, true tops, (n,); its time for that ends with this moment."""


def follow(
    skin: Skin,
    terrain: Terrain,
    pointer: Pointer,
    *,
    mode: str = "plain",
    seconds: float | None = None,
    rate_hz: float = RATE_HZ,
) -> Iterator[Moment]:
    """Let the wristband feel the terrain under a pointer that moves, `rate_hz` times a second; a `Moment` after each.

    `seconds`: None is as long as the pointer takes for its way. The first shape is waited for; from then on each is asked
    for while the one before it ends, and nothing waits. Leave the loop to end it.
    """
    seconds = pointer.duration if seconds is None else checks.number("seconds", seconds, 0.0, unit="s")
    period = 1 / checks.above_zero("rate_hz", rate_hz, 1 / skin.info.tick, "Hz")
    x, y = pointer.at(0.0)
    heights = terrain.patch(x, y, mode)
    skin.show(heights, over=0.5)
    now = skin.link.transport.now
    begin = now()
    yield Moment(0.0, x, y, heights)
    for turn in count(1):
        time = turn * period
        if time > seconds + 1e-9:
            return
        x, y = pointer.at(time)
        heights = terrain.patch(x, y, mode)
        skin.show(heights, over=period, wait=False)
        skin.sleep(max(begin + time - now(), 0.0))
        yield Moment(time, x, y, heights)


def _inside(terrain: Terrain) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    size = np.array(terrain.size_mm)
    return _INSIDE * size, (1 - _INSIDE) * size


def _curve(terrain: Terrain, across: int, up: int) -> NDArray[np.float64]:
    """Lissajous' curve of so many turns along x and along y, closed."""
    low, high = _inside(terrain)
    turn = np.linspace(0, 2 * np.pi, _CORNERS * max(across, up) + 1)
    return (low + high) / 2 + (high - low) / 2 * np.column_stack([np.cos(across * turn), np.sin(up * turn)])
