"""The wall of one bubble: elastic, softened by what it has been through, and slow to forget.

A sphere of rest radius r0 and wall h0, stretched λ in both directions of its surface, (1/λ²) across. With the energy density W of
the undeformed rubber, its stress there (second Piola-Kirchhoff, Pa) is S = (dW/dλ)/(2λ); and from the work of the air,
p dV = 4π r0² h0 dW with dV = 4π r0³ λ² dλ, the wall holds the pressure

    P = h0/(r0 λ²) dW/dλ = 2 h0/(r0 λ) S.
"""

import math


def energy_density(stretch: float, mu: float, c2: float, c3: float) -> float:
    """W in J/m³ of Yeoh's rubber, μ/2 j + C2 j² + C3 j³ with j = 2λ² + λ⁻⁴ − 3."""
    square = stretch * stretch
    j = 2.0 * square + 1.0 / (square * square) - 3.0
    return j * (0.5 * mu + j * (c2 + j * c3))


def elastic_stress(stretch: float, mu: float, c2: float, c3: float) -> float:
    """S = (dW/dλ)/(2λ) in Pa of virgin rubber: dj/dλ = 4λ − 4λ⁻⁵."""
    square = stretch * stretch
    fourth = square * square
    j = 2.0 * square + 1.0 / fourth - 3.0
    return 2.0 * (0.5 * mu + j * (2.0 * c2 + 3.0 * c3 * j)) * (1.0 - 1.0 / (fourth * square))


def softening(energy: float, worst: float, strength: float, width: float) -> float:
    """By what the elastic stress is multiplied at energy density W, after the largest one Wm.

    1 − s tanh((Wm − W)/(w Wm)): pseudo-elasticity of Ogden and Roxburgh (doi 10.1098/rspa.1999.0431) with the tanh of
    Dorfmann and Ogden (doi 10.1016/S0020-7683(03)00089-1). At W = Wm and beyond, the rubber is as it was made.
    """
    if energy >= worst:
        return 1.0
    return 1.0 - strength * math.tanh((worst - energy) / (width * worst))


def branch(strength: float, time: float, h: float) -> tuple[float, float]:
    """A Prony branch over `h` s: what is left of its stress, and what of a change of the elastic one comes to it.

    dQ/dt = g dS/dt − Q/τ by the trapezium, right to second order and stable: Simo's finite viscoelasticity in the stress of the
    undeformed rubber.
    """
    half = 0.5 * h / time
    return (1.0 - half) / (1.0 + half), strength / (1.0 + half)


def wall_pressure(stretch: float, stress: float, thickness: float, radius: float) -> float:
    """P = 2 h0/(r0 λ) S in Pa."""
    return 2.0 * thickness * stress / (radius * stretch)
