"""Which bubbles a wristband no longer knows the size of: those that neighbours have pressed for long since they were flat.

A device takes the pressure by which neighbours push a bubble for that of its rubber: on real rubber what it tells is
1 mm off after ten shapes. A bubble that is flat is measured anew.
"""

import numpy as np
from numpy.typing import NDArray

from bubbleskin.surface.gaps import Gaps

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LOST_S = 5.0
"""Seconds of it after which a bubble goes flat before the next shape that touches."""


class Pressed:
    """Since when each bubble of a wristband may have been pressed."""

    def __init__(self, gaps: Gaps, bubbles: int):
        self._gaps = gaps
        self._since = np.full(bubbles, np.inf)

    def forget(self) -> None:
        """All are flat: the wristband has restarted."""
        self._since[:] = np.inf

    def flat(self, which: Flags) -> None:
        """These are flat, or go there now, (n,)."""
        self._since[which] = np.inf

    def reach(self, alone_mm: Array, now: float) -> None:
        """The bubbles have these heights alone at `now`, s, or soon, (n,)."""
        fresh = self._gaps.touching(alone_mm) & np.isinf(self._since)
        self._since[fresh] = now

    def lost(self, now: float) -> Flags:
        """The bubbles of which nobody knows how large they are, (n,)."""
        return now - self._since > LOST_S
