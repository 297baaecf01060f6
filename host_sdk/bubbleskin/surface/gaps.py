"""Which bubbles could touch at all: those whose spheres are wider than the place between their barbs. No model, no cost."""

import numpy as np
from numpy.typing import NDArray

from bubbleskin.layout import Layout

Array = NDArray[np.float64]

SLACK_MM = 0.1
"""Spheres that overlap by less push each other no further than heights are known."""


class Gaps:
    """The distances of a layout's barbs. Heights are those that bubbles have alone, mm, (n,): their diameters.

    Two spheres that rest on the base touch later than two whose centres are at one height. But one that was lifted before may
    hang there: only the sum of the radii says that two cannot touch, wherever they are.
    """

    def __init__(self, layout: Layout, height_max_mm: float):
        place = layout.positions_mm
        distance = np.linalg.norm(place[:, None] - place[None], axis=2) + SLACK_MM
        self._first, self._second = np.nonzero(np.triu(distance < height_max_mm, 1))
        self._room = 2 * distance[self._first, self._second]
        np.fill_diagonal(distance, np.inf)
        self.free_mm: Array = distance.min(axis=1, initial=np.inf)
        """How high each bubble may be while no other is higher, without ever touching one, (n,)."""

    def __bool__(self) -> bool:
        """Whether any two bubbles can touch."""
        return bool(len(self._room))

    def apart(self, alone_mm: Array) -> bool:
        """Whether no two bubbles of these heights can touch, wherever they hang."""
        return bool((alone_mm[self._first] + alone_mm[self._second] < self._room).all())

    def touching(self, alone_mm: Array) -> NDArray[np.bool_]:
        """The bubbles that could touch another, (n,)."""
        close = alone_mm[self._first] + alone_mm[self._second] >= self._room
        found = np.zeros(len(alone_mm), bool)
        found[self._first[close]] = found[self._second[close]] = True
        return found

    def separated(self, alone_mm: Array) -> Array:
        """These heights, cut until no two can touch, (n,)."""
        return np.minimum(alone_mm, self.free_mm - 2 * SLACK_MM)
