"""The words that patterns are made of: ripple, wave, pulse, noise and seq."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.patterns.pattern import Array, Pattern, as_pattern, typed

_SEED_MAX = checks.SEED_MAX
_WAVES = 6
"""Plane waves that noise is the sum of."""
_RING = (0.70, 0.84)
"""Between these radii the inner bubbles of a pulse end and its ring begins: between two rings of every hexagon up to 91."""
# When what of a pulse happens, in shares of its period.
_RISEN = 0.20
"""The inner bubbles stand, and the ring of the turn before is down."""
_AROUND = 0.35
"""How long it takes until the last of the ring begins to rise."""
_EACH = 0.15
"""How long one place of the ring rises."""
_SINKS, _SUNK = 0.72, 0.92
"""From when to when the inner bubbles go down and leave the ring alone."""


@dataclass(frozen=True, repr=False)
class _Word(Pattern):
    """A word and its arguments."""

    def __repr__(self) -> str:
        said = [
            f"{field.name}={typed(getattr(self, field.name))}"
            for field in fields(self)
            if getattr(self, field.name) != field.default
        ]
        return f"{type(self).__name__.lower()}({', '.join(said)})"

    def _above_zero(self, *names: str) -> None:
        for name in names:
            said = f"The {name} of {type(self).__name__.lower()}"
            object.__setattr__(self, name, checks.above_zero(said, getattr(self, name)))


@dataclass(frozen=True, repr=False)
class Ripple(_Word):
    """See `ripple`."""

    wavelength: float = 1.0
    period: float = 2.0

    def __post_init__(self) -> None:
        self._above_zero("wavelength", "period")

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return _sine(t / self.period - np.hypot(x, y) / self.wavelength)


@dataclass(frozen=True, repr=False)
class Wave(_Word):
    """See `wave`."""

    wavelength: float = 2.0
    period: float = 2.0

    def __post_init__(self) -> None:
        self._above_zero("wavelength", "period")

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        return _sine(t / self.period - x / self.wavelength + 0 * y)


@dataclass(frozen=True, repr=False)
class Pulse(_Word):
    """See `pulse`."""

    period: float = 4.0

    def __post_init__(self) -> None:
        self._above_zero("period")

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        share = t / self.period % 1.0
        turn = np.round(np.arctan2(y, x) / (2 * np.pi), 6) % 1.0  # nothing is just below 0
        inner = _smooth(share / _RISEN) - _smooth((share - _SINKS) / (_SUNK - _SINKS))
        ring = 1 - _smooth(share / _RISEN) + _smooth((share - _RISEN - _AROUND * turn) / _EACH)
        outside = _smooth((np.hypot(x, y) - _RING[0]) / (_RING[1] - _RING[0]))
        return (1 - outside) * inner + outside * ring


@dataclass(frozen=True, repr=False)
class Noise(_Word):
    """See `noise`."""

    size: float = 1.0
    period: float = 8.0
    seed: int = 0

    def __post_init__(self) -> None:
        self._above_zero("size", "period")
        object.__setattr__(self, "seed", checks.whole("The seed of noise", self.seed, 0, _SEED_MAX))

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        random = np.random.default_rng(self.seed)
        total = 0 * (x + y + t)
        for wave in range(_WAVES):
            angle, start, length = random.random(3) * (2 * np.pi, 1.0, 0.5)
            along = (x * np.cos(angle) + y * np.sin(angle)) / (2 * self.size * (0.75 + length))
            total = total + np.sin(2 * np.pi * (along + start - (1 + wave % 2) * t / self.period))
        return 0.5 + 0.5 * np.tanh(total / np.sqrt(_WAVES / 2))


@dataclass(frozen=True, repr=False)
class Seq(Pattern):
    """See `seq`."""

    parts: tuple[Pattern, ...]
    each: float = 1.0
    fade: float = 0.5

    def __post_init__(self) -> None:
        if len(self.parts) < 2:
            raise InvalidInput(f"A seq of {len(self.parts)} patterns; give two or more, such as seq(ripple(), wave()).")
        object.__setattr__(self, "each", checks.above_zero("The each of seq", self.each, unit="s"))
        object.__setattr__(self, "fade", checks.above_zero("The fade of seq", self.fade, self.each, "s"))

    def at(self, x: Array, y: Array, t: Array) -> Array:
        """See `Pattern.at`."""
        total = 0 * (x + y + t)
        for turn, part in enumerate(self.parts):
            own = (t - turn * self.each + self.fade) % (len(self.parts) * self.each) - self.fade
            weight = _smooth((own + self.fade) / self.fade) - _smooth((own - self.each + self.fade) / self.fade)
            total = total + weight * part.at(x, y, own)
        return total

    def __repr__(self) -> str:
        said = [repr(part) for part in self.parts]
        said += [] if self.each == 1.0 else [f"each={typed(self.each)}"]
        said += [] if self.fade == 0.5 else [f"fade={typed(self.fade)}"]
        return f"seq({', '.join(said)})"


def ripple(wavelength: float = 1.0, period: float = 2.0) -> Pattern:
    """Rings that run outwards from the middle, as on water; `wavelength` in radii of the wristband, `period` in s."""
    return Ripple(wavelength, period)


def wave(wavelength: float = 2.0, period: float = 2.0) -> Pattern:
    """A sine that runs to the right; `wavelength` in radii of the wristband, `period` in s."""
    return Wave(wavelength, period)


def pulse(period: float = 4.0) -> Pattern:
    """The paper's pulse: the inner bubbles together, then the framing ring one after the other; within `period` seconds."""
    return Pulse(period)


def noise(size: float = 1.0, period: float = 8.0, seed: int = 0) -> Pattern:
    """Hills that come and go, some `size` radii wide; after `period` seconds they are as before. `seed`: which ones."""
    return Noise(size, period, seed)


def seq(*parts: Pattern | float, each: float = 1.0, fade: float = 0.5) -> Pattern:
    """One pattern after the other, `each` so many seconds, and from the first again; each begins where it is at 0 s.

    A number from 0 to 1 is the same height everywhere. In the last `fade` seconds of each, the next one takes over.
    """
    return Seq(tuple(as_pattern(part) for part in parts), each, fade)


WORDS: dict[str, Callable[..., Any]] = {"ripple": ripple, "wave": wave, "pulse": pulse, "noise": noise, "seq": seq}
"""By their names."""


def _sine(turns: Array) -> Array:
    return 0.5 + 0.5 * np.sin(2 * np.pi * turns)


def _smooth(share: Array) -> Array:
    """From 0 to 1 while `share` is, with level ends."""
    p = np.clip(share, 0.0, 1.0)
    return p * p * (3 - 2 * p)
