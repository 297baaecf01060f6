"""The energy of bubbles that touch, its gradient and its curvature, compiled: loops over bubbles and pairs.

A state is an (n, 4) array in m: centre x, y, z of each bubble and its outer radius R. Per bubble

    U(R) − P V(R)                      membrane and air; of a thin wall 4π r0² h0 W(λ) − P (4/3) π R³
    ½ kxy |xy − barb|²                 the neck holds sideways
    ½ kz (z − R)²                      up the neck pulls softly (kz_up), down the base pushes (kz_down)

and per pair ½ kc max(0, Ri + Rj − |ci − cj|)². Where sizes are held and not pressures, ½ grip (R − held R)² stands for
membrane and air: a wristband meters the air of each bubble, so that neighbours hardly make it smaller.

`bubbles` is an array of `BUBBLE`, `springs` one `SPRINGS` record, `pairs` an (m, 2) array of those that could touch: the
work grows with it. `mechanics` is necks, base and contact alone, for a plant that integrates membranes and air itself.
All SI; nothing is checked, nothing allocated. The functions here are not cached on disk by themselves: `relax` caches what
calls them, together with them. `docs/contact.md` explains the energy and where the springs come from.
"""

import math

import numpy as np

from bubbleskin.membrane import balloon, wall
from bubbleskin.native import njit

BUBBLE = np.dtype(
    [(name, "f8") for name in ("x", "y", "mu", "c2", "c3", "thickness", "radius", "inner", "outer")] + [("thick", "?")],
    align=True,
)
"""Barb (m), Yeoh constants, wall, named rest radius, rest radii of inner and outer surface, and the kind of wall."""

SPRINGS = np.dtype([(name, "f8") for name in ("kz_up", "kz_down", "kxy", "kc", "grip")])
"""N/m. `grip` is with which sizes are held; 0 where pressures are."""

_energy_density = njit(wall.energy_density)
_energy_slope = njit(wall.energy_slope)
_pressure_antiderivative = njit(wall.pressure_antiderivative)
_yeoh_pressure = njit(balloon.yeoh_pressure)


@njit
def membrane(R, bubble):  # type: ignore[no-untyped-def]
    """Strain energy U (J), the pressure P (Pa) it holds and dP/dR (Pa/m) of one `bubble` at outer radius `R` (m).

    The formulas are those of `membrane.wall` (the paper's Eq. 3 and 7, and the exact thick wall), by R instead of λ.
    """
    mu, c2, c3 = bubble.mu, bubble.c2, bubble.c3
    if not bubble.thick:
        x = R / bubble.radius
        J = 2.0 * x * x + x**-4 - 3.0
        dJ = 4.0 * (x - x**-5)
        dW = _energy_slope(x, mu, c2, c3)
        P = _yeoh_pressure(x, mu, c2, c3, bubble.thickness, bubble.radius)
        dP = (6.0 * c3 * J + 2.0 * c2) * dJ * (1.0 / x - x**-7) + dW * (7.0 * x**-8 - x**-2)
        U = 4.0 * math.pi * bubble.radius**2 * bubble.thickness * _energy_density(x, mu, c2, c3)
        return U, P, 4.0 * bubble.thickness / bubble.radius**2 * dP
    A, B = bubble.inner, bubble.outer
    a = (R**3 - B**3 + A**3) ** (1.0 / 3.0)
    xa, xb = a / A, R / B
    P = _pressure_antiderivative(xa, mu, c2, c3) - _pressure_antiderivative(xb, mu, c2, c3)
    at_a = 4.0 * _energy_slope(xa, mu, c2, c3) * (xa**-2 + xa**-5) * (R / a) ** 2 / A
    at_b = 4.0 * _energy_slope(xb, mu, c2, c3) * (xb**-2 + xb**-5) / B
    W_a, W_b = _energy_density(xa, mu, c2, c3), _energy_density(xb, mu, c2, c3)
    U = 4.0 / 3.0 * math.pi * ((R**3 - B**3) * P + B**3 * W_b - A**3 * W_a)
    return U, P, at_a - at_b


@njit
def mechanics(state, bubbles, springs, pairs, gradient):  # type: ignore[no-untyped-def]
    """Energy (J) of necks, base and contact; their gradient (N) is *added* to `gradient`, (n, 4)."""
    E = 0.0
    for i in range(len(state)):
        dx, dy, lift = state[i, 0] - bubbles[i].x, state[i, 1] - bubbles[i].y, state[i, 2] - state[i, 3]
        kz = springs.kz_up if lift > 0.0 else springs.kz_down
        E += 0.5 * (springs.kxy * (dx * dx + dy * dy) + kz * lift * lift)
        gradient[i, 0] += springs.kxy * dx
        gradient[i, 1] += springs.kxy * dy
        gradient[i, 2] += kz * lift
        gradient[i, 3] -= kz * lift
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        ux, uy, uz = state[i, 0] - state[j, 0], state[i, 1] - state[j, 1], state[i, 2] - state[j, 2]
        reach = state[i, 3] + state[j, 3]
        squared = ux * ux + uy * uy + uz * uz
        if squared >= reach * reach:
            continue
        distance = math.sqrt(squared)
        force = springs.kc * (reach - distance)
        E += 0.5 * force * (reach - distance)
        force_by_distance = force / max(distance, 1e-12)
        gradient[i, 0] -= force_by_distance * ux
        gradient[i, 1] -= force_by_distance * uy
        gradient[i, 2] -= force_by_distance * uz
        gradient[i, 3] += force
        gradient[j, 0] += force_by_distance * ux
        gradient[j, 1] += force_by_distance * uy
        gradient[j, 2] += force_by_distance * uz
        gradient[j, 3] += force
    return E


@njit
def gradient(state, held, bubbles, springs, pairs, out):  # type: ignore[no-untyped-def]
    """Energy (J) of the whole; its gradient goes to `out`, (n, 4) N.

    `held`, (n,), is the gauge pressure in Pa, or with a `grip` the outer radius in m that each bubble would have alone.
    """
    out[:] = 0.0
    E = mechanics(state, bubbles, springs, pairs, out)
    for i in range(len(state)):
        bubble, R = bubbles[i], state[i, 3]
        if springs.grip > 0.0:
            out[i, 3] += springs.grip * (R - held[i])
            E += 0.5 * springs.grip * (R - held[i]) ** 2
            continue
        U, P, _ = membrane(R, bubble)
        # Outside and inside bound the same rubber, so dV = 4π R² dR holds for a thick wall too.
        out[i, 3] += 4.0 * math.pi * R * R * (P - held[i])
        E += U - held[i] * 4.0 / 3.0 * math.pi * (R**3 - bubble.outer**3 + bubble.inner**3)
    return E


@njit
def curvature(state, held, bubbles, springs, pairs, blocks, contacts):  # type: ignore[no-untyped-def]
    """Prepare `hessian`: 4 by 4 `blocks` of each bubble, (n, 4, 4), and `contacts`, (m, 5).

    An entry of `contacts`: direction from j to i, curvature kc along it, and −force/distance across it (0, 0: no contact).
    """
    blocks[:] = 0.0
    for i in range(len(state)):
        R = state[i, 3]
        kz = springs.kz_up if state[i, 2] > R else springs.kz_down
        block = blocks[i]
        block[0, 0] = block[1, 1] = springs.kxy
        block[2, 2] = kz
        block[2, 3] = block[3, 2] = -kz
        if springs.grip > 0.0:
            block[3, 3] = kz + springs.grip
        else:
            _, P, dP = membrane(R, bubbles[i])
            block[3, 3] = kz + 4.0 * math.pi * R * (2.0 * (P - held[i]) + R * dP)
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        contact = contacts[k]
        reach = state[i, 3] + state[j, 3]
        squared = 0.0
        for a in range(3):
            contact[a] = state[i, a] - state[j, a]
            squared += contact[a] * contact[a]
        contact[3] = contact[4] = 0.0
        if squared >= reach * reach:
            continue
        distance = max(math.sqrt(squared), 1e-12)
        across = -springs.kc * (reach - distance) / distance
        contact[3], contact[4] = springs.kc, across
        for a in range(3):
            contact[a] /= distance
        _stiffen(blocks[i], 1.0, contact)
        _stiffen(blocks[j], -1.0, contact)


@njit
def _stiffen(block, sign, contact):  # type: ignore[no-untyped-def]
    """Add to one bubble's `block` what its own side of `contact` gives; `sign` is 1 for bubble i, −1 for j."""
    along, across = contact[3], contact[4]
    for a in range(3):
        for b in range(3):
            block[a, b] += (along - across) * contact[a] * contact[b]
        block[a, a] += across
        block[a, 3] -= sign * along * contact[a]
        block[3, a] -= sign * along * contact[a]
    block[3, 3] += along


@njit
def hessian(v, pairs, blocks, contacts, out):  # type: ignore[no-untyped-def]
    """`out` = H v, both (n, 4), from what `curvature` prepared."""
    for i in range(len(v)):
        for a in range(4):
            row = blocks[i, a]
            out[i, a] = row[0] * v[i, 0] + row[1] * v[i, 1] + row[2] * v[i, 2] + row[3] * v[i, 3]
    for k in range(len(pairs)):
        contact = contacts[k]
        along, across = contact[3], contact[4]
        if along == 0.0:
            continue
        i, j = pairs[k, 0], pairs[k, 1]
        # The part of H that couples i and j: −(∇²) of the distance, and how each one's radius pushes the other.
        vi = contact[0] * v[i, 0] + contact[1] * v[i, 1] + contact[2] * v[i, 2]
        vj = contact[0] * v[j, 0] + contact[1] * v[j, 1] + contact[2] * v[j, 2]
        excess = along - across
        for a in range(3):
            out[i, a] -= excess * vj * contact[a] + across * v[j, a] + along * contact[a] * v[j, 3]
            out[j, a] -= excess * vi * contact[a] + across * v[i, a] - along * contact[a] * v[i, 3]
        out[i, 3] += along * (vj + v[j, 3])
        out[j, 3] += along * (v[i, 3] - vi)
