"""What every public function of the physics asks of its numbers, and how it says no."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bubbleskin.errors import InvalidInput

Numbers = TypeVar("Numbers", float, NDArray[np.float64])
"""One number or an array of them: what goes in as one comes out as one."""


def finite(name: str, value: Any) -> np.ndarray:
    """``value`` as a float array; refuse what is not a number, and nan and inf by their place."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(f"{name} must be a number or an array of numbers, not {value!r}.") from None
    bad = ~np.isfinite(array)
    if bad.any():
        where = "" if array.ndim == 0 else f" at index {tuple(int(i) for i in np.argwhere(bad)[0])}"
        raise InvalidInput(f"{name} is {array[bad][0]}{where}, but must be a finite number.")
    return array


def number(name: str, value: Any) -> float:
    """``value`` as one finite number."""
    array = finite(name, value)
    if array.size != 1:
        raise InvalidInput(f"{name} must be one number, not {array.size} of them.")
    return float(array.item())


def positive(name: str, value: Any, unit: str) -> np.ndarray:
    """``value`` as a float array of finite numbers above zero."""
    array = finite(name, value)
    if np.any(array <= 0):
        raise InvalidInput(f"{name} is {np.min(array):g}{' ' * bool(unit)}{unit}, but must be above zero.")
    return array


def one_of(name: str, value: Any, allowed: Sequence[str]) -> None:
    """Refuse a word that is not among ``allowed``."""
    if value not in allowed:
        raise InvalidInput(f"{name} is {value!r}, but must be one of {', '.join(map(repr, allowed))}.")


def like(given: Numbers, result: Any) -> Numbers:
    """``result`` as a float if ``given`` was a scalar, else as the array that it is."""
    same: Any = float(result) if np.ndim(given) == 0 else result
    return same
