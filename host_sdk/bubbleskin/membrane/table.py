"""What the firmware interpolates: height in µm to gauge pressure in Pa, piecewise linear, in integers."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin.checks import finite, instance, shown, whole
from bubbleskin.errors import InvalidInput
from bubbleskin.membrane.balloon import YeohBalloon

MAX_KNOTS = 64
MAX_PRESSURE, MAX_HEIGHT = 0xFFFF, 0xFFFF
"""Pa and µm: a knot is two unsigned 16-bit numbers."""

PRESSURE_TOLERANCE, HEIGHT_TOLERANCE = 2.0, 5.0
"""Pa and µm: the looser of the two holds at every height."""


class TableError(NamedTuple):
    """How far a table is from its balloon: every height is within ``pressure_pa`` or within ``height_um``.

    ``pressure_pa`` is the worst error where 2 Pa is the looser tolerance, ``height_um`` the worst where
    5 µm is; ``share`` is the worst part of the looser tolerance that is used up, so 1 or less is held.
    """

    pressure_pa: float
    height_um: float
    share: float

    @property
    def held(self) -> bool:
        """Whether the looser of 2 Pa and 5 µm holds everywhere."""
        return self.share <= 1.0


@dataclass(frozen=True, eq=False)
class Table:
    """Knots (height in µm, gauge pressure in Pa), heights strictly increasing, at most 64 of them.

    Pressures between knots are :meth:`pressure_at`'s.
    ``balloon`` is the one the table was built from, if it was; it takes no part in comparisons.
    """

    height_um: np.ndarray
    pressure_pa: np.ndarray
    balloon: YeohBalloon | None = field(default=None, repr=False)
    range_um: tuple[int, int] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        h, p = (_integers(name, getattr(self, name)) for name in ("height_um", "pressure_pa"))
        if h.shape != p.shape or h.ndim != 1:
            raise InvalidInput(f"a table needs as many pressures as heights, not {p.size} for {h.size}.")
        if not 2 <= h.size <= MAX_KNOTS:
            raise InvalidInput(f"a table has 2 to {MAX_KNOTS} knots, not {h.size}.")
        falls = np.flatnonzero(np.diff(h) <= 0)
        if falls.size:
            k = int(falls[0])
            raise InvalidInput(
                f"heights must rise from knot to knot, but knot {k + 1} is at {h[k + 1]} µm after {h[k]} µm."
            )
        for name, values, limit, unit in (
            ("height", h, MAX_HEIGHT, "µm"),
            ("pressure", p, MAX_PRESSURE, "Pa"),
        ):
            if values.min() < 0 or values.max() > limit:
                raise InvalidInput(
                    f"a knot's {name} is an unsigned 16-bit number of {unit}, 0 to {limit}; "
                    f"this table has {values.min()} to {values.max()}."
                )
        product = np.abs(np.diff(h) * np.diff(p))
        if product.max() >= 2**31:
            raise InvalidInput(
                f"knots {int(np.argmax(product))} and the next are so far apart that the firmware's 32-bit "
                "interpolation would overflow: put a knot between them."
            )
        h.setflags(write=False)
        p.setflags(write=False)
        object.__setattr__(self, "height_um", h)
        object.__setattr__(self, "pressure_pa", p)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and self.to_bytes() == other.to_bytes()

    def __hash__(self) -> int:
        return self.crc32

    def __repr__(self) -> str:
        low, high = self.height_um[0] / 1000, self.height_um[-1] / 1000
        return f"<Table of {len(self)} knots, {low:g} to {high:g} mm, up to {self.pressure_pa.max() / 1000:.2f} kPa>"

    def __len__(self) -> int:
        return int(self.height_um.size)

    # What the firmware computes from it.

    @overload
    def pressure_at(self, height_um: float) -> int: ...
    @overload
    def pressure_at(self, height_um: NDArray[Any]) -> NDArray[np.int64]: ...
    def pressure_at(self, height_um: ArrayLike) -> int | NDArray[np.int64]:
        """Pressure (Pa) at a height (µm), in integers: p0 + (p1 − p0)(h − h0) // (h1 − h0), floored.

        Below the first knot the first value, above the last one the last. Heights that are not whole are
        rounded first. A scalar gives an int, an array an int64 array.
        """
        h, k = self._segment(height_um)
        h = np.clip(h, self.height_um[0], self.height_um[-1])
        h0, p0 = self.height_um[k], self.pressure_pa[k]
        h1, p1 = self.height_um[k + 1], self.pressure_pa[k + 1]
        p = p0 + (p1 - p0) * (h - h0) // (h1 - h0)
        return int(p) if np.ndim(height_um) == 0 else p

    @overload
    def slope_at(self, height_um: float) -> int: ...
    @overload
    def slope_at(self, height_um: NDArray[Any]) -> NDArray[np.int64]: ...
    def slope_at(self, height_um: ArrayLike) -> int | NDArray[np.int64]:
        """Slope of the segment in Pa per mm, floored, for feed-forward; 0 outside the table."""
        h, k = self._segment(height_um)
        rise = np.diff(self.pressure_pa)[k] * 1000 // np.diff(self.height_um)[k]
        slope = np.where((h < self.height_um[0]) | (h > self.height_um[-1]), 0, rise)
        return int(slope) if np.ndim(height_um) == 0 else slope

    def _segment(self, height_um: Any) -> tuple[np.ndarray, np.ndarray]:
        # The segment that begins at or below the height; the last knot belongs to the last segment.
        h = np.rint(finite("height_um", height_um)).astype(np.int64)
        return h, np.clip(np.searchsorted(self.height_um, h, side="right") - 1, 0, len(self) - 2)

    # What travels and is compared.

    def to_bytes(self) -> bytes:
        """The knots as little-endian unsigned 16-bit pairs h0, p0, h1, p1, ..."""
        return np.stack([self.height_um, self.pressure_pa], axis=1).astype("<u2").tobytes()

    @classmethod
    def from_bytes(cls, data: bytes) -> Table:
        """The table that :meth:`to_bytes` wrote."""
        if len(data) % 4:
            raise InvalidInput(f"a table is 4 bytes per knot; {len(data)} bytes are not.")
        pairs = np.frombuffer(data, dtype="<u2").astype(np.int64).reshape(-1, 2)
        return cls(pairs[:, 0], pairs[:, 1])

    @property
    def crc32(self) -> int:
        """CRC-32 of :meth:`to_bytes`."""
        return zlib.crc32(self.to_bytes())

    def max_error(self, balloon: YeohBalloon | None = None) -> TableError:
        """The achieved bound against ``balloon`` (else the one it was built from), over every µm in range.

        A pressure error e counts as |e / (dP/dh)| of height error. Raises ``InvalidInput`` if no balloon
        is known.
        """
        balloon = balloon or self.balloon
        if balloon is None:
            raise InvalidInput("this table came without a balloon: pass the one to compare it with.")
        low, high = self.range_um or (int(self.height_um[0]), int(self.height_um[-1]))
        h = np.arange(max(low, _rest_um(balloon)), high + 1)
        P, dP = _curve(balloon, h)
        e_p = np.abs(self.pressure_at(h) - P)
        pressure_rules = np.abs(dP) * HEIGHT_TOLERANCE <= PRESSURE_TOLERANCE
        e_h = e_p[~pressure_rules] / np.abs(dP[~pressure_rules])
        worst_p = float(e_p[pressure_rules].max(initial=0.0))
        worst_h = float(e_h.max(initial=0.0))
        return TableError(worst_p, worst_h, max(worst_p / PRESSURE_TOLERANCE, worst_h / HEIGHT_TOLERANCE))


def build_table(balloon: YeohBalloon, *, height_mm: tuple[float, float] = (5.0, 14.0), knots: int = MAX_KNOTS) -> Table:
    """The table with ``knots`` knots that follows ``balloon`` best, from rest up to ``height_mm[1]``.

    The first knot is the rest height at 0 Pa; the bound of :meth:`Table.max_error` is taken over
    ``height_mm``. Knots stand where the curve bends, evenly in error: their density is √(|P''| / tolerance),
    the tolerance being the looser of 2 Pa and 5 µm, and they lie off the curve by half a segment's error,
    which halves it. Raises ``InvalidInput`` if the range is empty or needs more than 65535 Pa.
    """
    instance("balloon", balloon, YeohBalloon, "a YeohBalloon")
    knots = whole("knots", knots, 2, MAX_KNOTS)
    ends = finite("height_mm", height_mm)
    if ends.shape != (2,):
        raise InvalidInput(f"height_mm is {shown(height_mm)}; give two heights, such as (5.0, 14.0).")
    low_mm, high_mm = (float(end) for end in np.clip(ends, -1e6, 1e6))
    first, last = _rest_um(balloon), round(high_mm * 1000)
    low = max(round(low_mm * 1000), first)
    if last - low < knots or last > MAX_HEIGHT:
        raise InvalidInput(
            f"height_mm = ({low_mm:g}, {high_mm:g}) must span more than {knots} µm above the rest height of "
            f"{first / 1000:g} mm and end below {MAX_HEIGHT / 1000:g} mm."
        )
    h = np.arange(first, last + 1)
    P, dP = _curve(balloon, h)
    if P.max() > MAX_PRESSURE - 1:
        reach = h[np.argmax(P > MAX_PRESSURE - 1)]
        raise InvalidInput(
            f"{high_mm:g} mm needs {P.max() / 1e3:.1f} kPa, but a table ends at {MAX_PRESSURE / 1e3:g} kPa: "
            f"end it below {reach / 1000:.2f} mm."
        )
    at = _place(h, dP, knots)
    p = np.rint(P[at] + _offset(h, P, at) + 0.5).astype(np.int64)  # + 0.5: the firmware floors
    p[0] = 0
    return Table(h[at], np.clip(p, 0, MAX_PRESSURE), balloon, (low, last))


def _rest_um(balloon: YeohBalloon) -> int:
    return round(balloon.rest_height * 1e6)


def _curve(balloon: YeohBalloon, height_um: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P (Pa) and dP/dh (Pa/µm); the first whole µm may lie a fraction below rest and counts as rest."""
    stretch = balloon.stretch_at_height(np.maximum(height_um * 1e-6, balloon.rest_height))
    return balloon.pressure(stretch), 1e-6 / balloon.compliance(stretch)


def _place(h: np.ndarray, dP: np.ndarray, knots: int) -> np.ndarray:
    """Indices into ``h`` at which the error of the segments between is even."""
    tolerance = np.maximum(PRESSURE_TOLERANCE, HEIGHT_TOLERANCE * np.abs(dP)) - 1.0  # Pa; 1 for rounding
    density = np.sqrt(np.abs(np.gradient(dP)) / tolerance)
    density += 0.02 * density.mean()  # straight parts get knots too
    count = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    at = np.rint(np.interp(np.linspace(0, count[-1], knots), count, np.arange(h.size))).astype(np.int64)
    steps = np.maximum(np.diff(at), 1)
    return np.concatenate([[0], np.minimum(np.cumsum(steps), h.size - 1 - np.arange(knots - 2, -1, -1))])


def _offset(h: np.ndarray, P: np.ndarray, at: np.ndarray) -> np.ndarray:
    """How far off the curve each knot is best: half the sag of the segments beside it, on average."""
    middle = (at[1:] + at[:-1]) // 2
    share = (middle - at[:-1]) / np.diff(at)
    chord = P[at[:-1]] + (P[at[1:]] - P[at[:-1]]) * share
    sag = P[middle] - chord
    return np.concatenate([[0.0], (sag[1:] + sag[:-1]) / 4, [sag[-1] / 2]])


def _integers(name: str, value: Any) -> np.ndarray:
    array = finite(name, value)
    if np.any(array != np.rint(array)):
        raise InvalidInput(f"{name} must be whole numbers; {array[array != np.rint(array)][0]} is not.")
    return array.astype(np.int64)
