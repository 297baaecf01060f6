"""The same physics by other people's means: symbolic derivation, and another library's material."""

import hyperelastic
import numpy as np
import pytest
import sympy as sp

from bubbleskin.membrane import YeohBalloon
from bubbleskin.membrane import wall as walls

X = np.linspace(1.01, 4, 60)


def test_thin_wall_from_virtual_work():
    """P from dU = P dV alone: no stress, no equilibrium of forces, none of the paper's steps."""
    lam, mu, c2, c3, h0, r0 = sp.symbols("lambda mu C2 C3 h0 r0", positive=True)
    F = sp.diag(lam, lam, 1 / lam**2)
    invariant = sp.trace(F * F.T)
    W = mu / 2 * (invariant - 3) + c2 * (invariant - 3) ** 2 + c3 * (invariant - 3) ** 3
    U = 4 * sp.pi * r0**2 * h0 * W
    V = sp.Rational(4, 3) * sp.pi * (r0 * lam) ** 3
    P = sp.diff(U, lam) / sp.diff(V, lam)
    balloon = YeohBalloon()
    numbers = {mu: balloon.mu, c2: balloon.c2, c3: balloon.c3, h0: balloon.thickness, r0: balloon.radius}
    for ours, theirs in (
        (balloon.pressure, P),
        (balloon.slope, sp.diff(P, lam)),
        (balloon.energy, U),
        (balloon.volume, V),
    ):
        values = sp.lambdify(lam, theirs.subs(numbers), "numpy")(X)
        np.testing.assert_allclose(ours(X), values, rtol=1e-12)


@pytest.mark.medium
def test_thick_wall_antiderivative():
    """∫ W'(λ)/(λ³ − 1) dλ term by term: W = Σ c_k (I − 3)^k gives each constant its own integral."""
    x = sp.symbols("x", positive=True)
    J = 2 * x**2 + x**-4 - 3
    for power, constants in ((1, (2.0, 0.0, 0.0)), (2, (0.0, 1.0, 0.0)), (3, (0.0, 0.0, 1.0))):
        integrand = sp.cancel(sp.diff(J**power, x) / (x**3 - 1))
        theirs = sp.lambdify(x, sp.integrate(sp.expand(integrand), x), "numpy")(X)
        ours = walls.pressure_antiderivative(X, *constants)
        np.testing.assert_allclose(ours - ours[0], theirs - theirs[0], rtol=1e-12, atol=1e-12)


def test_material_against_hyperelastic():
    """Cauchy stress in equal biaxial tension, of hyperelastic's Yeoh, through P = 2 σ h / r."""
    balloon = YeohBalloon()
    material = hyperelastic.DeformationSpace(
        hyperelastic.InvariantsFramework(
            hyperelastic.models.invariants.ThirdOrderDeformation(C10=balloon.c1, C20=balloon.c2, C30=balloon.c3)
        )
    )
    for x in np.linspace(1.1, 3.5, 13):
        F = np.diag([x, x, x**-2])
        first_piola, _ = material.gradient([F[:, :, None, None], None])
        sigma = first_piola[:, :, 0, 0] @ F.T
        sigma -= sigma[2, 2] * np.eye(3)  # the free surface fixes the hydrostatic part
        r, h = balloon.radius * x, balloon.thickness / x**2
        assert balloon.pressure(x) == pytest.approx(2 * sigma[0, 0] * h / r, rel=1e-11)
