"""What no top may pass, as far as anybody can know: the board's greatest height, neighbours included, all the way."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bubbleskin.surface.gaps import Gaps

if TYPE_CHECKING:
    from bubbleskin.contact.held import HeldShape

Array = NDArray[np.float64]

_LOOKS_MM = 0.5
"""Between two looks at the tops, no height alone has changed by more."""
DOUBT_MM = 1.0
"""By how much a top may pass the limit where springs are not the likeliest: softer necks let bubbles rise so much further. A
shape in which another bubble than the likeliest might be lifted passes it by more."""
_LIFTED_MM = 0.02
"""A bubble that is lifted by less is as high as it is alone, which the device bounds."""


class Limits:
    """Of a board: `rest_mm` and `alone_mm` are what a bubble may have alone."""

    def __init__(self, gaps: Gaps, rest_mm: float, alone_mm: float, spare_mm: float = 0.0):
        self.gaps, self.rest_mm, self.alone_mm = gaps, rest_mm, alone_mm
        self._lifted_mm = alone_mm - spare_mm

    def lowered(self, spare_mm: float) -> "Limits":
        """The same with lifted tops `spare_mm` lower."""
        return Limits(self.gaps, self.rest_mm, self.alone_mm, spare_mm)

    def clip(self, alone_mm: Array) -> Array:
        """Heights alone within what a bubble may have, (n,)."""
        return np.clip(alone_mm, self.rest_mm, self.alone_mm)

    def keeps(self, members: "list[HeldShape]", alone_mm: Array) -> bool:
        """Lead all `members` to `alone_mm`, one after another, as long as no lifted bubble passes the limit on the way.

        A top that is above the limit to begin with may come down.
        """
        for number, member in enumerate(members):
            limit = self._lifted_mm + (DOUBT_MM if number else 0.0)
            begin, top = member.alone_mm, member.height_mm
            parts = max(1, int(np.ceil(np.abs(alone_mm - begin).max() / _LOOKS_MM)))
            for part in range(1, parts + 1):
                member.go(begin + member.shares(part / parts) * (alone_mm - begin))
                before, top = top, member.height_mm
                if ((top > limit) & (top > before + _LIFTED_MM) & (member.lift_mm > _LIFTED_MM)).any():
                    return False
        return True
