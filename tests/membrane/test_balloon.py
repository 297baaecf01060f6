"""What holds for every balloon, whatever its constants."""

import math

import numba
import numpy as np
import pytest

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import YeohBalloon, yeoh_pressure


def test_work_of_the_air_is_the_energy_of_the_wall(balloon):
    """dU/dV = P, to 1e-6 from just above rest to four times the size."""
    x = 1 + np.geomspace(1e-3, 3, 400)
    step = 5e-3 * (x - 1)

    def derivative(f):
        # Five points: the error is of fourth order in the step.
        return (8 * (f(x + step) - f(x - step)) - f(x + 2 * step) + f(x - 2 * step)) / (12 * step)

    ratio = derivative(balloon.energy) / derivative(balloon.volume) / balloon.pressure(x)
    assert np.max(np.abs(ratio - 1)) < 1e-6


def test_energy_is_the_integral_of_the_pressure(balloon):
    x = np.linspace(1, 3.5, 20_001)
    work = np.trapezoid(balloon.pressure(x), balloon.volume(x))
    assert balloon.energy(3.5) - balloon.energy(1.0) == pytest.approx(work, rel=1e-7)
    assert balloon.energy(1.0) == pytest.approx(0, abs=1e-15)


def test_slope_and_compliance_are_derivatives(balloon):
    x = np.linspace(1.02, 3.5, 97)
    d = 1e-5
    numeric = (balloon.pressure(x + d) - balloon.pressure(x - d)) / (2 * d)
    scale = np.max(np.abs(numeric))
    np.testing.assert_allclose(balloon.slope(x), numeric, rtol=1e-6, atol=1e-8 * scale)
    dh = (balloon.height(x + d) - balloon.height(x - d)) / (2 * d)
    np.testing.assert_allclose(1 / balloon.compliance(x), balloon.slope(x) / dh, rtol=1e-8)


def test_round_trips_on_every_branch(balloon):
    x = np.linspace(1.001, 3.2, 4001)
    h = balloon.height(x)
    np.testing.assert_allclose(balloon.stretch_at_height(h), x, rtol=1e-12)
    found = balloon.heights(balloon.pressure_at_height(h))
    nearest = np.nanmin(np.abs(found - h[:, None]), axis=1)
    # At a limit point dh/dP is infinite, so what is left there is the square root of rounding.
    away = np.min([np.abs(x - p.stretch) for p in balloon.limit_points()] or [np.ones_like(x)], axis=0)
    assert nearest[away > 0.01].max() < 1e-11
    assert nearest.max() < 1e-8


@pytest.mark.medium
def test_branches_are_all_and_only_the_solutions(balloon):
    """Against a count of sign changes on a fine grid."""
    x = np.linspace(1, 10, 400_001)
    P = balloon.pressure(x)
    rng = np.random.default_rng(0)
    top = min(P.max(), 60e3) * 0.999
    for p in rng.uniform(10, top, 40):
        crossings = np.count_nonzero(np.diff(np.sign(P - p)))
        found = balloon.stretches(p)
        assert found.size == crossings
        assert np.all(np.diff(found) > 0)
        np.testing.assert_allclose(balloon.pressure(found), p, rtol=1e-11)


def test_array_of_pressures_has_a_column_per_branch(balloon):
    pressures = np.array([[0.0, 1e3, 5e3], [6e3, 7e3, 7.6e3]])
    found = balloon.stretches(pressures)
    assert found.shape == (2, 3, len(balloon.limit_points()) + 1)
    for index in np.ndindex(2, 3):
        row = found[index]
        np.testing.assert_array_equal(row[~np.isnan(row)], balloon.stretches(pressures[index]))
    assert found[0, 0, 0] == pytest.approx(1.0, abs=1e-12)


def test_limit_points_turn_the_curve(balloon):
    for k, point in enumerate(balloon.limit_points()):
        sides = balloon.slope(np.array([point.stretch - 1e-4, point.stretch + 1e-4]))
        assert (sides[0] > 0) == (k % 2 == 0)
        assert (sides[1] > 0) == (k % 2 == 1)
        assert point.stretch in balloon.stretches(point.pressure) or np.min(
            np.abs(balloon.stretches(point.pressure) - point.stretch)
        ) == pytest.approx(0, abs=1e-6)


def test_jumps_land_on_a_stable_branch():
    balloon = YeohBalloon(mu=79.24e3)
    low, high = balloon.limit_points()
    up, down = balloon.inflation_jump(), balloon.deflation_jump()
    assert (up.from_stretch, up.pressure) == low
    assert (down.from_stretch, down.pressure) == high
    assert up.to_stretch > high.stretch
    assert down.to_stretch < low.stretch
    for jump in (up, down):
        assert balloon.pressure(jump.to_stretch) == pytest.approx(jump.pressure, rel=1e-12)
        assert balloon.is_stable(jump.to_stretch)


def test_monotonic_balloon_never_jumps():
    balloon = YeohBalloon()
    assert balloon.limit_points() == ()
    assert balloon.inflation_jump() is balloon.deflation_jump() is balloon.maxwell_pressure() is None


def test_balloon_without_stiffening_runs_away():
    balloon = YeohBalloon(c2=0.0, c3=0.0)
    (point,) = balloon.limit_points()
    assert point.stretch == pytest.approx(7 ** (1 / 6), rel=1e-9)  # the neo-Hookean balloon's
    assert math.isinf(balloon.inflation_jump().to_stretch)
    assert balloon.deflation_jump() is None


def test_maxwell_pressure_cuts_equal_areas():
    balloon = YeohBalloon(mu=79.24e3)
    p = balloon.maxwell_pressure()
    low, _, high = balloon.stretches(p)
    x = np.linspace(low, high, 200_001)
    area = np.trapezoid(balloon.pressure(x) - p, balloon.volume(x))
    assert abs(area) < 1e-9 * p * balloon.volume(high)
    points = balloon.limit_points()
    assert points[1].pressure < p < points[0].pressure


def test_stability_under_pressure_and_under_shut_in_air():
    balloon = YeohBalloon(mu=79.24e3)
    x = np.array([1.2, 1.7, 2.5])
    assert balloon.is_stable(x).tolist() == [True, False, True]
    assert balloon.is_stable(x, line_volume=0.0).tolist() == [True, True, True]
    assert not balloon.is_stable(1.7, line_volume=50e-6)  # 50 mL of reservoir: as good as a regulator


def test_scalars_in_scalars_out():
    balloon = YeohBalloon()
    for method in (
        balloon.pressure, balloon.slope, balloon.compliance, balloon.volume, balloon.energy, balloon.height,
    ):  # fmt: skip
        assert type(method(1.5)) is float
        assert method(np.full((2, 3), 1.5)).shape == (2, 3)
    assert type(balloon.pressure_at_height(8e-3)) is float
    assert type(balloon.is_stable(1.5)) is bool
    assert balloon.stretches(20e3).shape == (1,)


@pytest.mark.medium
def test_plain_function_compiles():
    compiled = numba.njit(yeoh_pressure)
    figures = (39.62e3, 417.3, 60.65, 1e-3, 2.5e-3)
    assert compiled(2.4, *figures) == pytest.approx(YeohBalloon().pressure(2.4), rel=1e-15)


def test_constructors_agree_on_the_stiffness():
    sizes = {"c2_pa": 417.3, "c3_pa": 60.65, "thickness_mm": 1.0, "diameter_mm": 5.0}
    one = YeohBalloon.with_units(mu_kpa=39.62, **sizes)
    assert one.mu == pytest.approx(YeohBalloon().mu)
    assert YeohBalloon.with_units(c1_kpa=19.81, **sizes).mu == pytest.approx(one.mu)
    assert YeohBalloon.with_units(young_kpa=3 * 39.62, **sizes).mu == pytest.approx(one.mu)
    assert (one.c1, one.young) == (pytest.approx(19.81e3), pytest.approx(118.86e3))


SIZES = {"c2_pa": 400, "c3_pa": 60, "thickness_mm": 1, "diameter_mm": 5}


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: YeohBalloon(thickness=0), "thickness is 0 m"),
        (lambda: YeohBalloon(thickness=-1e-3), "above zero"),
        (lambda: YeohBalloon(mu=math.nan), "mu is nan"),
        (lambda: YeohBalloon(mu=39.62), "with_units"),
        (lambda: YeohBalloon(radius=2.5), "metres"),
        (lambda: YeohBalloon(thickness=1.0), "metres"),
        (lambda: YeohBalloon(c3=-1), "c3 is -1"),
        (lambda: YeohBalloon(wall="fat"), "'thin', 'thick'"),
        (lambda: YeohBalloon(surface="outer"), "thin wall has one diameter"),
        (lambda: YeohBalloon(wall="thick", surface="outer", thickness=2.5e-3), "no room for air"),
        (lambda: YeohBalloon(mu="soft"), "not texts: 'soft'"),
        (lambda: YeohBalloon(mu=[1e4, 2e4]), "one number"),
        (lambda: YeohBalloon.with_units(mu_kpa=40, c1_kpa=20, **SIZES), "mu_kpa and c1_kpa"),
        (lambda: YeohBalloon.with_units(**SIZES), "none was given"),
        (lambda: YeohBalloon().pressure(-1.0), "stretch is -1"),
        (lambda: YeohBalloon().pressure([1.2, math.nan]), r"nan at index \(1,\)"),
        (lambda: YeohBalloon(wall="thick").pressure(0.5), "close this thick bubble"),
        (lambda: YeohBalloon().pressure_at_height(4e-3), "rest height of 5 mm"),
        (lambda: YeohBalloon().pressure_at_height(-4e-3), "above zero"),
        (lambda: YeohBalloon().stretches(-1.0), "suction"),
        (lambda: YeohBalloon().heights([1e3, math.inf]), "finite"),
        (lambda: YeohBalloon().stretches(5e6), "holds at most 1[0-9]{3}"),
        (lambda: YeohBalloon(c2=0.0, c3=0.0).stretches(20e3), r"holds at most 19\.643 kPa"),
    ],
)
def test_impossible_input_is_refused_in_a_sentence(make, says):
    with pytest.raises(InvalidInput, match=says) as refusal:
        make()
    assert str(refusal.value).endswith(".")
