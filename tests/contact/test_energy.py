"""The energy's terms against their own formulas, its derivatives against differences, and the way downhill."""

import numpy as np
import pytest
import sympy

import bubbleskin as bs
from bubbleskin.contact import energy as core
from bubbleskin.contact.continuation import PathFollower
from bubbleskin.contact.relax import CONVERGED, relax

BALLOONS = {
    "the paper's": bs.YeohBalloon(),
    "snapping": bs.YeohBalloon(mu=79.24e3),
    "thick, inner": bs.YeohBalloon(wall="thick", surface="inner"),
    "thick, mid": bs.YeohBalloon(wall="thick", surface="mid"),
}


def crowded(model, rng, pressure=20e3):
    """A state in which bubbles overlap, hang and stand askew."""
    state = model.rest().state
    n = len(state)
    state[:, :2] += rng.normal(0, 0.5e-3, (n, 2))
    state[:, 3] *= rng.uniform(1.7, 2.6, n)
    state[:, 2] = state[:, 3] + rng.normal(0, 0.8e-3, n)
    return state, rng.uniform(0, pressure, n)


@pytest.fixture(params=list(BALLOONS), scope="module")
def model(request):
    return bs.CompliantContact(bs.Layout.hexagon(1), BALLOONS[request.param])


@pytest.mark.medium
def test_gradient_is_that_of_the_energy(model):
    """Central differences of fourth order, to 1e-6 of the largest force."""
    rng = np.random.default_rng(1)
    for _ in range(3):
        state, pressure = crowded(model, rng)
        g = model.gradient(state, pressure)
        numeric = np.empty_like(g)
        for index in np.ndindex(g.shape):

            def at(h, index=index, state=state, pressure=pressure):
                moved = state.copy()
                moved[index] += h
                return model.energy(moved, pressure)

            h = 2e-6
            numeric[index] = (8 * (at(h) - at(-h)) - at(2 * h) + at(-2 * h)) / (12 * h)
        assert np.abs(g - numeric).max() < 1e-6 * np.abs(g).max()


@pytest.mark.slow
def test_curvature_is_that_of_the_gradient(model):
    rng = np.random.default_rng(2)
    state, pressure = crowded(model, rng)
    follower = PathFollower(model.bubbles, model.springs, state)
    follower.find_pairs(10e-3)
    blocks, contacts = np.empty((7, 4, 4)), np.empty((len(follower.pairs), 5))
    core.curvature(state, pressure, model.bubbles, follower.springs, follower.pairs, blocks, contacts)
    assert (contacts[:, 3] > 0).sum() >= 3  # else nothing is tested
    for _ in range(5):
        v = rng.normal(0, 1, (7, 4))
        Hv = np.empty((7, 4))
        core.hessian(v, follower.pairs, blocks, contacts, Hv)
        h = 1e-8
        numeric = (model.gradient(state + h * v, pressure) - model.gradient(state - h * v, pressure)) / (2 * h)
        np.testing.assert_allclose(Hv, numeric, rtol=0, atol=2e-6 * np.abs(Hv).max())


@pytest.mark.medium
def test_energy_is_the_sum_of_its_terms():
    """Against the formula of docs/contact.md, spelled out in sympy for two bubbles that touch, one of them off its base."""
    x, y, z, R, u, v, w, S = sympy.symbols("x y z R u v w S", real=True)
    mu, c2, c3, h0, r0 = 39.62e3, 417.3, 60.65, 1e-3, 2.5e-3
    P, Q, kz, kbase, kxy, kc, d = 21e3, 18e3, 10, 3000, 50, 300, 10e-3

    def wall(radius):
        stretch = radius / r0
        strain = 2 * stretch**2 + stretch**-4 - 3
        return 4 * sympy.pi * r0**2 * h0 * (mu / 2 * strain + c2 * strain**2 + c3 * strain**3)

    total = (
        wall(R) - P * sympy.Rational(4, 3) * sympy.pi * R**3
        + wall(S) - Q * sympy.Rational(4, 3) * sympy.pi * S**3
        + sympy.Rational(1, 2) * kxy * ((x + d / 2) ** 2 + y**2 + (u - d / 2) ** 2 + v**2)
        + sympy.Rational(1, 2) * (kz * (z - R) ** 2 + kbase * (w - S) ** 2)
        + sympy.Rational(1, 2) * kc * (R + S - sympy.sqrt((x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2)) ** 2
    )  # fmt: skip
    place = {x: -5.4e-3, y: 0.3e-3, z: 6.5e-3, R: 5.8e-3, u: 5.2e-3, v: -0.1e-3, w: 5.3e-3, S: 5.4e-3}
    model = bs.CompliantContact(bs.Layout.grid(1, 2), kz=kz, kxy=kxy, kc=kc, kbase=kbase)
    state = np.array([[place[s] for s in (x, y, z, R)], [place[s] for s in (u, v, w, S)]], float)
    assert model.energy(state, [P, Q]) == pytest.approx(float(total.subs(place).evalf()), rel=1e-12)
    derived = [float(sympy.diff(total, s).subs(place).evalf()) for s in (x, y, z, R, u, v, w, S)]
    np.testing.assert_allclose(model.gradient(state, [P, Q]).ravel(), derived, rtol=1e-10, atol=1e-12)


@pytest.mark.medium
def test_membrane_is_the_physics_one(model):
    balloon, radius = model.balloons[0], np.linspace(1.02, 2.8, 40) * model.balloons[0].outer_radius
    stretch = balloon.stretch_at_height(2 * radius)
    U, P, dP = np.array([core.membrane(r, model.bubbles[0]) for r in radius]).T
    np.testing.assert_allclose(U, balloon.energy(stretch), rtol=1e-10)
    np.testing.assert_allclose(P, balloon.pressure(stretch), rtol=1e-10)
    np.testing.assert_allclose(dP, 2 / balloon.compliance(stretch), rtol=1e-8, atol=1e-3)


def test_energy_never_rises_along_a_relaxation(model):
    rng = np.random.default_rng(3)
    for _ in range(20):
        state, pressure = crowded(model, rng)
        follower = PathFollower(model.bubbles, model.springs, state)
        follower.find_pairs(12e-3)
        trace = np.empty(401)
        ended, force, steps, _ = relax(
            state, pressure, model.bubbles, follower.springs, follower.pairs, 0.3e-3, 1e-7, trace
        )
        assert ended == CONVERGED
        assert force <= 1e-7
        energy = trace[: steps + 1]
        assert energy[0] - energy[-1] > 1e-6
        assert np.diff(energy).max() <= 1e-13 * np.abs(energy).max()


@pytest.mark.medium
def test_plant_needs_only_the_mechanics():
    """What `mechanics` leaves out is air against membrane, along R alone."""
    model = bs.CompliantContact(bs.Layout.hexagon(1))
    state, pressure = crowded(model, np.random.default_rng(4))
    follower = PathFollower(model.bubbles, model.springs, state)
    follower.find_pairs(10e-3)
    g = np.zeros((7, 4))
    core.mechanics(state, model.bubbles, follower.springs, follower.pairs, g)
    rest = model.gradient(state, pressure) - g
    assert np.abs(rest[:, :3]).max() == 0
    R = state[:, 3]
    held = bs.YeohBalloon().pressure(R / 2.5e-3)
    np.testing.assert_allclose(rest[:, 3], 4 * np.pi * R**2 * (held - pressure), rtol=1e-9)
