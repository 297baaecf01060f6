"""The mechanics of a spherical Yeoh wall, thin or thick, as functions of plain arrays.

Symbols as in the paper: λ stretch, I first invariant, W strain energy density, μ, C2, C3 its constants, h0
rest thickness, r0 rest radius. A and B are the rest radii of the inner and outer surface, a and b the
current ones, S and s those of the surface that the stretch belongs to. Incompressible, so
a³ − A³ = s³ − S³ = b³ − B³. Nothing here checks its input; :mod:`~bubbleskin.membrane.balloon` does.
"""

from __future__ import annotations

import math

import numpy as np

Constant = float | np.ndarray  # an array of constants broadcasts against the stretches

OFFSETS = {"inner": (0.0, 1.0), "mid": (-0.5, 0.5), "outer": (-1.0, 0.0)}
"""Inner and outer rest surface as seen from the named one, in wall thicknesses."""


def rest_radii(h0: float, r0: float, wall: str, surface: str) -> tuple[float, float]:
    """A and B; for a thin wall both are r0."""
    if wall == "thin":
        return r0, r0
    inner, outer = OFFSETS[surface]
    return r0 + inner * h0, r0 + outer * h0


def current_radii(x: np.ndarray, h0: float, r0: float, wall: str, surface: str) -> tuple[np.ndarray, np.ndarray]:
    """A and b, the inner and outer radius at stretch ``x`` of the named surface."""
    if wall == "thin":
        return r0 * x, r0 * x
    A, B = rest_radii(h0, r0, wall, surface)
    grown = r0**3 * (x**3 - 1)
    return np.cbrt(A**3 + grown), np.cbrt(B**3 + grown)


def stretch_of_outer(b: np.ndarray, h0: float, r0: float, wall: str, surface: str) -> np.ndarray:
    """Stretch of the named surface when the outer radius is ``b``."""
    if wall == "thin":
        return b / r0
    _, B = rest_radii(h0, r0, wall, surface)
    return np.cbrt(1 + (b**3 - B**3) / r0**3)


def least_stretch(h0: float, r0: float, wall: str, surface: str) -> float:
    """The stretch at which the inner surface would close; 0 for a thin wall."""
    A, _ = rest_radii(h0, r0, wall, surface)
    return 0.0 if wall == "thin" else float(np.cbrt(max(0.0, 1 - (A / r0) ** 3)))


def radius_slope(x: np.ndarray, h0: float, r0: float, wall: str, surface: str) -> tuple[np.ndarray, np.ndarray]:
    """da/dλ and db/dλ, from a² da = s² ds = b² db."""
    a, b = current_radii(x, h0, r0, wall, surface)
    s2 = r0**3 * x * x
    return s2 / a**2, s2 / b**2


def energy_density(x: np.ndarray, mu: Constant, c2: Constant, c3: Constant) -> np.ndarray:
    """W (J/m³) in equal biaxial stretch. Paper, Eq. 3."""
    J = 2 * x * x + x**-4 - 3
    return ((c3 * J + c2) * J + mu / 2) * J


def energy_slope(x: np.ndarray, mu: Constant, c2: Constant, c3: Constant) -> np.ndarray:
    """dW/dI (Pa) in equal biaxial stretch."""
    J = 2 * x * x + x**-4 - 3
    return (3 * c3 * J + 2 * c2) * J + mu / 2


def energy(
    x: np.ndarray, mu: Constant, c2: Constant, c3: Constant, h0: float, r0: float, wall: str, surface: str
) -> np.ndarray:
    """Strain energy U (J) of the whole wall.

    Thin: 4π r0² h0 W(λ). Thick: ∫ 4πR² W dR, which by parts with R³ = c/(λ³ − 1), c = s³ − S³, becomes
    4π/3 (c P + B³ W(λb) − A³ W(λa)), without a quadrature.
    """
    if wall == "thin":
        return 4 * math.pi * r0**2 * h0 * energy_density(x, mu, c2, c3)
    A, B = rest_radii(h0, r0, wall, surface)
    a, b = current_radii(x, h0, r0, wall, surface)
    P = thick_pressure(x, mu, c2, c3, h0, r0, wall, surface)
    W_a = energy_density(a / A, mu, c2, c3)
    W_b = energy_density(b / B, mu, c2, c3)
    return 4 / 3 * math.pi * (r0**3 * (x**3 - 1) * P + B**3 * W_b - A**3 * W_a)


def slope(
    x: np.ndarray, mu: Constant, c2: Constant, c3: Constant, h0: float, r0: float, wall: str, surface: str
) -> np.ndarray:
    """dP/dλ (Pa), λ the stretch of the named surface."""
    if wall == "thin":
        J = 2 * x * x + x**-4 - 3
        dJ = 4 * (x - x**-5)
        g, dg = 1 / x - x**-7, 7 * x**-8 - x**-2
        dW = (3 * c3 * J + 2 * c2) * J + mu / 2
        return 4 * h0 / r0 * ((6 * c3 * J + 2 * c2) * dJ * g + dW * dg)
    A, B = rest_radii(h0, r0, wall, surface)
    a, b = current_radii(x, h0, r0, wall, surface)
    da, db = radius_slope(x, h0, r0, wall, surface)
    at_a = _integrand(a / A, mu, c2, c3) * da / A
    return at_a - _integrand(b / B, mu, c2, c3) * db / B


def thick_pressure(
    x: np.ndarray, mu: Constant, c2: Constant, c3: Constant, h0: float, r0: float, wall: str, surface: str
) -> np.ndarray:
    """Exact pressure (Pa) of a thick incompressible wall: ∫ W'(λ)/(λ³ − 1) dλ from λb to λa.

    The integrand is 4 dW/dI (λ⁻² + λ⁻⁵), a sum of powers of λ, so the integral is closed.
    """
    A, B = rest_radii(h0, r0, wall, surface)
    a, b = current_radii(x, h0, r0, wall, surface)
    return pressure_antiderivative(a / A, mu, c2, c3) - pressure_antiderivative(b / B, mu, c2, c3)


def _integrand(x: np.ndarray, mu: Constant, c2: Constant, c3: Constant) -> np.ndarray:
    return 4 * energy_slope(x, mu, c2, c3) * (x**-2 + x**-5)


def pressure_antiderivative(x: np.ndarray, mu: Constant, c2: Constant, c3: Constant) -> np.ndarray:
    """∫ 4 dW/dI (λ⁻² + λ⁻⁵) dλ (Pa) at stretch ``x``, which has no thickness in it: see :func:`thick_pressure`.

    Term by term: ∫ (I − 3)^k (λ⁻² + λ⁻⁵) dλ for k = 0, 1, 2. Tests differentiate it with sympy.
    """
    y = 1 / x
    y2, y3 = y * y, y * y * y
    y4 = y2 * y2
    k0 = -y - y4 / 4
    k1 = 2 * x + 3 * y - y2 + (3 / 4) * y4 - y2 * y3 / 5 - y4 * y4 / 8
    k2 = (
        4 / 3 * x * x * x - 12 * x + 4 * np.log(x)
        - 9 * y + 6 * y2 - 4 / 3 * y3 - 9 / 4 * y4 + 6 / 5 * y4 * y - 2 / 3 * y3 * y3
        + 3 / 4 * y4 * y4 - y4 * y4 * y / 9 - y4 * y4 * y4 / 12
    )  # fmt: skip
    return 4 * (mu / 2 * k0 + 2 * c2 * k1 + 3 * c3 * k2)
