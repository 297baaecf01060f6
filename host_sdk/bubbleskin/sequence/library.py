"""Ready-made sequences for any layout. Heights run from `low_mm` to `high_mm`, times are s; `loops` of 0 is without end."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bubbleskin.checks import above_zero, instance, number
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.steps import After, Settled, Step

LOW_MM, HIGH_MM = 5.5, 12.0
_FRAMES = 16  # of one period of a wave


def rings(layout: Layout) -> list[NDArray[np.int64]]:
    """The bubbles by how many neighbours they are from the middle, each ring counterclockwise from the right.

    The first is the bubble nearest to the middle, or those that are equally near. Bubbles without a way to it go by
    their distance in pitches.
    """
    _check(layout)
    away = layout.positions_mm - layout.positions_mm.mean(axis=0)
    distance = np.linalg.norm(away, axis=1)
    ring = np.where(distance < distance.min() + 1e-3 * layout.pitch_mm, 0, -1)
    front = np.flatnonzero(ring == 0).tolist()
    while front:
        near = sorted({other for bubble in front for other in layout.neighbours[bubble] if ring[other] < 0})
        ring[near] = ring[front[0]] + 1
        front = near
    ring = np.where(ring < 0, np.maximum(1, np.rint(distance / layout.pitch_mm)), ring)
    angle = np.round(np.arctan2(away[:, 1], away[:, 0]), 6) % round(2 * np.pi, 6)  # nothing is just below 0
    order = np.lexsort((angle, ring))
    return [order[ring[order] == each] for each in np.unique(ring)]


def pulse(
    layout: Layout,
    *,
    low_mm: float = LOW_MM,
    high_mm: float = HIGH_MM,
    rise: float = 0.8,
    each: float = 0.25,
    rest: float = 0.4,
    rate_hz: float | None = None,
    loops: int = 3,
) -> Sequence:
    """The paper's pulse: the inner bubbles inflate together, then the framing ring one after the other; and back.

    The skin oscillates between its inner bubbles and its outermost ring at their greatest height. `rise`: seconds in
    which several bubbles move together. `each`: of one bubble of the ring. `rest`: at either end. `rate_hz`: how often a
    second all of it comes; it makes the three times longer or shorter alike.
    """
    *inner, outer = rings(layout)
    inside = np.concatenate(inner) if inner else outer
    low, high = _heights(layout, low_mm, high_mm)
    if rate_hz is not None:
        times = np.array([number("rise", rise, 0.0), number("each", each, 0.0), number("rest", rest, 0.0)])
        once = above_zero("The pulse's time", times @ (2, len(outer), 2), unit="s")
        rise, each, rest = (times / (above_zero("rate_hz", rate_hz, unit="Hz") * once)).tolist()
    shape = low.copy()
    shape[inside] = high[inside]
    steps = [Step(shape, rise, "smooth", After(rest), "inner bubbles together")]
    for bubble in outer:
        shape = shape.copy()
        shape[bubble] = high_mm
        steps.append(Step(shape, each, "smooth", name="framing ring"))
    shape = high.copy()
    if inner:
        shape[inside] = low_mm
    steps.append(Step(shape, rise, "smooth", After(rest), "ring alone"))
    return Sequence(steps, loops=loops, name="pulse", layout=layout)


def wave(
    layout: Layout,
    *,
    low_mm: float = LOW_MM,
    high_mm: float = HIGH_MM,
    period: float = 2.0,
    wavelength_mm: float | None = None,
    direction_deg: float = 0.0,
    loops: int = 3,
) -> Sequence:
    """A sine that travels in `direction_deg`, counterclockwise from the right. `wavelength_mm`: None is the layout's size."""
    _check(layout)
    angle = np.deg2rad(number("direction_deg", direction_deg))
    along = layout.positions_mm @ (np.cos(angle), np.sin(angle))
    length = _length(layout, wavelength_mm, np.ptp(along) + layout.pitch_mm)
    return _travelling(layout, along / length, low_mm, high_mm, period, loops, "wave")


def ripple(
    layout: Layout,
    *,
    low_mm: float = LOW_MM,
    high_mm: float = HIGH_MM,
    period: float = 2.0,
    wavelength_mm: float | None = None,
    loops: int = 3,
) -> Sequence:
    """Rings that run outwards from the middle, as on water. `wavelength_mm`: None is the layout's radius."""
    _check(layout)
    distance = np.linalg.norm(layout.positions_mm - layout.positions_mm.mean(axis=0), axis=1)
    length = _length(layout, wavelength_mm, distance.max() + layout.pitch_mm)
    return _travelling(layout, distance / length, low_mm, high_mm, period, loops, "ripple")


def breathing(
    layout: Layout, *, low_mm: float = LOW_MM, high_mm: float = HIGH_MM, period: float = 4.0, loops: int = 3
) -> Sequence:
    """All bubbles rise and fall together, smoothly; out takes longer than in, as of a sleeper."""
    low, high = _heights(layout, low_mm, high_mm)
    period = above_zero("period", period, unit="s")
    steps = [
        Step(high, 0.4 * period, "smooth", After(0.05 * period), "in"),
        Step(low, 0.5 * period, "smooth", After(0.05 * period), "out"),
    ]
    return Sequence(steps, loops=loops, name="breathing", layout=layout)


def pop_up(
    layout: Layout, *, high_mm: float = HIGH_MM, rise: float = 0.5, hold: float = 2.0, loops: int = 1
) -> Sequence:
    """From the middle outwards, each ring once the one before it stands: the neighbours find the middle in their way
    and lift it. The opposite order makes `flat_twin`, of the same targets.
    """
    return _in_order(layout, rings(layout), high_mm, rise, hold, loops, "pop-up")


def flat_twin(
    layout: Layout, *, high_mm: float = HIGH_MM, rise: float = 0.5, hold: float = 2.0, loops: int = 1
) -> Sequence:
    """The targets of `pop_up` in the opposite order, the outermost ring first: nothing lifts the middle."""
    return _in_order(layout, rings(layout)[::-1], high_mm, rise, hold, loops, "flat twin")


LIBRARY: dict[str, Callable[..., Sequence]] = {
    "pulse": pulse,
    "wave": wave,
    "ripple": ripple,
    "breathing": breathing,
    "pop-up": pop_up,
    "flat-twin": flat_twin,
}
"""By the names that the command line knows them by."""


def _in_order(
    layout: Layout, order: list[NDArray[np.int64]], high_mm: float, rise: float, hold: float, loops: int, name: str
) -> Sequence:
    _, high = _heights(layout, 0.0, high_mm)
    shape = np.zeros(len(layout))
    steps = [Step(shape, rise, "smooth", Settled(0.3, 2.0), "flat")]
    for bubbles in order:
        shape = shape.copy()
        shape[bubbles] = high[bubbles]
        steps.append(Step(shape, rise, "smooth", Settled(0.3, 2.0), layout.names(bubbles.tolist())))
    if number("hold", hold, 0.0):
        steps.append(Step(None, until=After(hold), name="hold"))
    return Sequence(steps, loops=loops, name=name, layout=layout)


def _travelling(
    layout: Layout, phase: NDArray[np.float64], low_mm: float, high_mm: float, period: float, loops: int, name: str
) -> Sequence:
    """sin 2π(t/T - phase), sampled often enough that straight ramps between the samples are within 2 % of it."""
    low, high = _heights(layout, low_mm, high_mm)
    period = above_zero("period", period, unit="s")
    time = np.arange(1, _FRAMES + 1) / _FRAMES
    shapes = (low + high) / 2 + (high - low) / 2 * np.sin(2 * np.pi * (time[:, None] - phase))
    edges = np.rint(np.arange(_FRAMES + 1) * period * 1000 / _FRAMES) / 1000  # whole ms, whose sum is the period
    return Sequence(
        [Step(np.round(shape, 3), ramp) for shape, ramp in zip(shapes, np.diff(edges), strict=True)],
        loops=loops,
        name=name,
        layout=layout,
    )


def _heights(layout: Layout, low_mm: float, high_mm: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    _check(layout)
    low_mm, high_mm = number("low_mm", low_mm, 0.0), number("high_mm", high_mm, 0.0)
    if low_mm >= high_mm:
        raise InvalidInput(f"Heights from {low_mm} to {high_mm} mm are asked; low must be 0 or more, and below high.")
    return np.full(len(layout), float(low_mm)), np.full(len(layout), float(high_mm))


def _length(layout: Layout, asked: float | None, own: float) -> float:
    if asked is None:
        return own
    return above_zero("wavelength_mm", asked, unit="mm")


def _check(layout: Layout) -> Layout:
    """Refuse what is no layout before anything is asked of it."""
    return instance("layout", layout, Layout, "a Layout, such as skin.layout or Layout.hexagon()")
