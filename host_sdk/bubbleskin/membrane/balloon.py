"""One inflatable bubble: a spherical Yeoh membrane, with a thin or an exactly thick wall.

The formulas of the wall are plain functions of numbers (:func:`yeoh_pressure` here, the rest in
:mod:`~bubbleskin.membrane.wall`); :class:`YeohBalloon` holds one bubble's constants and sizes and asks them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin.checks import Numbers, finite, like, number, one_of, positive
from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import wall as walls
from bubbleskin.membrane.branches import MonotonePieces

ATMOSPHERE = 101_325.0
"""Standard ambient pressure in Pa; gauge pressures are above it."""

MAX_STRETCH = 10.0
"""Equilibria are looked for up to here: Ecoflex 00-30 breaks at 900 % elongation (data sheet)."""

_UNLIKELY = 100.0
"""Times the rest height: who asks for more has taken mm for m."""

Wall = Literal["thin", "thick"]
Surface = Literal["mid", "inner", "outer"]


def yeoh_pressure(stretch: Any, mu: Any, c2: Any, c3: Any, thickness: Any, radius: Any) -> Any:
    """Gauge pressure (Pa) of a thin spherical Yeoh membrane at ``stretch`` = r/r0: the paper's Eq. 7.

    P = 4 dW/dI (h0 / (λ r0)) (1 − λ⁻⁶) with dW/dI = μ/2 + 2 C2 (I − 3) + 3 C3 (I − 3)² and
    I = 2λ² + λ⁻⁴. ``mu``, ``c2``, ``c3`` in Pa, ``thickness`` h0 and ``radius`` r0 in m. ``mu`` is the
    small-strain shear modulus, twice C1 (the paper's words call it Young's modulus).

    Plain arithmetic, no checks: scalars and numpy arrays, and ``numba.njit`` compiles it unchanged.
    """
    l2 = stretch * stretch
    l4 = l2 * l2
    strain = 2.0 * l2 + 1.0 / l4 - 3.0  # I − 3
    dW = 0.5 * mu + 2.0 * c2 * strain + 3.0 * c3 * strain * strain
    return 4.0 * dW * thickness / (radius * stretch) * (1.0 - 1.0 / (l4 * l2))


class LimitPoint(NamedTuple):
    """A turning point of P(λ): the bubble jumps here when pressure is pushed past it."""

    stretch: float
    pressure: float


class Jump(NamedTuple):
    """A snap at ``pressure`` (Pa) from one stretch to another; ``to_stretch`` is inf if nothing holds it."""

    pressure: float
    from_stretch: float
    to_stretch: float


@dataclass(frozen=True, kw_only=True)
class YeohBalloon:
    """One spherical bubble of Yeoh material. All SI; every method takes scalars or arrays.

    The defaults are the paper's fit and sizes. ``mu`` is the small-strain shear modulus μ (Pa) of
    W = μ/2 (I−3) + C2 (I−3)² + C3 (I−3)³, so C1 = μ/2 and Young's modulus is 3μ;
    :meth:`with_units` takes whichever of the three you have, by name, in kPa and mm.

    ``radius`` (m) is the rest radius of the surface that ``surface`` names. A ``wall="thin"`` has only
    one surface, "mid", and its height is 2r. A ``wall="thick"`` has an inner and an outer one, its
    height is the *outer* diameter, and "stretch" is that of the named surface: 5 mm inner, mid or outer
    diameter are three different bubbles (19.1, 28.1 and 56.2 kPa at a height of 12 mm).

    Raises :class:`~bubbleskin.errors.InvalidInput` for constants and sizes that no bubble has, most often a unit slip.
    """

    mu: float = 39.62e3
    c2: float = 417.3
    c3: float = 60.65
    thickness: float = 1e-3
    radius: float = 2.5e-3
    wall: Wall = "thin"
    surface: Surface = "mid"

    def __post_init__(self) -> None:
        for name in ("mu", "c2", "c3", "thickness", "radius"):
            object.__setattr__(self, name, number(name, getattr(self, name)))
        positive("mu", self.mu, "Pa")
        positive("thickness", self.thickness, "m")
        positive("radius", self.radius, "m")
        if self.c3 < 0:
            raise InvalidInput(
                f"c3 is {self.c3:g} Pa, but must not be negative: the membrane would lose all stiffness "
                "at large stretch. Fit again with C3 bounded, as fit_yeoh does."
            )
        one_of("wall", self.wall, ("thin", "thick"))
        one_of("surface", self.surface, ("mid", "inner", "outer"))
        if self.mu < 100:
            raise InvalidInput(
                f"mu is {self.mu:g} Pa, softer than any elastomer: it is given in Pa (the paper's is "
                "39.62e3). With kPa in hand use YeohBalloon.with_units(mu_kpa=...)."
            )
        if self.radius > 0.5 or self.thickness > 0.1:
            raise InvalidInput(
                f"radius {self.radius:g} m and thickness {self.thickness:g} m are given in metres (the "
                "paper's are 2.5e-3 and 1e-3). With mm in hand use YeohBalloon.with_units(diameter_mm=...)."
            )
        if self.wall == "thin" and self.surface != "mid":
            raise InvalidInput(
                f"a thin wall has one diameter only, so surface={self.surface!r} means nothing to it: "
                "use wall='thick', or surface='mid'."
            )
        if self.inner_radius <= 0:
            raise InvalidInput(
                f"a wall of {self.thickness * 1e3:g} mm leaves no room for air inside a bubble of "
                f"{self.surface} radius {self.radius * 1e3:g} mm: make it thinner or the bubble larger."
            )

    @classmethod
    def with_units(
        cls,
        *,
        mu_kpa: float | None = None,
        c1_kpa: float | None = None,
        young_kpa: float | None = None,
        c2_pa: float,
        c3_pa: float,
        thickness_mm: float,
        diameter_mm: float,
        diameter_is: Surface = "mid",
        wall: Wall = "thin",
    ) -> YeohBalloon:
        """Build a bubble from numbers that carry their unit and their meaning in the name.

        Give exactly one stiffness: the shear modulus ``mu_kpa``, the first Yeoh constant ``c1_kpa`` = μ/2,
        or Young's modulus ``young_kpa`` = 3μ. ``diameter_mm`` is the rest diameter of the surface that
        ``diameter_is`` names: "inner", "mid" or "outer".
        """
        given = {"mu_kpa": mu_kpa, "c1_kpa": c1_kpa, "young_kpa": young_kpa}
        named = {name: value for name, value in given.items() if value is not None}
        if len(named) != 1:
            raise InvalidInput(
                "give exactly one of mu_kpa (shear modulus), c1_kpa (= mu/2) and young_kpa (= 3 mu); "
                f"{' and '.join(named) if named else 'none'} was given."
            )
        ((name, value),) = named.items()
        mu = number(name, value) * 1e3 * {"mu_kpa": 1, "c1_kpa": 2, "young_kpa": 1 / 3}[name]
        return cls(
            mu=mu,
            c2=c2_pa,
            c3=c3_pa,
            thickness=number("thickness_mm", thickness_mm) * 1e-3,
            radius=number("diameter_mm", diameter_mm) * 0.5e-3,
            wall=wall,
            surface=diameter_is,
        )

    # The same constants and sizes by other names.

    @property
    def c1(self) -> float:
        """C1 = μ/2 (Pa), the first constant of the Yeoh energy."""
        return self.mu / 2

    @property
    def young(self) -> float:
        """Young's modulus (Pa) at small strain: 3μ, the material being incompressible."""
        return 3 * self.mu

    @cached_property
    def inner_radius(self) -> float:
        """Rest radius (m) of the surface that the air touches."""
        return walls.rest_radii(self.thickness, self.radius, self.wall, self.surface)[0]

    @cached_property
    def outer_radius(self) -> float:
        """Rest radius (m) of the surface that a finger touches."""
        return walls.rest_radii(self.thickness, self.radius, self.wall, self.surface)[1]

    @property
    def rest_height(self) -> float:
        """Height (m) without pressure: 2 r0 for a thin wall, the outer diameter for a thick one."""
        return 2 * self.outer_radius

    def describe(self) -> str:
        """One sentence with units that says which diameter is meant and what μ is."""
        size = f"{2e3 * self.radius:g} mm {self.surface}-surface diameter"
        if self.wall == "thin":
            size = f"{2e3 * self.radius:g} mm diameter of the membrane (its mid-surface)"
        return (
            f"{self.wall} wall of {1e3 * self.thickness:.4g} mm, {size} at rest; shear modulus "
            f"mu = {self.mu / 1e3:.4g} kPa (C1 = {self.c1 / 1e3:.4g} kPa), C2 = {self.c2:.4g} Pa, "
            f"C3 = {self.c3:.4g} Pa"
        )

    # Functions of the state.

    def pressure(self, stretch: Numbers) -> Numbers:
        """Gauge pressure (Pa) in equilibrium at ``stretch`` (> 0; below 1 it is suction). Paper, Eq. 7."""
        return like(stretch, self._pressure(self._stretch(stretch)))

    def slope(self, stretch: Numbers) -> Numbers:
        """dP/dλ (Pa) at ``stretch``: positive where a pressure-controlled bubble is stable."""
        return like(stretch, self._slope(self._stretch(stretch)))

    def compliance(self, stretch: Numbers) -> Numbers:
        """dh/dP (m/Pa; 1e-6 m/Pa is 1 mm/kPa) at ``stretch``; unbounded at a limit point."""
        x = self._stretch(stretch)
        with np.errstate(divide="ignore"):
            return like(stretch, self._height_slope(x) / self._slope(x))

    def volume(self, stretch: Numbers) -> Numbers:
        """Enclosed air (m³) at ``stretch``: 4/3 π r³, of the inner surface if the wall is thick."""
        inner, _ = self._current_radii(self._stretch(stretch))
        return like(stretch, 4 / 3 * math.pi * inner**3)

    def energy(self, stretch: Numbers) -> Numbers:
        """Strain energy (J) of the whole wall at ``stretch``; dU/dV is the pressure."""
        x = self._stretch(stretch)
        return like(stretch, walls.energy(x, *self._arguments))

    def height(self, stretch: Numbers) -> Numbers:
        """Height above the base plane (m): the outer diameter of the sphere that sits on it."""
        _, outer = self._current_radii(self._stretch(stretch))
        return like(stretch, 2 * outer)

    def stretch_at_height(self, height: Numbers) -> Numbers:
        """Stretch of the named surface when the bubble is ``height`` (m) tall, from the rest height up."""
        h = positive("height", height, "m")
        if np.any(h > _UNLIKELY * self.rest_height):
            raise InvalidInput(
                f"a height of {np.max(h):g} m is beyond every bubble. Heights are in m here: if {np.max(h):g} are mm, "
                f"give {np.max(h) / 1e3:g}."
            )
        if np.any(h < self.rest_height * (1 - 1e-9)):
            raise InvalidInput(
                f"a height of {np.min(h) * 1e3:g} mm is below the rest height of "
                f"{self.rest_height * 1e3:g} mm: a bubble without pressure is already that tall."
            )
        return like(height, walls.stretch_of_outer(h / 2, *self._sizes))

    def pressure_at_height(self, height: Numbers) -> Numbers:
        """Gauge pressure (Pa) that holds the bubble at ``height`` (m). Always single valued."""
        return like(height, self._pressure(np.asarray(self.stretch_at_height(height))))

    @overload
    def is_stable(self, stretch: float, *, line_volume: float = math.inf, polytropic: float = 1.0) -> bool: ...
    @overload
    def is_stable(
        self, stretch: NDArray[np.float64], *, line_volume: float = math.inf, polytropic: float = 1.0
    ) -> NDArray[np.bool_]: ...
    def is_stable(
        self, stretch: ArrayLike, *, line_volume: float = math.inf, polytropic: float = 1.0
    ) -> bool | NDArray[np.bool_]:
        """Whether the state stays where it is when nudged.

        By default behind a pressure regulator: stable where dP/dλ > 0. With a finite ``line_volume`` (m³)
        the air is shut in, bubble and line together, and its own stiffness n P_abs / V_total helps to hold
        states that a regulator cannot: stable where dP/dV + n P_abs / (V + V_line) > 0.
        """
        x = self._stretch(stretch)
        inner, _ = self._current_radii(x)
        V = 4 / 3 * math.pi * inner**3
        dV = 4 * math.pi * inner**2 * walls.radius_slope(x, *self._sizes)[0]
        air = polytropic * (ATMOSPHERE + self._pressure(x)) / (V + line_volume)
        stable = self._slope(x) / dV + air > 0
        return bool(stable) if np.ndim(stretch) == 0 else stable

    # Functions of the pressure: as many answers as there are branches.

    def stretches(self, pressure: ArrayLike) -> NDArray[np.float64]:
        """All stretches ≥ 1 in equilibrium at ``pressure`` (Pa, gauge), ascending.

        A scalar gives a 1-D array with one entry per branch (1 to 3). An array of shape s gives s + (k,),
        k the number of branches that the balloon has anywhere, with nan behind the last one of each row.
        Raises ``InvalidInput`` if a pressure is negative, nan, or higher than every branch.
        """
        p = finite("pressure", pressure)
        if np.any(p < 0):
            raise InvalidInput(
                f"a gauge pressure of {np.min(p) / 1e3:g} kPa is negative: under suction a bubble buckles, "
                "which this model does not describe. Ask for 0 or more."
            )
        pieces = self._pieces
        if np.any(p > pieces.highest):
            raise InvalidInput(
                f"no equilibrium at {np.max(p) / 1e3:g} kPa: up to a stretch of {MAX_STRETCH:g} this bubble "
                f"holds at most {pieces.highest / 1e3:.3f} kPa."
            )
        found = pieces.solve(np.atleast_1d(p))
        return found[0][~np.isnan(found[0])] if np.ndim(pressure) == 0 else found

    def heights(self, pressure: ArrayLike) -> NDArray[np.float64]:
        """All heights (m) in equilibrium at ``pressure``, ascending; else as :meth:`stretches`."""
        _, outer = self._current_radii(self.stretches(pressure))
        return 2 * outer

    def limit_points(self) -> tuple[LimitPoint, ...]:
        """The turning points of P(λ), ascending in λ; empty when the curve is monotonic."""
        return tuple(LimitPoint(x, float(self.pressure(x))) for x in self._pieces.turns)

    def inflation_jump(self) -> Jump | None:
        """Where a rising pressure makes the bubble snap larger, and to where; None if it never does."""
        points = self.limit_points()
        if not points:
            return None
        start = points[0]
        above = [x for x in self.stretches(start.pressure) if x > start.stretch * (1 + 1e-6)]
        return Jump(start.pressure, start.stretch, float(above[-1]) if above else math.inf)

    def deflation_jump(self) -> Jump | None:
        """Where a falling pressure makes the bubble snap smaller, and to where; None if it never does."""
        points = self.limit_points()
        if len(points) < 2:
            return None
        start = points[1]
        return Jump(start.pressure, start.stretch, float(self.stretches(start.pressure)[0]))

    def maxwell_pressure(self) -> float | None:
        """Pressure (Pa) at which small and large state have equal enthalpy U − PV; None if monotonic.

        Equal areas in the P-V plane: below it the small state is the favoured one, above it the large.
        """
        from scipy.optimize import brentq

        points = self.limit_points()
        if len(points) < 2:
            return None

        def excess(p: float) -> float:
            found = self.stretches(p)
            small, large = found[0], found[-1]
            return self.energy(large) - self.energy(small) - p * (self.volume(large) - self.volume(small))

        top, bottom = points[0].pressure, points[1].pressure
        margin = 1e-9 * (top - bottom)
        return float(brentq(excess, max(bottom, 0.0) + margin, top - margin, xtol=1e-9))

    # Without checks, arrays only.

    @property
    def _arguments(self) -> tuple[float, float, float, float, float, Wall, Surface]:
        return self.mu, self.c2, self.c3, *self._sizes

    @property
    def _sizes(self) -> tuple[float, float, Wall, Surface]:
        return self.thickness, self.radius, self.wall, self.surface

    @cached_property
    def _pieces(self) -> MonotonePieces:
        return MonotonePieces(self._pressure, self._slope, 1.0, MAX_STRETCH)

    def _stretch(self, stretch: Any) -> np.ndarray:
        x = positive("stretch", stretch, "")
        smallest = walls.least_stretch(*self._sizes)
        if np.any(x <= smallest):
            raise InvalidInput(
                f"a stretch of {np.min(x):g} would close this thick bubble: it must be above {smallest:.4f}."
            )
        return x

    def _pressure(self, x: np.ndarray) -> np.ndarray:
        if self.wall == "thin":
            return np.asarray(yeoh_pressure(x, self.mu, self.c2, self.c3, self.thickness, self.radius))
        return walls.thick_pressure(x, *self._arguments)

    def _slope(self, x: np.ndarray) -> np.ndarray:
        return walls.slope(x, *self._arguments)

    def _height_slope(self, x: np.ndarray) -> np.ndarray:
        return 2 * walls.radius_slope(x, *self._sizes)[1]

    def _current_radii(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return walls.current_radii(x, *self._sizes)
