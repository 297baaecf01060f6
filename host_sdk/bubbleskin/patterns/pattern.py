"""What all patterns are, and what can be done to one: slower, turned, mirrored, shifted, added, multiplied."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.patterns.keyframes import keyframes
from bubbleskin.sequence.library import HIGH_MM, LOW_MM
from bubbleskin.sequence.model import Sequence

Array = NDArray[np.float64]


class Pattern(ABC):
    """Heights over place and time, from 0, the lowest, to 1, the highest; never changed, only made into others.

    Places are in radii of a wristband, so that a pattern fits every layout: the outermost bubble is 1 away from the middle,
    x to the right and y up. Times are s. A pattern's `repr` is its typed form, which `parse` reads.
    """

    @abstractmethod
    def at(self, x: Array, y: Array, t: Array) -> Array:
        """The pattern at places and times whose arrays broadcast."""

    def heights(
        self, layout: Layout, t: ArrayLike, *, low_mm: float = LOW_MM, high_mm: float = HIGH_MM
    ) -> NDArray[np.float64]:
        """The height of each bubble `t` seconds after the start, mm: (n,), or (k, n) for k moments."""
        checks.instance("layout", layout, Layout, "a Layout, such as skin.layout")
        low, high = range_of(low_mm, high_mm)
        moments = checks.finite("t", t)
        x, y = _places(layout)
        with np.errstate(all="ignore"):  # what is beyond every number is refused in words
            share = self.at(x, y, np.atleast_1d(moments)[:, None])
        if not np.isfinite(share).all():
            raise InvalidInput(f"{checks.shown(self)} is beyond every number somewhere; give smaller numbers.")
        heights = low + (high - low) * np.clip(np.broadcast_to(share, (moments.size, len(layout))), 0.0, 1.0)
        return heights if moments.ndim else heights[0]

    def sequence(
        self,
        layout: Layout,
        seconds: float,
        *,
        low_mm: float = LOW_MM,
        high_mm: float = HIGH_MM,
        within_mm: float = 0.1,
        loops: int = 1,
    ) -> Sequence:
        """`seconds` of it as a sequence that the wristband plays by its own clock, `loops` times; 0: until it is stopped.

        Between its keyframes heights ramp; looked at every 10 ms, none is further than `within_mm` from the pattern. It takes a
        second first to get to where the pattern begins. At most 600 s at a time. Raises `InvalidInput` where a repeat would
        have to jump from the end to the beginning.
        """
        range_of(low_mm, high_mm)
        return keyframes(
            lambda t: self.heights(layout, t, low_mm=low_mm, high_mm=high_mm),
            layout,
            seconds,
            within_mm,
            loops,
            repr(self),
        )

    def slow(self, factor: float) -> "Pattern":
        """The same, taking `factor` times as long."""
        return Slow(self, factor)

    def fast(self, factor: float) -> "Pattern":
        """The same, `factor` times as fast."""
        return Fast(self, factor)

    def rotate(self, degrees: float) -> "Pattern":
        """The same, turned counterclockwise around the middle."""
        return Rotate(self, degrees)

    def mirror(self) -> "Pattern":
        """What is right of the middle, on the left as in a mirror too."""
        return Mirror(self)

    def shift(self, x: float = 0.0, y: float = 0.0, seconds: float = 0.0) -> "Pattern":
        """The same, moved by (x, y) radii, and so much later."""
        return Shift(self, x, y, seconds)

    def __add__(self, other: object) -> "Pattern":
        return Sum(self, as_pattern(other))

    def __radd__(self, other: object) -> "Pattern":
        return Sum(as_pattern(other), self)

    def __mul__(self, other: object) -> "Pattern":
        return Product(self, as_pattern(other))

    def __rmul__(self, other: object) -> "Pattern":
        return Product(as_pattern(other), self)


def as_pattern(what: object) -> Pattern:
    """A pattern, or a number from 0 to 1 as the pattern that has it everywhere."""
    return what if isinstance(what, Pattern) else level(what)


def level(share: object) -> Pattern:
    """The same everywhere and always, from 0 to 1."""
    return Level(checks.number("A level", share, 0.0, 1.0))


def range_of(low_mm: float, high_mm: float) -> tuple[float, float]:
    """The heights that 0 and 1 stand for; `InvalidInput` where they are none."""
    low = checks.number("low_mm", low_mm, 0.0, unit="mm")
    return low, checks.number("high_mm", high_mm, low, unit="mm")


def _places(layout: Layout) -> tuple[Array, Array]:
    """Of the bubbles, in radii of the layout; its only bubble is in the middle."""
    away = layout.positions_mm - layout.positions_mm.mean(axis=0)
    radius = np.linalg.norm(away, axis=1).max() or 1.0
    return away[:, 0] / radius, away[:, 1] / radius


def typed(number: float) -> str:
    """A number as one would type it."""
    return repr(int(number)) if number == int(number) and abs(number) < 1e9 else repr(float(number))


@dataclass(frozen=True, repr=False)
class Level(Pattern):
    """See `level`."""

    share: float

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return np.asarray(self.share + 0 * (x + y + t))

    def __repr__(self) -> str:
        return typed(self.share)


@dataclass(frozen=True, repr=False)
class _Changed(Pattern):
    """A pattern of which something is changed; the fields after the first are arguments of the method that does it."""

    of: Pattern

    def __repr__(self) -> str:
        numbers = [(field, getattr(self, field.name)) for field in fields(self)[1:]]
        said = [
            typed(value) if field.default != 0 else f"{field.name}={typed(value)}"
            for field, value in numbers
            if value != field.default
        ]
        before = f"({self.of})" if isinstance(self.of, Level) else repr(self.of)
        return f"{before}.{type(self).__name__.lower()}({', '.join(said)})"


@dataclass(frozen=True, repr=False)
class Slow(_Changed):
    """See `Pattern.slow`."""

    factor: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "factor", checks.above_zero("How many times slower", self.factor))

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return self.of.at(x, y, t / self.factor)


@dataclass(frozen=True, repr=False)
class Fast(_Changed):
    """See `Pattern.fast`."""

    factor: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "factor", checks.above_zero("How many times faster", self.factor))

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return self.of.at(x, y, t * self.factor)


@dataclass(frozen=True, repr=False)
class Rotate(_Changed):
    """See `Pattern.rotate`."""

    degrees: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "degrees", checks.number("The degrees of rotate", self.degrees))

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        cos, sin = np.cos(np.deg2rad(self.degrees)), np.sin(np.deg2rad(self.degrees))
        return self.of.at(cos * x + sin * y, cos * y - sin * x, t)


@dataclass(frozen=True, repr=False)
class Mirror(_Changed):
    """See `Pattern.mirror`."""

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return self.of.at(np.abs(x), y, t)


@dataclass(frozen=True, repr=False)
class Shift(_Changed):
    """See `Pattern.shift`."""

    x: float = 0.0
    y: float = 0.0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        for name in ("x", "y", "seconds"):
            object.__setattr__(self, name, checks.number(f"The {name} of shift", getattr(self, name)))

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return self.of.at(x - self.x, y - self.y, t - self.seconds)


@dataclass(frozen=True, repr=False)
class Sum(Pattern):
    """Both, one on top of the other, up to the highest."""

    one: Pattern
    other: Pattern

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return np.minimum(self.one.at(x, y, t) + self.other.at(x, y, t), 1.0)

    def __repr__(self) -> str:
        return f"({self.one} + {self.other})"


@dataclass(frozen=True, repr=False)
class Product(Pattern):
    """One where the other is high, and nothing where it is low."""

    one: Pattern
    other: Pattern

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return self.one.at(x, y, t) * self.other.at(x, y, t)

    def __repr__(self) -> str:
        return f"({self.one} * {self.other})"
