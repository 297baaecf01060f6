"""One measured value, and how the benches count and time."""

import time
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

_T = TypeVar("_T")

REPEATS = 3
"""Of what is timed, at full size."""


class Row(NamedTuple):
    """What was measured, its value and unit, and the target as text, empty where there is none."""

    name: str
    value: float
    unit: str
    target: str = ""


def share_of(count: int, size: float) -> int:
    """That share of `count` repeats, at least one."""
    return max(1, round(count * size))


def fastest(work: Callable[[], _T], repeats: int) -> tuple[float, _T]:
    """Least processor time (s) that `work` took, and what it gave last: what else the machine does only makes it slower."""
    best = np.inf
    for _ in range(repeats):
        begin = time.process_time()
        result = work()
        best = min(best, time.process_time() - begin)
    return best, result
