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
MARGIN_MM = 0.75
"""What lifted tops stay below the limit, with whatever springs they may have: how far a bubble is lifted is known no better, and
those that go fast slide past where they come to rest."""
_LIFTED_MM = 0.02
"""A bubble that is lifted by less is as high as it is alone, which the device bounds."""


class Limits:
    """Of a board: `rest_mm` and `alone_mm` are what a bubble may have alone."""

    def __init__(self, gaps: Gaps, rest_mm: float, alone_mm: float):
        self.gaps, self.rest_mm, self.alone_mm = gaps, rest_mm, alone_mm

    def clip(self, alone_mm: Array) -> Array:
        """Heights alone within what a bubble may have, (n,)."""
        return np.clip(alone_mm, self.rest_mm, self.alone_mm)

    def keeps(self, members: "list[HeldShape]", alone_mm: Array) -> bool:
        """Lead all `members` to `alone_mm`, one after another, as long as no lifted bubble passes the limit on the way.

        A top that is above the limit to begin with may come down.
        """
        for member in members:
            begin, top = member.alone_mm, member.height_mm
            parts = max(1, int(np.ceil(np.abs(alone_mm - begin).max() / _LOOKS_MM)))
            for part in range(1, parts + 1):
                member.go(begin + member.shares(part / parts) * (alone_mm - begin))
                before, top = top, member.height_mm
                if ((self._passed(member) > 0) & (top > before + _LIFTED_MM)).any():
                    return False
        return True

    def passed_mm(self, members: "list[HeldShape]") -> Array:
        """By how much each lifted top passes the limit in any of `members`, (n,); 0 where none does."""
        return np.asarray(np.max([self._passed(member) for member in members], axis=0))

    def _passed(self, member: "HeldShape") -> Array:
        passed = member.height_mm - (self.alone_mm - MARGIN_MM)
        return np.where(member.lift_mm > _LIFTED_MM, passed.clip(0), 0.0)
