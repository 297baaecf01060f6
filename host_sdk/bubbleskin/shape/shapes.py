"""Ready-made shapes, and heights from files and from the command line's arguments."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout

LOW_MM, HIGH_MM = 5.5, 12.0
"""Lowest and highest of the ready-made shapes."""


def dome(layout: Layout) -> NDArray[np.float64]:
    """Highest in the middle, a sphere's cap falling to 6.5 mm at the outermost bubbles, (n,)."""
    _check(layout)
    distance = np.linalg.norm(layout.positions_mm, axis=1)
    return HIGH_MM - 5.5 * (distance / max(distance.max(), 1e-9)) ** 2


def plane(layout: Layout) -> NDArray[np.float64]:
    """Rising from 5.5 mm on the left to 12 mm on the right, (n,)."""
    x = _check(layout).positions_mm[:, 0]
    share = (x - x.min()) / max(np.ptp(x), 1e-9)
    return LOW_MM + (HIGH_MM - LOW_MM) * share


def flat(layout: Layout) -> NDArray[np.float64]:
    """Every bubble at rest, without pressure, (n,)."""
    return np.zeros(len(_check(layout)))


def _check(layout: Layout) -> Layout:
    return checks.instance("layout", layout, Layout, "a Layout, such as skin.layout or Layout.hexagon()")


SHAPES: dict[str, Callable[[Layout], NDArray[np.float64]]] = {"dome": dome, "plane": plane, "flat": flat}


def parse_heights(texts: Sequence[str]) -> NDArray[np.float64]:
    """Heights in mm, (n,), from one text each. Raises `InvalidInput` for one that is not a number."""
    heights = []
    for text in texts:
        try:
            heights.append(float(text))
        except ValueError:
            raise InvalidInput(f"{text!r} is not a height in mm; give numbers, one per bubble.") from None
    return np.array(heights)


def load(path: Path) -> NDArray[np.float64]:
    """A heightfield in mm from a .npy file, or from a text file of numbers with commas between them.

    Raises `InvalidInput` for a file that cannot be read or holds something else.
    """
    try:
        field = np.load(path, allow_pickle=False) if path.suffix == ".npy" else np.loadtxt(path, delimiter=",")
        return np.asarray(field, dtype=float)
    except OSError as error:
        raise InvalidInput(f"Cannot read {path}: {error.strerror or error}.") from None
    except ValueError as error:
        raise InvalidInput(f"{path} is not a heightfield of numbers: {str(error).rstrip('.')}.") from None
