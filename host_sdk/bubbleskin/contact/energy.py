"""The energy of bubbles that touch, its gradient and its curvature, compiled: loops over bubbles and pairs.

A state is an (n, 4) array in m: centre x, y, z of each bubble and its outer radius R. Per bubble

    U(R) − P V(R)                      membrane and air (FACTS: 4π r0² h0 W(λ) − P (4/3) π R³)
    ½ kxy |xy − barb|²                 the neck holds sideways
    ½ kz (z − R)²                      up the neck pulls softly (kz_up), down the base pushes (kz_down)

and per pair ½ kc max(0, Ri + Rj − |ci − cj|)². `bubbles` is an array of `BUBBLE`, `springs` one `SPRINGS` record,
`pairs` an (m, 2) array of those that could touch: the work grows with it. `mechanics` is necks, base and contact
alone, for a plant that integrates membranes and air itself. All SI; nothing is checked, nothing allocated. Not cached:
`relax` caches what calls these, together with them.
"""

import math

import numpy as np
from numba import njit

from bubbleskin.membrane import balloon, wall

BUBBLE = np.dtype(
    [(name, "f8") for name in ("x", "y", "mu", "c2", "c3", "thickness", "radius", "inner", "outer")] + [("thick", "?")],
    align=True,
)
"""Barb (m), Yeoh constants, wall, named rest radius, rest radii of inner and outer surface, and the kind of wall."""

SPRINGS = np.dtype([(name, "f8") for name in ("kz_up", "kz_down", "kxy", "kc")])
"""N/m."""

_energy_density = njit(wall.energy_density)
_energy_slope = njit(wall.energy_slope)
_antiderivative = njit(wall._antiderivative)
_yeoh_pressure = njit(balloon.yeoh_pressure)


@njit
def membrane(R, b):  # type: ignore[no-untyped-def]
    """Strain energy, the pressure it holds and that pressure's slope dP/dR, at outer radius R."""
    if not b.thick:
        x = R / b.radius
        J = 2.0 * x * x + x**-4 - 3.0
        dJ = 4.0 * (x - x**-5)
        dW = _energy_slope(x, b.mu, b.c2, b.c3)
        P = _yeoh_pressure(x, b.mu, b.c2, b.c3, b.thickness, b.radius)
        dP = (6.0 * b.c3 * J + 2.0 * b.c2) * dJ * (1.0 / x - x**-7) + dW * (7.0 * x**-8 - x**-2)
        U = 4.0 * math.pi * b.radius**2 * b.thickness * _energy_density(x, b.mu, b.c2, b.c3)
        return U, P, 4.0 * b.thickness / b.radius**2 * dP
    a = (R**3 - b.outer**3 + b.inner**3) ** (1.0 / 3.0)
    xa, xb = a / b.inner, R / b.outer
    P = _antiderivative(xa, b.mu, b.c2, b.c3) - _antiderivative(xb, b.mu, b.c2, b.c3)
    at_a = 4.0 * _energy_slope(xa, b.mu, b.c2, b.c3) * (xa**-2 + xa**-5) * (R / a) ** 2 / b.inner
    at_b = 4.0 * _energy_slope(xb, b.mu, b.c2, b.c3) * (xb**-2 + xb**-5) / b.outer
    W_a, W_b = _energy_density(xa, b.mu, b.c2, b.c3), _energy_density(xb, b.mu, b.c2, b.c3)
    U = 4.0 / 3.0 * math.pi * ((R**3 - b.outer**3) * P + b.outer**3 * W_b - b.inner**3 * W_a)
    return U, P, at_a - at_b


@njit
def mechanics(state, bubbles, springs, pairs, gradient):  # type: ignore[no-untyped-def]
    """Energy (J) of necks, base and contact; their gradient (N) is *added* to `gradient`, (n, 4)."""
    E = 0.0
    for i in range(len(state)):
        dx, dy, q = state[i, 0] - bubbles[i].x, state[i, 1] - bubbles[i].y, state[i, 2] - state[i, 3]
        kz = springs.kz_up if q > 0.0 else springs.kz_down
        E += 0.5 * (springs.kxy * (dx * dx + dy * dy) + kz * q * q)
        gradient[i, 0] += springs.kxy * dx
        gradient[i, 1] += springs.kxy * dy
        gradient[i, 2] += kz * q
        gradient[i, 3] -= kz * q
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        ux, uy, uz = state[i, 0] - state[j, 0], state[i, 1] - state[j, 1], state[i, 2] - state[j, 2]
        reach = state[i, 3] + state[j, 3]
        squared = ux * ux + uy * uy + uz * uz
        if squared >= reach * reach:
            continue
        d = math.sqrt(squared)
        force = springs.kc * (reach - d)
        E += 0.5 * force * (reach - d)
        f = force / max(d, 1e-12)
        gradient[i, 0] -= f * ux
        gradient[i, 1] -= f * uy
        gradient[i, 2] -= f * uz
        gradient[i, 3] += force
        gradient[j, 0] += f * ux
        gradient[j, 1] += f * uy
        gradient[j, 2] += f * uz
        gradient[j, 3] += force
    return E


@njit
def gradient(state, pressure, bubbles, springs, pairs, out):  # type: ignore[no-untyped-def]
    """Energy (J) of the whole at gauge `pressure`, (n,) Pa; its gradient goes to `out`, (n, 4) N."""
    out[:] = 0.0
    E = mechanics(state, bubbles, springs, pairs, out)
    for i in range(len(state)):
        b, R = bubbles[i], state[i, 3]
        U, P, _ = membrane(R, b)
        # Outside and inside bound the same rubber, so dV = 4π R² dR holds for a thick wall too.
        out[i, 3] += 4.0 * math.pi * R * R * (P - pressure[i])
        E += U - pressure[i] * 4.0 / 3.0 * math.pi * (R**3 - b.outer**3 + b.inner**3)
    return E


@njit
def curvature(state, pressure, bubbles, springs, pairs, blocks, contacts):  # type: ignore[no-untyped-def]
    """Prepare `hessian`: 4 by 4 `blocks` of each bubble, (n, 4, 4), and `contacts`, (m, 5).

    A row of `contacts`: direction from j to i, curvature kc along it, and −force/distance across it (0, 0: no contact).
    """
    blocks[:] = 0.0
    for i in range(len(state)):
        R = state[i, 3]
        kz = springs.kz_up if state[i, 2] > R else springs.kz_down
        _, P, dP = membrane(R, bubbles[i])
        B = blocks[i]
        B[0, 0] = B[1, 1] = springs.kxy
        B[2, 2] = kz
        B[2, 3] = B[3, 2] = -kz
        B[3, 3] = kz + 4.0 * math.pi * R * (2.0 * (P - pressure[i]) + R * dP)
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        c = contacts[k]
        reach = state[i, 3] + state[j, 3]
        squared = 0.0
        for a in range(3):
            c[a] = state[i, a] - state[j, a]
            squared += c[a] * c[a]
        c[3] = c[4] = 0.0
        if squared >= reach * reach:
            continue
        d = max(math.sqrt(squared), 1e-12)
        across = -springs.kc * (reach - d) / d
        c[3], c[4] = springs.kc, across
        for a in range(3):
            c[a] /= d
        for e in range(2):
            B = blocks[pairs[k, e]]
            sign = 1.0 - 2.0 * e
            for a in range(3):
                for b in range(3):
                    B[a, b] += (springs.kc - across) * c[a] * c[b]
                B[a, a] += across
                B[a, 3] -= sign * springs.kc * c[a]
                B[3, a] -= sign * springs.kc * c[a]
            B[3, 3] += springs.kc


@njit
def hessian(v, pairs, blocks, contacts, out):  # type: ignore[no-untyped-def]
    """`out` = H v, both (n, 4), from what `curvature` prepared."""
    for i in range(len(v)):
        for a in range(4):
            B = blocks[i, a]
            out[i, a] = B[0] * v[i, 0] + B[1] * v[i, 1] + B[2] * v[i, 2] + B[3] * v[i, 3]
    for k in range(len(pairs)):
        c = contacts[k]
        if c[3] == 0.0:
            continue
        i, j = pairs[k, 0], pairs[k, 1]
        # The part of H that couples i and j: −(∇²) of the distance, and how each one's radius pushes the other.
        ci = c[0] * v[i, 0] + c[1] * v[i, 1] + c[2] * v[i, 2]
        cj = c[0] * v[j, 0] + c[1] * v[j, 1] + c[2] * v[j, 2]
        along = c[3] - c[4]
        for a in range(3):
            out[i, a] -= along * cj * c[a] + c[4] * v[j, a] + c[3] * c[a] * v[j, 3]
            out[j, a] -= along * ci * c[a] + c[4] * v[i, a] - c[3] * c[a] * v[i, 3]
        out[i, 3] += c[3] * (cj + v[j, 3])
        out[j, 3] += c[3] * (v[i, 3] - ci)
