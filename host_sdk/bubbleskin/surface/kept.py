"""The shape that is kept: where the bubbles stand, from all that was sent and told, because where they came from counts.

Beside the likeliest wristband six others are kept, each with one spring harder or softer and with other nudges: where they
differ, nobody knows better.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bubbleskin.layout import Layout
from bubbleskin.surface.gaps import Gaps

if TYPE_CHECKING:  # scipy and numba come with it, and most shapes need neither
    from bubbleskin.contact.held import HeldShape
    from bubbleskin.contact.model import CompliantContact

Array = NDArray[np.float64]

KICK = 2e-5
"""m. Random nudges of the others: barbs are off by so much."""
VOLUMES_MM = 0.05
"""Standard deviation of heights alone: what a device that was calibrated believes is off by so much at least."""
PACE = 0.04
"""By how much bubbles are faster and slower than asked, RMS: some arrive some ms before others."""
STIR_MM = 0.01
"""What is less makes no difference."""
_FOLLOWED_MM = 0.1
"""The shape is followed to told heights that differ by more; up to there its slope says enough, and noise lifts nobody."""
_SLOPED_MM = 0.2  # by what slopes correct at most: where a shape is about to snap they say nothing


class KeptShape:
    """The bubbles of one wristband. Before the first look it knows nothing: `alone_mm` is None.

    `members` are the likeliest and its doubles; empty while the bubbles are apart, when each is as high as it is alone.
    """

    def __init__(self, layout: Layout, gaps: Gaps, rest_mm: float):
        self._layout, self._rest_mm = layout, rest_mm
        self.gaps = gaps
        self.alone_mm: Array | None = None
        """2R, (n,)."""
        self.known = False
        """Whether the way is known on which they came here, or none matters."""
        self.members: list[HeldShape] = []
        self._slope: Array | None = None  # of the likeliest where it is
        self._sd_of: tuple[Array, Array] | None = None  # what it was asked with, and the answer

    def forget(self) -> None:
        """Another wristband may be there, or the same after a restart."""
        self.alone_mm, self.known, self.members = None, False, []

    def go(self, alone_mm: Array) -> None:
        """All bubbles have gone to these heights alone, (n,) mm, straight from where they were."""
        if self.gaps.apart(alone_mm):
            self.alone_mm, self.known, self.members = alone_mm, True, []
            return
        if not self.members or np.abs(alone_mm - self.members[0].alone_mm).max() > _FOLLOWED_MM:
            for member in self._begun():
                member.go(alone_mm)
            self._slope = self._sd_of = None
        self.alone_mm = alone_mm

    def begun(self) -> "list[HeldShape]":
        """Copies of all members to try a way with, (7,)."""
        return [member.copy() for member in self._begun()]

    def copy(self) -> "KeptShape":
        """Another that stands the same."""
        made = KeptShape(self._layout, self.gaps, self._rest_mm)
        made.alone_mm, made.known = self.alone_mm, self.known
        made.members = [member.copy() for member in self.members]
        return made

    def take(self, members: "list[HeldShape]") -> None:
        """Be as the members of a way that has been tried are at its end."""
        self.alone_mm, self._slope, self._sd_of = members[0].alone_mm, None, None
        apart = self.gaps.apart(self.alone_mm)
        self.known, self.members = self.known or apart, [] if apart else members

    def _begun(self) -> "list[HeldShape]":
        if not self.members:
            flat = np.full(len(self._layout), self._rest_mm)
            self.members = doubles(self._layout, flat if self.alone_mm is None else self.alone_mm, self._rest_mm)
        return self.members

    @property
    def lift_mm(self) -> Array:
        """How much higher each bubble is than alone, (n,)."""
        if not self.members or self.alone_mm is None:
            return np.zeros(len(self._layout))
        likeliest = self.members[0]
        off = self.alone_mm - likeliest.alone_mm
        return likeliest.lift_mm + (self._slopes() @ off - off).clip(-_SLOPED_MM, _SLOPED_MM)

    def _slopes(self) -> Array:
        """∂top/∂size, (n, n); where the shape is about to snap, that of bubbles alone."""
        if self._slope is None:
            slope = self.members[0].slope()
            self._slope = np.eye(len(self._layout)) if slope is None else slope
        return self._slope

    def sd_mm(self, alone_sd_mm: Array) -> Array:
        """Standard deviation of the tops, (n,): of volumes known to `alone_sd_mm`, and of springs; nan where nothing is known."""
        if not self.members:
            return alone_sd_mm
        if self._sd_of is None or not np.array_equal(self._sd_of[0], alone_sd_mm):
            self._sd_of = alone_sd_mm, self._deviation(alone_sd_mm)
        return self._sd_of[1]

    def _deviation(self, alone_sd_mm: Array) -> Array:
        slope = self._slopes()
        tops = np.array([member.height_mm for member in self.members])
        offsets = np.array([member.offset_mm for member in self.members[1:]])
        # Of each spring twice, harder and softer. What their volumes do is in the other term.
        springs = ((tops[1:] - tops[0] - offsets @ slope.T) ** 2).sum(axis=0) / 2
        sd = np.sqrt(slope**2 @ alone_sd_mm**2 + springs)
        if not self.known and self.alone_mm is not None:
            sd[self.gaps.touching(self.alone_mm) | (np.abs(self.lift_mm) > STIR_MM)] = np.nan
        return np.asarray(sd)


def doubles(layout: Layout, alone_mm: Array, rest_mm: float) -> "list[HeldShape]":
    """The likeliest, then two for each spring: harder, softer. No two bubbles touch at `alone_mm`, (n,)."""
    from bubbleskin.contact.held import HeldShape

    likeliest, *others = _models(layout, rest_mm)
    made = [HeldShape(likeliest, alone_mm)]
    for number, model in enumerate(others, 1):
        rng = np.random.default_rng(number)
        offset = rng.normal(0.0, VOLUMES_MM, len(layout))
        pace = 1.0 + rng.normal(0.0, PACE, len(layout))
        made.append(HeldShape(model, alone_mm, offset_mm=offset, pace=pace))
    return made


def _models(layout: Layout, rest_mm: float) -> "list[CompliantContact]":
    from bubbleskin.contact.model import DOUBT, CompliantContact
    from bubbleskin.membrane import YeohBalloon

    likeliest = CompliantContact(layout, YeohBalloon(radius=rest_mm / 2e3))
    sd = (DOUBT - 1) / 3**0.5  # of springs of which any within the doubt is as likely
    factors = [1 + sign * change for change in sd * np.eye(3) for sign in (1, -1)]
    return [likeliest, *(likeliest.with_springs(one, KICK, seed) for seed, one in enumerate(factors, 1))]
