"""Bubbles whose air is held: their volumes are given, and where they stand is what neighbours, necks and base make of them.

A device meters air, so what it holds is each bubble's volume, whoever presses it: 2R, the height that the bubble would have
alone. Walls do not come into it. So the balloons here are stiff enough that contact does not change them (by a µm or so), and
the energy, its relaxation and the following of a path are those of every other bubble that touches.
"""

from functools import cache, partial
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin.contact.continuation import PathFollower, Resolution
from bubbleskin.contact.model import KBASE, KC, KXY, KZ, CompliantContact, Shape
from bubbleskin.contact.relax import hold, solve
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon

Array = NDArray[np.float64]

_STIFFER = 100.0
"""Times the paper's wall: a neighbour's push changes a volume a hundredth as much as it does without a valve that holds it."""
_PAPER = YeohBalloon()
_ACCURACY = 1e-6  # of slopes
_SLOPE_MM = 1e-3  # over which pressure by height is differentiated
_FINEST_MM = 0.3
"""An increment of a way changes no height alone by more."""


class Springs(NamedTuple):
    """N/m, as of `CompliantContact`."""

    kz: float
    kxy: float
    kc: float
    kbase: float


PRESET = Springs(KZ, KXY, KC, KBASE)


class HeldShape:
    """Where the bubbles of a layout stand while their volumes change; it has a memory: the path decides.

    Heights are mm: `alone_mm` is 2R of each bubble, (n,), `height_mm` its top above the base plane. A new one stands on its
    barbs with `alone_mm`, of which no two may touch. `kick` (m) and `seed` are those of the random nudges. Its bubbles are truly
    wider than it is told by `offset_mm`, (n,), and go at `pace`, (n,), where others say how far a way has been gone.
    """

    def __init__(
        self,
        model: CompliantContact,
        alone_mm: Array,
        *,
        kick: float | None = None,
        seed: int | None = None,
        offset_mm: Array | float = 0.0,
        pace: Array | float = 1.0,
    ):
        self.model = model
        self._kick = model.kick if kick is None else kick
        self._seed = model.seed if seed is None else seed
        self.offset_mm, self._pace = offset_mm, pace / np.min(pace)
        self._alone_mm = self._true(alone_mm)
        radius = self._alone_mm / 2e3
        self._state = np.column_stack([model.bubbles["x"], model.bubbles["y"], radius, radius])

    def shares(self, share: float) -> Array | float:
        """How far each bubble has gone of a way of which the slowest has gone `share`, 0 to 1, (n,)."""
        return np.minimum(share * self._pace, 1.0)

    def copy(self) -> Self:
        """Another that stands the same."""
        made = object.__new__(type(self))
        made.__dict__.update(self.__dict__)
        return made

    def _true(self, alone_mm: Array) -> Array:
        return np.maximum(alone_mm + self.offset_mm, 2e3 * self.model.bubbles["outer"])

    @property
    def alone_mm(self) -> Array:
        """2R, (n,), as told."""
        return self._alone_mm - self.offset_mm

    @property
    def height_mm(self) -> Array:
        """The tops, (n,)."""
        return np.asarray(1e3 * (self._state[:, 2] + self._state[:, 3]))

    @property
    def lift_mm(self) -> Array:
        """By how much each is higher than it would be alone, (n,)."""
        return self.height_mm - self._alone_mm

    def go(self, alone_mm: Array) -> None:
        """Let all heights alone change in proportion to `alone_mm`, (n,), slowly: every moment of it is an equilibrium."""
        alone_mm = self._true(alone_mm)
        way = float(np.abs(alone_mm - self._alone_mm).max())
        increments = max(1, int(np.ceil(way / _FINEST_MM)))
        follower = PathFollower(
            self.model.bubbles,
            self.model.springs,
            self._state,
            kick=self._kick,
            seed=self._seed,
            resolution=Resolution(increments=increments),
        )
        follower.follow(0, partial(_between, self._alone_mm, alone_mm, self.model.bubbles))
        self._state, self._alone_mm = follower.state, alone_mm

    def slope(self) -> Array | None:
        """∂height/∂alone, (n, n): row i, column j is bubble i's top by bubble j's 2R. None where the shape is about to snap."""
        n = len(self._state)
        bubbles, radius = self.model.bubbles, self._alone_mm / 2e3
        more, less = np.empty(n), np.empty(n)
        hold(radius + _SLOPE_MM / 2e3, bubbles, more)
        hold(radius - _SLOPE_MM / 2e3, bubbles, less)
        rhs, out = np.zeros((n, n, 4)), np.zeros((n, n, 4))
        rhs[np.arange(n), np.arange(n), 3] = 4 * np.pi * radius**2 * (more - less) / (2 * _SLOPE_MM)
        at = PathFollower(bubbles, self.model.springs, self._state)
        at.find_pairs_of_state()
        if not solve(self._state, self._pressure(), bubbles, at.springs, at.pairs, rhs, out, _ACCURACY):
            return None
        return np.asarray(1e3 * (out[:, :, 2] + out[:, :, 3]).T)

    def shape(self) -> Shape:
        """As a `Shape` to plan from."""
        radius = self._alone_mm / 2e3
        return Shape(
            height_mm=self.height_mm,
            position=self._state[:, :3].copy(),
            stretch=radius / self.model.bubbles["radius"],
            contacts=(),
            pressure=self._pressure(),
            radius=self._state[:, 3].copy(),
            snaps=(),
            energy=0.0,
            residual=0.0,
            converged=True,
            increments=0,
        )

    def _pressure(self) -> Array:
        return self.model.free_pressure(self._alone_mm)


def held_model(layout: Layout, springs: Springs, rest_mm: float) -> CompliantContact:
    """The model of contact whose balloons, `rest_mm` high without pressure, hold their volume: heights by 2R."""
    return CompliantContact(layout, _stiff(rest_mm), **springs._asdict())


@cache
def _stiff(rest_mm: float) -> YeohBalloon:
    return YeohBalloon(mu=_STIFFER * _PAPER.mu, c2=_STIFFER * _PAPER.c2, c3=_STIFFER * _PAPER.c3, radius=rest_mm / 2e3)


def _between(begin: Array, end: Array, bubbles: NDArray[np.void], share: float) -> Array:
    held = np.empty(len(begin))
    hold((begin + share * (end - begin)) / 2e3, bubbles, held)
    return np.maximum(held, 0.0)
