"""The paper's rule for bubbles that touch, its Eq. 8: r ≤ d − r_neighbour."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin.checks import finite, instance, number, positive
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout

Array = NDArray[np.float64]


class Limits(NamedTuple):
    """The largest radius of each bubble among its neighbours, and who sets it."""

    radius_mm: Array
    """(n,); inf for a bubble that has no other."""
    neighbour: NDArray[np.int64]
    """(n,); -1 for none."""


class Inflated(NamedTuple):
    """Where rigid bubbles end."""

    radius_mm: Array
    height_mm: Array
    """2 r, (n,)."""
    limited_by: NDArray[np.int64]
    """The neighbour that stopped each bubble short of what was asked, (n,); -1 for none."""


class RigidContact:
    """Spheres that neither give nor move: r ≤ d − r_neighbour, d the distance of the centres.

    Order matters here too, since who comes first takes the room; but no order makes a bubble higher than it is alone.
    The paper measured 14 mm for a centre that is 12 mm high alone: for that see `CompliantContact`.
    """

    def __init__(self, layout: Layout, rest_radius_mm: float = 2.5) -> None:
        self.layout: Layout = instance("layout", layout, Layout, "a Layout")
        positive("rest_radius_mm", number("rest_radius_mm", rest_radius_mm), "mm")
        self.rest_radius_mm = float(rest_radius_mm)
        gap = layout.positions_mm[:, None] - layout.positions_mm[None]
        self._distance = np.hypot(gap[..., 0], gap[..., 1])
        np.fill_diagonal(self._distance, np.inf)
        if (self._distance < 2 * rest_radius_mm - 1e-9).any():
            raise InvalidInput(f"Bubbles of {rest_radius_mm:g} mm radius do not fit this layout even at rest.")

    def __repr__(self) -> str:
        return f"<RigidContact of {len(self.layout)} bubbles>"

    def limits(self, radius_mm: ArrayLike) -> Limits:
        """How large each bubble may be while the others have `radius_mm`, (n,)."""
        room = self._distance - self._radii(radius_mm)[None]
        if len(room) == 1:
            return Limits(np.array([np.inf]), np.array([-1]))
        return Limits(room.min(axis=1), room.argmin(axis=1))

    def inflate(
        self,
        radius_mm: ArrayLike,
        order: Iterable[int | Sequence[int]] | None = None,
        start_mm: ArrayLike | None = None,
    ) -> Inflated:
        """Take the bubbles to `radius_mm`, (n,), in `order`: one after the other, or those of a group together.

        Without an order all go together. A group grows (or shrinks) in proportion to what each member has left, and
        whoever touches a neighbour stays as it is. `start_mm` are the radii before, (n,); at rest without them.
        """
        wanted = np.maximum(self._radii(radius_mm), self.rest_radius_mm)
        n = len(wanted)
        r = np.full(n, self.rest_radius_mm) if start_mm is None else self._radii(start_mm).copy()
        limited = np.full(n, -1)
        for group in [range(n)] if order is None else order:
            members = np.atleast_1d(np.asarray(group))
            if members.dtype.kind not in "iu" or (members < 0).any() or (members >= n).any():
                raise InvalidInput(f"{group!r} is not a bubble, or a group of them; bubbles are 0 to {n - 1}.")
            limited[members] = -1
            self._grow(r, wanted, members, limited)
        return Inflated(r, 2 * r, limited)

    def _grow(self, r: Array, wanted: Array, members: NDArray[np.int64], limited: NDArray[np.int64]) -> None:
        moving = np.zeros(len(r), bool)
        moving[members] = True
        rate = np.where(moving, wanted - r, 0.0)
        left = 1.0
        while left > 0 and rate.any():
            closing = rate[:, None] + rate[None]
            room = self._distance - r[:, None] - r[None]
            with np.errstate(divide="ignore", invalid="ignore"):
                time = np.where(closing > 1e-12, np.maximum(room, 0) / closing, np.inf)
            first = float(time.min(initial=np.inf))
            dt = min(left, first)
            r += dt * rate
            left -= dt
            if left <= 1e-12:
                break  # all have what they asked, just
            i, j = (int(k) for k in np.unravel_index(time.argmin(), time.shape))
            for one, other in ((i, j), (j, i)):
                if rate[one] > 0:
                    rate[one], limited[one] = 0.0, other

    def _radii(self, radius_mm: ArrayLike) -> Array:
        r = finite("radius_mm", radius_mm)
        if r.ndim and r.shape != (len(self.layout),):
            raise InvalidInput(f"{r.size} radii for {len(self.layout)} bubbles: give one in mm per bubble.")
        return np.array(np.broadcast_to(r, (len(self.layout),)))
