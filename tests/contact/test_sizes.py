"""Bubbles whose sizes are held, as a wristband holds them: against the wristband, differences, and the energy's own limits."""

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.errors import InvalidInput
from bubbleskin.sequence.steps import After, Step

LAYOUT = bs.Layout.hexagon(1)
NEAR = [11.13, 11.06, 10.86, 9.7, 11.64, 10.4, 9.02]
"""mm alone. At the pressures of these bubbles alone the centre stays down at 10.9 mm; with these sizes it is squeezed up."""


@pytest.fixture(scope="module")
def model():
    return bs.CompliantContact(LAYOUT)


@pytest.mark.parametrize("sizes", [[11.5] * 7, NEAR, [9.34, 9.95, 12.21, 11.33, 9.38, 10.73, 10.92]])
def test_a_wristband_holds_sizes_not_pressures(model, sizes):
    """True heights and pressures of the simulated wristband, which is sent the same numbers."""
    shape = model.settle_sizes(sizes)
    with bs.connect("sim://wristband7") as skin:
        skin.play(bs.Sequence([Step(list(sizes), ramp=1.0, until=After(1.0))]), anyway=True)
        np.testing.assert_allclose(shape.height_mm, skin.simulated.height_mm, atol=0.08)
        np.testing.assert_allclose(shape.pressure, skin.simulated.plant.pressure_pa, atol=120)


def test_no_neighbour_makes_a_held_bubble_smaller(model):
    shape = model.settle_sizes([[13.0] * 7])
    np.testing.assert_allclose(shape.size_mm, 13.0, atol=0.02)
    alone = model.free_pressure(13.0)
    assert (shape.pressure > alone).all()
    by_pressure = model.settle([shape.pressure], start=shape)  # The same equilibrium, seen the other way.
    np.testing.assert_allclose(by_pressure.height_mm, shape.height_mm, atol=1e-3)


def test_slope_is_that_of_differences(model):
    sizes = np.array([12.89, 10.19, 10.26, 12.57, 11.34, 10.89, 12.09])
    shape = model.settle_sizes(sizes)
    slope = model.size_slope(shape)
    step = 1e-3
    for j, one in enumerate(step * np.eye(7)):
        numeric = model.settle_sizes(sizes + one, shape).height_mm - model.settle_sizes(sizes - one, shape).height_mm
        np.testing.assert_allclose(slope[:, j], numeric / (2 * step), atol=1e-4)


def test_rubber_that_snaps_is_held_on_its_falling_branch():
    """Ecoflex loses pressure from 7 mm on: at a held pressure it would grow without end, with metered air it stands."""
    model = bs.CompliantContact(LAYOUT, bs.YeohBalloon(mu=15.78e3, c2=91.8, c3=0.0))
    shape = model.settle_sizes([[10.0, 9, 9, 9, 9, 9, 9]])
    assert shape.converged
    np.testing.assert_allclose(shape.size_mm, [10.0, 9, 9, 9, 9, 9, 9], atol=0.01)


@pytest.mark.parametrize("sizes", [[12.0] * 6, [-4.0] + [9.0] * 6, [np.nan] * 7, [26.0] * 7])
def test_sizes_that_no_bubble_has_are_refused(model, sizes):
    with pytest.raises(InvalidInput):
        model.settle_sizes(sizes)
