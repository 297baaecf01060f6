"""Plans: followed again by the model they must end where they say, and the orders must be those that matter."""

import itertools

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.errors import InvalidInput
from bubbleskin.planner.inverse import correct
from bubbleskin.planner.orders import layers, one_by_one, steps_of, three_groups, two_groups, variants

ALL = np.full(7, 12.0)
CENTRE = np.where(np.arange(7) == 0, 12.0, 5.0)
RING = np.where(np.arange(7) == 0, 5.0, 12.0)
REST = np.full(7, 5.0)
LAYOUT = bs.Layout.hexagon(1)


@pytest.fixture(scope="module")
def model():
    return bs.CompliantContact(LAYOUT)


@pytest.fixture(scope="module")
def up(model):
    return model.settle_sizes([CENTRE, ALL])


@pytest.fixture(scope="module")
def down(model):
    return model.settle_sizes([RING, ALL])


def follow(model, plan, start=None):
    return model.settle_sizes([step.target_mm for step in plan.steps], start).height_mm


def reachable(model, rng, groups=3):
    n = len(model)
    group = rng.integers(0, groups, n)
    order = tuple(tuple(np.flatnonzero(group == g)) for g in range(groups) if (group == g).any())
    return model.settle_sizes(steps_of(order, rng.uniform(5.5, 13, n), np.full(n, 5.0))).height_mm


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
        assert len(plan.steps) <= 4


def test_centre_on_top_goes_first(model, up):
    plan = bs.plan(up.height_mm, LAYOUT, contact=model)
    assert plan.order == ((0,), (1, 2, 3, 4, 5, 6))
    assert plan.sure
    assert plan.error_mm < 0.05
    np.testing.assert_allclose(plan.steps[-1].target_mm, 12.0, atol=0.03)
    assert np.abs(model.settle_sizes([ALL]).height_mm - up.height_mm).max() > 1  # together does not do it
    said = plan.explain()
    assert "1. Bubble 0 goes first." in said
    assert "which is why bubbles 1, 2, 3, 4, 5 and 6 must go later" in said
    assert "Less is sent for bubble 0 than asked, since neighbours lift" in said
    assert "Sure: " in said


def test_what_is_sent_is_the_height_alone(model, up):
    plan = bs.plan(up.height_mm, LAYOUT, contact=model)
    first, last = plan.steps
    np.testing.assert_array_equal(first.target_mm[1:], 0)
    assert (last.pressure > model.free_pressure(last.target_mm)).all()  # neighbours press on all of them
    assert last.predicted_mm[0] > last.target_mm[0] + 1.5


def test_bubbles_that_do_not_touch_go_together_uncorrected(model):
    asked = np.array([9.0, 6, 7, 8, 9, 7, 6])
    plan = bs.plan(asked, LAYOUT, contact=model)
    assert len(plan.steps) == 1
    np.testing.assert_allclose(plan.steps[0].target_mm, asked, atol=0.03)
    assert "No two bubbles touch" in plan.explain()


@pytest.mark.medium
def test_from_one_shape_to_another(model, up, down):
    """At equal sizes: nothing but a way through other sizes leads from one to the other."""
    for start, end in ((up, down), (down, up)):
        np.testing.assert_allclose(model.settle_sizes(ALL, start).height_mm, start.height_mm, atol=0.01)
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
    assert "Bubble 0 cannot be 18.0 mm high: the nearest is 14.0 mm; it has all the air it may have" in plan.explain()


@pytest.mark.medium
@pytest.mark.parametrize(("rings", "tall"), [(1, 13.0), (1, 12.0), pytest.param(2, 12.0, marks=pytest.mark.slow)])
def test_the_nearest_is_no_further_than_one_size_for_all(rings, tall):
    """So tall everywhere is no equilibrium at this pitch, in no order."""
    model = bs.CompliantContact(bs.Layout.hexagon(rings))
    asked = np.full(len(model), tall)
    plan = bs.plan(asked, model.layout, contact=model)
    assert plan.unreachable
    np.testing.assert_allclose(follow(model, plan), plan.predicted_mm, atol=1e-3)
    even = [model.settle_sizes(np.full(len(model), size)).height_mm for size in np.arange(9.0, tall, 0.1)]
    assert plan.rms_mm <= min(np.sqrt(((height - asked) ** 2).mean()) for height in even) + 0.01


def test_the_nearest_is_stationary(model):
    """No small change of sizes that keeps to the branch comes nearer: what bounded least squares ends at."""
    asked = np.array([18.0, 9, 6, 9, 6, 9, 6])
    plan = bs.plan(asked, LAYOUT, contact=model)
    sizes = np.maximum(plan.steps[-1].target_mm, 5.0)
    downhill = model.size_slope(plan.shape).T @ (asked - plan.predicted_mm)
    free = (sizes > 5.01) & (sizes < 13.99)
    assert np.abs(downhill[free]).max() < 0.05
    assert (downhill[sizes >= 13.99] >= 0).all()


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
            paths = (steps_of(order, plan.shape.size_mm, REST) for order in orders)
            return any(np.abs(model.settle_sizes(p).height_mm - asked).max() < 0.3 for p in paths)

        best = next((k for k in (1, 2, 3) if does(k)), len(plan.steps))
        assert len(plan.steps) <= best + 1


def test_correction_meets_heights_or_comes_nearer(model, up):
    asked = up.height_mm + np.array([0.3, 0.1, -0.1, 0.1, -0.1, 0.1, -0.1])
    found = correct(model, up, asked, np.full(7, 14.0))
    np.testing.assert_allclose(found.height_mm, asked, atol=0.02)
    far = correct(model, up, np.full(7, 20.0), np.full(7, 14.0))
    assert np.abs(far.height_mm - 20).sum() < np.abs(up.height_mm - 20).sum()
    assert (far.size_mm <= 14.0 + 1e-6).all()


def test_orders_are_orders(up):
    """Each of the 126 ways to choose a first group of 7, once; and every group of three holds somebody."""
    twos = list(two_groups(up, up.size_mm, LAYOUT.neighbours, [0]))
    assert len(twos) == len(set(twos)) == 126
    assert twos[0] == ((0,), (1, 2, 3, 4, 5, 6))
    for order in three_groups(twos[:10], [0]):
        assert sorted(i for group in order for i in group) == list(range(7))
    for order in variants(((0, 1), (2, 3), (4, 5, 6)), [0, 4]):
        assert sorted(i for group in order for i in group) == list(range(7))
        assert all(order)


def test_who_hangs_on_whom_tells_the_order(up):
    assert layers(up) == ((0,), (1, 2, 3, 4, 5, 6))
    assert one_by_one(layers(up), -np.arange(7.0)) == ((0,), (1,), (2,), (3,), (4,), (5,), (6,))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_orders_of_many_groups_are_found(seed):
    """Shapes made in six groups, of 7 bubbles and of 12 at places of their own."""
    rng = np.random.default_rng(seed)
    own = np.array([[x * 10.0 + rng.uniform(-1, 1), y * 9.5 + rng.uniform(-1, 1)] for x in range(4) for y in range(3)])
    for layout in (LAYOUT, bs.Layout(own, 10.0)):
        model = bs.CompliantContact(layout)
        asked = reachable(model, rng, groups=6)
        plan = bs.plan(asked, layout, contact=model)
        np.testing.assert_allclose(follow(model, plan), asked, atol=0.3)


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
