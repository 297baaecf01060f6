"""A shape that is led along: bubbles whose sizes are held, each where its size, its neighbours and its way have brought it.

A wristband meters air, so what it holds is each bubble's size, 2R: the height that the bubble would have alone. It is what
`CompliantContact.settle_sizes` follows; this remembers where it is, for those who go on from there many times a second.
"""

from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin.contact.continuation import PathFollower, Resolution
from bubbleskin.contact.model import GRIP, CompliantContact
from bubbleskin.contact.shape import Shape
from bubbleskin.errors import NoEquilibrium

Array = NDArray[np.float64]

_FINEST_MM = 0.3
"""An increment of a way changes no size by more."""


class HeldShape:
    """Where the bubbles of a layout stand while their sizes change; it has a memory: the way decides.

    Sizes and heights are mm: `alone_mm` is 2R of each bubble, (n,), `height_mm` its top above the base plane. A new one stands
    on its barbs with `alone_mm`, of which no two may touch. Its bubbles are truly larger than it is told by `offset_mm`, (n,),
    and go at `pace`, (n,), where others say how far a way has been gone.
    """

    def __init__(
        self, model: CompliantContact, alone_mm: Array, *, offset_mm: Array | float = 0.0, pace: Array | float = 1.0
    ):
        self.model = model
        self.offset_mm, self._pace = offset_mm, pace / np.min(pace)
        self._size_mm = self._true(alone_mm)
        radius = self._size_mm / 2e3
        self._state = np.column_stack([model.bubbles["x"], model.bubbles["y"], radius, radius])

    def _true(self, alone_mm: Array) -> Array:
        return np.maximum(alone_mm + self.offset_mm, 2e3 * self.model.bubbles["outer"])

    def shares(self, share: float) -> Array | float:
        """How far each bubble has gone of a way of which the slowest has gone `share`, 0 to 1, (n,)."""
        return np.minimum(share * self._pace, 1.0)

    def copy(self) -> Self:
        """Another that stands the same."""
        made = object.__new__(type(self))
        made.__dict__.update(self.__dict__)
        return made

    @property
    def alone_mm(self) -> Array:
        """2R, (n,), as told."""
        return self._size_mm - self.offset_mm

    @property
    def height_mm(self) -> Array:
        """The tops, (n,)."""
        return np.asarray(1e3 * (self._state[:, 2] + self._state[:, 3]))

    @property
    def lift_mm(self) -> Array:
        """By how much each is higher than it would be alone, (n,)."""
        return self.height_mm - self._size_mm

    def go(self, alone_mm: Array) -> None:
        """Let all sizes change in proportion to `alone_mm`, (n,), slowly: every moment of it is an equilibrium."""
        size = self._true(alone_mm)
        increments = max(1, int(np.ceil(np.abs(size - self._size_mm).max() / _FINEST_MM)))
        model = self.model
        follower = PathFollower(
            model.bubbles,
            (*model.springs[:4], GRIP),
            self._state,
            kick=model.kick,
            seed=model.seed,
            resolution=Resolution(increments=increments),
        )
        follower.follow(0, partial(_between, self._size_mm / 2e3, size / 2e3))
        self._state, self._size_mm = follower.state, size

    def slope(self) -> Array | None:
        """∂height/∂size, (n, n): row i, column j is bubble i's top by bubble j's 2R. None where the shape is about to snap."""
        try:
            return self.model.size_slope(self.shape())
        except NoEquilibrium:
            return None

    def shape(self) -> Shape:
        """As a `Shape` to plan from."""
        radius = self._state[:, 3].copy()
        return Shape(
            height_mm=self.height_mm,
            position=self._state[:, :3].copy(),
            stretch=radius / self.model.bubbles["radius"],
            contacts=(),
            pressure=self.model.free_pressure(2e3 * radius),
            radius=radius,
            snaps=(),
            energy=0.0,
            residual=0.0,
            converged=True,
            increments=0,
        )


def _between(begin: Array, end: Array, share: float) -> Array:
    return begin + share * (end - begin)
