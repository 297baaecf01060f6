"""Whether a path ends where it says on wristbands that nobody knows exactly, and between which heights.

A trial follows the path on a sheet that could be the real one: its springs are off within the model's `doubt`, every
bubble is a little larger or smaller than it is taken to be, bubbles hurry ahead and lag behind on the way, and the nudges
are others and larger. The first trials have springs at the corners of what they may be, the others anywhere between.
"""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.contact.continuation import Resolution
from bubbleskin.contact.model import CompliantContact
from bubbleskin.contact.shape import Shape

Array = NDArray[np.float64]

TRIALS = 32
SURE_MM, _SURE_SHARE = 0.5, 0.5
"""A plan is sure where no bubble ends further from what is predicted in any trial, or further than this share of how far it is
lifted: springs that nobody has measured lift more or less, but whom they lift they must not change."""
_SIZE_SD_MM = 0.06
"""Standard deviation of a size: a calibrated wristband's heights are within 0.09 mm RMS, its control's part included."""
_LEAD_SD_MM = 0.05
"""Standard deviation of how far a bubble is ahead of the others or behind on its way."""
_LEADS = (0.5, 0.75, 0.9, 1.0)
"""Shares of a step at which bubbles are ahead or behind; after the last, all arrive."""
_KICK = 1e-5
"""m. Nudges of a trial."""
_WIDER, _FLOOR_MM = 1.25, 0.05
"""An interval is so much wider than what the trials covered, and at least so wide to each side."""
_TRIAL = Resolution(increments=5, move_mm=0.5, halvings=8)


class Interval(NamedTuple):
    """Between which heights each bubble ends, (n,) mm each, as far as trials tell."""

    low_mm: Array
    high_mm: Array
    sure: bool
    """Whether all trials end in the predicted shape."""


def interval(model: CompliantContact, path: Array, start: Shape | None, end: Shape, limit_mm: float) -> Interval:
    """That of the `end` of `path`, (k, n) sizes in mm from `start` on."""
    predicted = end.height_mm
    heights = np.array([predicted, *trials(model, path, start, limit_mm)])
    low = predicted - _WIDER * (predicted - heights.min(axis=0)) - _FLOOR_MM
    high = predicted + _WIDER * (heights.max(axis=0) - predicted) + _FLOOR_MM
    return Interval(low, high, all(_same(end, height) for height in heights))


def is_sure(model: CompliantContact, path: Array, start: Shape | None, end: Shape, limit_mm: float) -> bool:
    """Whether all trials of `path` end as in `end`; it stops at the first that does not."""
    return all(_same(end, height) for height in trials(model, path, start, limit_mm))


def _same(end: Shape, height_mm: Array) -> bool:
    allowed = np.maximum(SURE_MM, _SURE_SHARE * end.lifted_mm)
    return bool((np.abs(height_mm - end.height_mm) <= allowed).all())


def trials(model: CompliantContact, path: Array, start: Shape | None, limit_mm: float) -> Iterator[Array]:
    """Heights at the end of `path` in each trial, (n,) mm; inf where one comes to no rest. The same at every call."""
    rng = np.random.default_rng(model.seed + 1)
    rest = 2e3 * model.bubbles["outer"]
    corners = list(product((-1.0, 1.0), repeat=3))
    for number in range(TRIALS):
        exponents = corners[number] if number < len(corners) else rng.uniform(-1, 1, 3)
        other = model.with_springs(np.exp(exponents @ model.doubt), _KICK, seed=model.seed + number + 1)
        sizes = _perturbed(path, rest if start is None else start.size_mm, rng)
        shape = other.settle_sizes(np.clip(sizes, rest, limit_mm), start, resolution=_TRIAL)
        yield shape.height_mm if shape.converged else np.full(len(rest), np.inf)


def _perturbed(path: Array, begin: Array, rng: np.random.Generator) -> Array:
    """Sizes on `path` as another wristband has them, with the places on each step where bubbles lead or lag, (m, n)."""
    off = rng.normal(0, _SIZE_SD_MM, len(begin))
    places = []
    for end in path:
        moves = np.abs(end - begin) > 0.0
        for share in _LEADS:
            lead = rng.normal(0, _LEAD_SD_MM, len(begin)) * moves
            places.append(begin + share * (end - begin) + lead + off)
        places.append(end + off)
        begin = end
    return np.array(places)
