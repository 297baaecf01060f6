"""A settled array: heights, places, what touches whom, and what happened on the way."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.contact.continuation import Snap

Array = NDArray[np.float64]


class Contact(NamedTuple):
    """Two bubbles that push each other."""

    first: int
    second: int
    force: float
    """N, along the line between the centres."""
    overlap_mm: float
    """How far the spheres would reach into each other."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A settled array. Arrays have one entry per bubble, in layout order."""

    height_mm: Array
    """Top of each bubble above the base plane, z + R, (n,)."""
    position: Array
    """Centres x, y, z in m, (n, 3)."""
    stretch: Array
    """λ of the balloon's named surface, (n,)."""
    contacts: tuple[Contact, ...]
    pressure: Array
    """Gauge, Pa, (n,)."""
    radius: Array
    """Outer radius R in m, (n,)."""
    snaps: tuple[Snap, ...]
    """What lost its stability on the way here."""
    energy: float
    """J, necks, base, contact, membranes and air."""
    residual: float
    """Largest force left, N."""
    converged: bool
    increments: int
    """Relaxations on the way here, halved increments included."""

    def __repr__(self) -> str:
        low, high = self.height_mm.min(), self.height_mm.max()
        end = "settled" if self.converged else f"not at rest, {self.residual:.2g} N left"
        return f"<Shape of {len(self)} bubbles, {low:.2f} to {high:.2f} mm, {len(self.contacts)} contacts, {end}>"

    def __len__(self) -> int:
        return len(self.height_mm)

    @property
    def lifted_mm(self) -> Array:
        """How far each bubble's lowest point is off the base plane, (n,)."""
        return np.asarray(1e3 * np.maximum(self.position[:, 2] - self.radius, 0.0))

    @property
    def size_mm(self) -> Array:
        """2R: the height that each bubble would have alone with the size that it has, (n,)."""
        return 2e3 * self.radius

    @property
    def state(self) -> Array:
        """x, y, z, R of each bubble in m, (n, 4): what `energy.py` works on."""
        return np.column_stack([self.position, self.radius])
