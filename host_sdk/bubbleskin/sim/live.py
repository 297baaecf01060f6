"""Failures of a plant that move by themselves: some come and go, some sensors are late."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass
class _Late:
    """A sensor whose counts come late."""

    seconds: float
    lags: bool
    """With a time constant; otherwise as they were, so much later."""
    time: float = -math.inf
    said: float = 0.0
    before: "deque[tuple[float, int]]" = field(default_factory=deque)

    def read(self, now: float, count: int) -> int:
        """What it says at `now`, where a good one says `count`."""
        if self.lags:
            share = 1.0 - math.exp(-(now - self.time) / self.seconds)
            self.said += share * (count - self.said)
            self.time = now
            return round(self.said)
        self.before.append((now, count))
        while len(self.before) > 1 and self.before[1][0] <= now - self.seconds:
            self.before.popleft()
        return self.before[0][1]


class Live:
    """What moves by itself on one plant; `inject` is the plant's. False while there is nothing."""

    def __init__(self, inject: Callable[[str, int, float], None]):
        self._inject = inject
        self._blinking: dict[tuple[str, int], tuple[float, float, float]] = {}
        self._late: dict[int, _Late] = {}

    def __bool__(self) -> bool:
        return bool(self._blinking or self._late)

    def blink(self, name: str, number: int, value: float, seconds: float, period: float) -> None:
        """Let this failure be there for so many seconds of each period."""
        self._blinking[name, number] = value, seconds, period

    def late(self, number: int, seconds: float, lags: bool) -> None:
        """Let this bubble's sensor be late."""
        self._late[number] = _Late(seconds, lags)

    def forget(self, number: int, names: list[str], late: bool) -> None:
        """No more of these."""
        for name in names:
            self._blinking.pop((name, number), None)
        if late:
            self._late.pop(number, None)

    def step(self, now: float) -> None:
        """Bring the failures that come and go to this moment."""
        for (name, number), (value, seconds, period) in self._blinking.items():
            self._inject(name, number, value if now % period < seconds else 0.0)

    def read(self, now: float, counts: NDArray[np.uint16]) -> None:
        """Let late sensors say what they would."""
        for number, late in self._late.items():
            counts[number] = late.read(now, int(counts[number]))
