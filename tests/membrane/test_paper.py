"""The numbers that the paper's constants imply, to the last digit that was published with the project."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from bubbleskin.membrane import YeohBalloon

HEIGHTS_MM = np.arange(6, 15)
PRESSURES_KPA = [17.857, 20.861, 21.297, 21.672, 22.600, 24.252, 26.691, 29.951, 34.064]
COMPLIANCES_MM_KPA = [0.152, 1.026, 4.326, 1.653, 0.784, 0.490, 0.352, 0.272, 0.220]


def test_table_of_heights_and_pressures():
    balloon = YeohBalloon()
    pressures = balloon.pressure_at_height(HEIGHTS_MM * 1e-3)
    assert np.round(pressures / 1e3, 3).tolist() == PRESSURES_KPA
    compliances = balloon.compliance(balloon.stretch_at_height(HEIGHTS_MM * 1e-3))
    assert np.round(compliances * 1e6, 3).tolist() == COMPLIANCES_MM_KPA


def test_flattest_point():
    balloon = YeohBalloon()
    x = np.linspace(1.3, 2.0, 700_001)
    flattest = x[np.argmin(balloon.slope(x))]
    assert round(flattest, 4) == 1.5887
    assert round(balloon.pressure(flattest) / 1e3, 3) == 21.284
    assert round(balloon.compliance(flattest) * 1e6, 3) == 4.356


def test_limit_points_of_the_misread_stiffness():
    low, high = YeohBalloon.with_units(
        c1_kpa=39.62, c2_pa=417.3, c3_pa=60.65, thickness_mm=1, diameter_mm=5
    ).limit_points()
    assert (round(low.stretch, 3), round(low.pressure / 1e3, 3)) == (1.439, 40.563)
    assert (round(high.stretch, 3), round(high.pressure / 1e3, 3)) == (2.030, 38.190)


def test_snap_through_threshold():
    def least_slope(c1: float) -> float:
        return float(YeohBalloon(mu=2 * c1).slope(np.linspace(1.3, 2.0, 20_001)).min())

    threshold = brentq(least_slope, 20e3, 26e3)
    assert round(threshold / 1e3, 2) == 22.98
    assert threshold / YeohBalloon().c1 == pytest.approx(1.16, abs=0.005)
    assert YeohBalloon(mu=2 * threshold - 1).limit_points() == ()
    assert len(YeohBalloon(mu=2 * threshold + 1).limit_points()) == 2


@pytest.mark.parametrize(
    ("surface", "pressure_kpa", "rest_mm"), [("outer", 56.16, 5), ("inner", 19.14, 7), ("mid", 28.06, 6)]
)
def test_what_the_five_millimetres_mean(surface, pressure_kpa, rest_mm):
    balloon = YeohBalloon(wall="thick", surface=surface)
    assert round(balloon.pressure_at_height(12e-3) / 1e3, 2) == pressure_kpa
    assert balloon.rest_height == pytest.approx(rest_mm * 1e-3)
    assert surface in balloon.describe()


@pytest.mark.parametrize("surface", ["outer", "inner", "mid"])
@pytest.mark.parametrize("height_mm", [7.5, 9.0, 12.0, 16.0])
def test_thick_wall_against_quadrature(surface, height_mm):
    balloon = YeohBalloon(wall="thick", surface=surface)
    A, B = balloon.inner_radius, balloon.outer_radius
    b = height_mm * 1e-3 / 2
    a = np.cbrt(b**3 - B**3 + A**3)

    def integrand(x: float) -> float:
        J = 2 * x**2 + x**-4 - 3
        dW = balloon.mu / 2 + 2 * balloon.c2 * J + 3 * balloon.c3 * J**2
        return dW * (4 * x - 4 * x**-5) / (x**3 - 1)

    exact, _ = quad(integrand, b / B, a / A, epsabs=1e-9, epsrel=1e-13)
    assert balloon.pressure_at_height(height_mm * 1e-3) == pytest.approx(exact, rel=1e-11)


def test_thin_wall_is_the_limit_of_the_thick_one():
    x = np.linspace(1.05, 3, 40)
    errors = []
    for thickness in (1e-5, 1e-4):
        thin = YeohBalloon(thickness=thickness).pressure(x)
        thick = YeohBalloon(thickness=thickness, wall="thick").pressure(x)
        errors.append(np.max(np.abs(thick / thin - 1)))
    assert errors[0] < 1e-4
    assert errors[1] / errors[0] == pytest.approx(100, rel=0.1)  # second order about the mid-surface


def test_a_few_percent_of_wall_are_millimetres_of_height():
    """Why every bubble has its own table: at 21.3 kPa, nominally 8 mm."""
    heights = [YeohBalloon(thickness=t * 1e-3).heights(21.3e3)[0] * 1e3 for t in (0.9, 0.95, 1, 1.05, 1.1)]
    assert np.round(heights, 1).tolist() == [10.7, 9.9, 8.0, 6.6, 6.3]
