"""Plans: followed again by the model they must end where they say, and the orders must be those that matter."""

import itertools

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.errors import InvalidInput
from bubbleskin.planner.inverse import correct
from bubbleskin.planner.orders import steps_of, three_groups, two_groups

P = 26.69e3
ALL = np.full(7, P)
CENTRE = np.where(np.arange(7) == 0, P, 0.0)
LAYOUT = bs.Layout.hexagon(1)


@pytest.fixture(scope="module")
def model():
    return bs.CompliantContact(LAYOUT)


@pytest.fixture(scope="module")
def up(model):
    return model.settle([CENTRE, ALL])


@pytest.fixture(scope="module")
def down(model):
    return model.settle([ALL - CENTRE, ALL])


def follow(model, plan, start=None, ramp="height"):
    return model.settle([step.pressure for step in plan.steps], start, ramp=ramp).height_mm


def reachable(model, rng, highest=13e-3):
    n = len(model)
    pressure = bs.YeohBalloon().pressure_at_height(rng.uniform(5.5e-3, highest, n))
    group = rng.integers(0, 3, n)
    order = tuple(tuple(np.flatnonzero(group == g)) for g in range(3) if (group == g).any())
    return model.settle(steps_of(order, pressure, np.zeros(n))).height_mm


@pytest.mark.medium
@pytest.mark.parametrize("rings", [1, 2])
def test_shapes_that_can_be_had_are_had(rings):
    model = bs.CompliantContact(bs.Layout.hexagon(rings))
    rng = np.random.default_rng(7)
    for _ in range(6):
        asked = reachable(model, rng)
        plan = bs.plan(asked, model.layout, contact=model)
        assert not plan.unreachable
        assert plan.error_mm < 0.05
        np.testing.assert_allclose(follow(model, plan), plan.predicted_mm, atol=1e-3)
        np.testing.assert_allclose(plan.predicted_mm, asked, atol=0.05)
        assert len(plan.steps) <= 3


def test_centre_on_top_goes_first(model, up):
    plan = bs.plan(up.height_mm, LAYOUT, contact=model)
    assert plan.order == ((0,), (1, 2, 3, 4, 5, 6))
    assert plan.sure
    assert plan.error_mm < 0.05
    np.testing.assert_allclose(plan.steps[-1].pressure, P, rtol=2e-3)
    assert np.abs(model.settle([plan.steps[-1].pressure]).height_mm - up.height_mm).max() > 1  # together does not do it
    said = plan.explain()
    assert "1. Bubble 0 goes first." in said
    assert "which is why bubbles 1, 2, 3, 4, 5 and 6 must go later" in said
    assert "Neighbours squeeze bubbles 1, 2, 3, 4, 5 and 6" in said


def test_what_is_sent_is_the_height_alone(model, up):
    plan = bs.plan(up.height_mm, LAYOUT, contact=model)
    first, last = plan.steps
    np.testing.assert_array_equal(first.target_mm[1:], 0)
    np.testing.assert_allclose(last.target_mm, 1e3 * bs.YeohBalloon().heights(last.pressure)[:, 0], atol=1e-6)
    assert last.predicted_mm[0] > last.target_mm[0] + 1.5


def test_a_branch_that_is_left_and_found_again(model):
    """Bubble 0 hangs between 1 and 4 by 0.7 mm, close to where it falls; Newton overshoots and has to snap back up."""
    pressure = np.array([25.023, 23.848, 21.363, 21.82, 25.353, 21.155, 20.149]) * 1e3
    asked = model.settle(steps_of(((3, 6), (0, 1, 2, 4, 5)), pressure, np.zeros(7))).height_mm
    assert bs.plan(asked, LAYOUT, contact=model).error_mm < 0.05


def test_bubbles_that_do_not_touch_go_together_uncorrected(model):
    asked = np.array([9.0, 6, 7, 8, 9, 7, 6])
    plan = bs.plan(asked, LAYOUT, contact=model)
    assert len(plan.steps) == 1
    np.testing.assert_allclose(plan.steps[0].target_mm, asked, atol=0.03)
    assert "No two bubbles touch" in plan.explain()


@pytest.mark.medium
def test_from_one_shape_to_another(model, up, down):
    """At equal pressures: nothing but a way through other pressures leads from one to the other."""
    for start, end in ((up, down), (down, up)):
        np.testing.assert_allclose(model.settle([end.pressure], start).height_mm, start.height_mm, atol=0.01)
        plan = bs.plan(end.height_mm, LAYOUT, contact=model, start=start)
        assert plan.error_mm < 0.05
        assert len(plan.steps) > 1
        np.testing.assert_allclose(follow(model, plan, start), end.height_mm, atol=0.05)
    assert bs.plan(up.height_mm, LAYOUT, contact=model, start=up).explain().startswith("The array has this shape")
    flat = bs.plan(np.zeros(7), LAYOUT, contact=model, start=up)
    assert len(flat.steps) == 1
    np.testing.assert_allclose(flat.predicted_mm, 5, atol=1e-3)


@pytest.mark.medium
def test_what_cannot_be_had_is_named_with_the_nearest(model):
    plan = bs.plan([18, 5, 5, 5, 5, 5, 5], LAYOUT, contact=model)
    assert plan.unreachable == (0,)
    assert plan.predicted_mm[0] == pytest.approx(14.0, abs=0.01)
    assert (
        "Bubble 0 cannot be 18.0 mm high: the nearest is 14.0 mm; it has all the pressure it may have" in plan.explain()
    )


@pytest.mark.medium
def test_an_even_crowd_buckles(model):
    """13 mm everywhere is no equilibrium at this pitch, in no order."""
    plan = bs.plan(np.full(7, 13.0), LAYOUT, contact=model)
    assert plan.unreachable
    assert plan.error_mm > 0.3
    np.testing.assert_allclose(follow(model, plan), plan.predicted_mm, atol=1e-3)


@pytest.mark.slow
def test_no_more_steps_than_the_best_and_one():
    """Against every order in one, two or three groups, for shapes that need an order."""
    model = bs.CompliantContact(LAYOUT)
    rng = np.random.default_rng(3)
    hard = 0
    while hard < 4:
        asked = reachable(model, rng)
        plan = bs.plan(asked, LAYOUT, contact=model)
        if len(plan.steps) < 2:
            continue
        hard += 1

        def does(steps, plan=plan, asked=asked):
            groups = itertools.product(range(steps), repeat=7)
            orders = (
                tuple(tuple(np.flatnonzero(np.array(g) == k)) for k in range(steps))
                for g in groups
                if len(set(g)) == steps
            )
            paths = (steps_of(order, plan.shape.pressure, np.zeros(7)) for order in orders)
            return any(np.abs(model.settle(p, ramp="height").height_mm - asked).max() < 0.3 for p in paths)

        best = next((k for k in (1, 2, 3) if does(k)), len(plan.steps))
        assert len(plan.steps) <= best + 1


def test_correction_meets_heights_or_comes_nearer(model, up):
    asked = up.height_mm + np.array([0.3, 0.1, -0.1, 0.1, -0.1, 0.1, -0.1])
    found = correct(model, up, asked, model.free_pressure(14.0))
    np.testing.assert_allclose(found.height_mm, asked, atol=0.02)
    far = correct(model, up, np.full(7, 20.0), model.free_pressure(14.0))
    assert np.abs(far.height_mm - 20).sum() < np.abs(up.height_mm - 20).sum()
    assert (far.pressure <= model.free_pressure(14.0) + 1e-6).all()


def test_orders_are_orders(up):
    """Each of the 126 ways to choose a first group of 7, once; and every group of three holds somebody."""
    twos = list(two_groups(up, up.pressure, LAYOUT.neighbours, [0]))
    assert len(twos) == len(set(twos)) == 126
    assert twos[0] == ((0,), (1, 2, 3, 4, 5, 6))
    for order in three_groups(twos[:10], [0]):
        assert sorted(i for group in order for i in group) == list(range(7))


def test_progress_is_told(model, up):
    said = []
    bs.plan(up.height_mm, LAYOUT, contact=model, progress=lambda tried, error: said.append(tried))
    assert said == list(range(1, len(said) + 1))


@pytest.mark.parametrize(
    ("heights", "words"),
    [
        ([8, 8], "2 heights for 7 bubbles"),
        ([np.nan] * 7, "not a number"),
        ([-1] + [8] * 6, "negative"),
        ([30] + [8] * 6, "above the limit"),
        (["high"] * 7, "numbers, not texts"),
    ],
)
def test_heights_that_mean_nothing_are_refused(model, heights, words):
    with pytest.raises(InvalidInput, match=words):
        bs.plan(heights, LAYOUT, contact=model)


def test_models_of_something_else_are_refused(model):
    with pytest.raises(InvalidInput, match="another layout"):
        bs.plan([8.0] * 19, bs.Layout.hexagon(2), contact=model)
    with pytest.raises(InvalidInput, match="other balloons"):
        bs.plan([8.0] * 7, LAYOUT, contact=model, balloon=bs.YeohBalloon(mu=50e3))
    with pytest.raises(InvalidInput, match="3 bubbles"):
        bs.plan([8.0] * 7, LAYOUT, contact=model, start=bs.CompliantContact(bs.Layout.grid(1, 3)).rest())
