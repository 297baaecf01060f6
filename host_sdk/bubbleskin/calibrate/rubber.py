"""The wall of one bubble as the fit takes it: a thin sphere of rubber that softens and relaxes.

With the stretch λ and s = λ², the work of the air on a sphere of rest radius r₀ and wall h₀ is that of the rubber,
4π r₀² h₀ w(j) with j = 2s + 1/s² − 3, so that P = (4 h₀/(r₀ λ)) w'(j) (1 − 1/s³). Of Yeoh's energy, w' = μ/2 + 2 C2 j + 3 C3 j².
Rubber that has been stretched further before is softer: by a share of 1 − x², x the energy by the largest so far. This is a
parabola where others take a hyperbolic tangent; whichever it is, three points of a curve hardly tell. Of each change of stress
a part fades within 0.1 s, and another within 3 s: what rubber remembers of the last steps, in two terms.

Lengths in mm, pressures in Pa.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

QUICK_S, SLOW_S = 0.1, 3.0
"""Within which the two parts of what rubber remembers fade."""


class Wall(NamedTuple):
    """What a wall is: stiffnesses times its thickness, Pa mm; rest radius, mm; shares."""

    mu: float
    c2: float
    c3: float
    radius: float
    softening: float
    quick: float
    slow: float


def invariant(stretch: Floats) -> Floats:
    """j = 2λ² + λ⁻⁴ − 3, 0 at rest."""
    square = stretch * stretch
    return np.asarray(2.0 * square + 1.0 / (square * square) - 3.0)


def energy(j: Floats, wall: Wall) -> Floats:
    """Of each mm² of the wall at rest, µJ·10⁻³."""
    return j * (0.5 * wall.mu + j * (wall.c2 + j * wall.c3))


def tension(stretch: Floats, wall: Wall) -> Floats:
    """w'(j)(1 − λ⁻⁶) of the wall as it was made, Pa mm."""
    j = invariant(stretch)
    return (0.5 * wall.mu + j * (2.0 * wall.c2 + 3.0 * wall.c3 * j)) * (1.0 - stretch**-6.0)


def softened(stretch: Floats, largest: Floats, wall: Wall) -> Floats:
    """`tension` after the wall has been stretched to `largest`, energy for energy."""
    j = invariant(np.maximum(stretch, 1.0))
    x = np.clip(energy(j, wall) / np.maximum(energy(invariant(largest), wall), 1e-9), 0.0, 1.0)
    return np.asarray(tension(stretch, wall) * (1.0 - wall.softening * (1.0 - x * x)))


def pressure(stretch: Floats, held: Floats, wall: Wall) -> Floats:
    """Pa, of a wall whose tension is `held`."""
    return np.asarray(4.0 * held / (wall.radius * stretch))


def remembered(held: Floats, tick_s: float, wall: Wall) -> Floats:
    """What of the changes of tension so far has not faded, at each tick."""
    from scipy.signal import lfilter  # takes a third of a second to import

    change = np.diff(held, prepend=held[0])
    left = np.zeros_like(held)
    for share, time in ((wall.quick, QUICK_S), (wall.slow, SLOW_S)):
        kept = float(np.exp(-tick_s / time))
        left = left + share * np.sqrt(kept) * lfilter([1.0], [1.0, -kept], change)
    return np.asarray(left)


def history(stretch: Floats, tick_s: float, wall: Wall) -> Floats:
    """Pressures of a wall that goes through `stretch` tick by tick, from rest."""
    largest = np.maximum.accumulate(np.maximum(stretch, 1.0 + 1e-3))
    held = softened(stretch, largest, wall)
    return pressure(stretch, held + remembered(held, tick_s, wall), wall)


def relaxed(height_mm: Floats, largest_mm: float, wall: Wall) -> Floats:
    """Pressures at heights of a wall that has been as high as `largest_mm` once, and has forgotten the way."""
    stretch = np.maximum(height_mm / (2.0 * wall.radius), 1.0)
    largest = np.maximum(stretch, largest_mm / (2.0 * wall.radius))
    return pressure(stretch, softened(stretch, largest, wall), wall)
