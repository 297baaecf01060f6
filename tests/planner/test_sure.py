"""What a plan says of itself is true on wristbands that the planner does not know; one that is not sure asks."""

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.errors import InvalidInput

LAYOUT = bs.Layout.hexagon(1)
NEAR = [10.92, 11.04, 10.81, 9.68, 11.92, 10.33, 9.0]
"""mm. A hair's breadth larger, and the centre is squeezed up to 13.4 mm."""
LIFTED = [13.97, 12.0, 12.0, 12.0, 12.0, 12.0, 12.0]


@pytest.fixture(scope="module")
def near():
    return bs.plan(NEAR, LAYOUT)


def play(plan, url):
    with bs.connect(url) as skin:
        skin.play(plan, anyway=True)
        skin.sleep(0.5)
        return skin.simulated.height_mm


def test_a_shape_beside_another_is_not_sure(near):
    assert not near.sure
    assert near.low_mm[0] < 10.92
    assert near.high_mm[0] > 13.0
    assert "Chance has a say" in near.explain()


def test_a_plan_that_is_not_sure_asks(near):
    with bs.connect("sim://wristband7") as skin:
        with pytest.raises(InvalidInput, match="anyway=True"):
            skin.play(near)
        assert skin.state().height_mm.max() < 5.5
        skin.play(near, anyway=True)
        assert skin.simulated.height_mm[0] > 10.5


@pytest.mark.medium
@pytest.mark.parametrize("seed", range(2))
def test_a_sure_plan_ends_within_its_interval(seed):
    plan = bs.plan(LIFTED, LAYOUT)
    assert plan.sure
    true = play(plan, f"sim://wristband7?springs=0.3&seed={seed}")
    assert (plan.low_mm <= true).all()
    assert (true <= plan.high_mm).all()


def test_springs_that_are_known_make_an_interval_narrow():
    model = bs.CompliantContact(LAYOUT)
    wide = bs.plan(LIFTED, LAYOUT, contact=model)
    narrow = bs.plan(LIFTED, LAYOUT, contact=model.with_doubt(1.02))
    assert (narrow.high_mm - narrow.low_mm)[0] < 0.6 * (wide.high_mm - wide.low_mm)[0]


@pytest.mark.slow
def test_of_random_plans_that_are_sure_99_of_100_are_right():
    """On plants whose springs are off by up to 30 %; the truth is the plant's own."""
    model = bs.CompliantContact(LAYOUT)
    rng = np.random.default_rng(11)
    sure = wrong = 0
    while sure < 40:
        first = rng.random(7) < 0.5
        sizes = rng.uniform(5.5, 13.0, 7)
        asked = model.settle_sizes([np.where(first, sizes, 5.0), sizes]).height_mm
        plan = bs.plan(asked, LAYOUT, contact=model)
        if plan.sure and plan.shape.contacts:
            sure += 1
            true = play(plan, f"sim://wristband7?springs=0.3&seed={sure}")
            wrong += bool(((true < plan.low_mm) | (true > plan.high_mm)).any())
    assert wrong == 0
