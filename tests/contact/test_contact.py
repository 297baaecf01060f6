"""Settled shapes: the paper's three heights, branches and snaps, symmetry, and what is refused."""

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.errors import InvalidInput, NoEquilibrium

P = 26.69e3  # a bubble alone is 12.00 mm high
ALL = np.full(7, P)
CENTRE = np.where(np.arange(7) == 0, P, 0.0)
RING = ALL - CENTRE


@pytest.fixture(scope="module")
def model():
    return bs.CompliantContact(bs.Layout.hexagon(1))


@pytest.mark.parametrize("ramp", ["pressure", "height"])
@pytest.mark.parametrize(
    ("steps", "height_mm"),
    [([CENTRE], 12.00), ([RING, ALL], 11.76), ([ALL], 11.76), ([CENTRE, ALL], 13.90)],
    ids=["alone", "ring first", "together", "centre first"],
)
def test_order_decides_the_height_of_the_centre(model, steps, height_mm, ramp):
    """The paper: alone 12 mm, ring first the same, centre first 14 mm."""
    shape = model.settle(steps, ramp=ramp)
    assert shape.converged
    assert shape.residual < 1e-6
    assert shape.height_mm[0] == pytest.approx(height_mm, abs=0.006)


def test_alone_is_the_balloon(model):
    for height_mm in (6.0, 8.0, 11.0):
        shape = model.settle([CENTRE / P * bs.YeohBalloon().pressure_at_height(height_mm * 1e-3)])
        assert shape.height_mm[0] == pytest.approx(height_mm, abs=1e-4)
        assert not shape.contacts


def test_lifted_centre_is_even_and_rests_on_its_ring(model):
    shape = model.settle([CENTRE, ALL])
    assert np.ptp(shape.height_mm[1:]) < 1e-3
    assert np.hypot(*shape.position[0, :2]) < 1e-6
    assert shape.lifted_mm[0] > 1.5
    on_centre = [one for one in shape.contacts if one.first == 0]
    assert len(on_centre) == 6
    # What holds it up is the upward part of six contacts; what pulls it down is its neck.
    up = sum(
        one.force * (shape.position[0] - shape.position[one.second])[2]
        / np.linalg.norm(shape.position[0] - shape.position[one.second])
        for one in on_centre
    )  # fmt: skip
    assert up == pytest.approx(10.0 * shape.lifted_mm[0] * 1e-3, rel=1e-4)


def test_pressed_ring_buckles_into_every_other_bubble(model):
    """An even ring of these is no minimum: three of six step up, and which three is chance."""
    seen = set()
    for seed in range(6):
        ring = bs.CompliantContact(model.layout, seed=seed).settle([RING]).height_mm[1:]
        high = ring > 13
        assert high.sum() == 3
        assert (high != np.roll(high, 1)).all()
        seen.add(bool(high[0]))
    assert seen == {True, False}


def test_turned_pressures_give_the_turned_shape(model):
    """Every pressure different: nothing is left to chance, and bubble i's part is bubble i + 1's of the turned array."""
    pressures = np.array([24.0, 20.0, 22.5, 26.0, 21.0, 25.0, 23.0]) * 1e3
    turned = np.r_[pressures[0], np.roll(pressures[1:], 1)]
    one, other = (model.settle([p]).height_mm for p in (pressures, turned))
    np.testing.assert_allclose(np.r_[one[0], np.roll(one[1:], 1)], other, atol=1e-3)


def test_same_calls_same_bytes(model):
    one, other = (bs.CompliantContact(model.layout, seed=5).settle([RING, ALL]) for _ in range(2))
    assert one.state.tobytes() == other.state.tobytes()


def test_start_goes_on_where_the_last_shape_ended(model):
    there = model.settle([CENTRE, ALL])
    on = model.settle([ALL], start=model.settle([CENTRE]))
    np.testing.assert_allclose(on.height_mm, there.height_mm, atol=1e-3)
    down = model.settle([CENTRE], start=there)
    assert down.height_mm[0] == pytest.approx(12.0, abs=0.01)


def test_snap_through_is_reported_where_the_membrane_turns():
    balloon = bs.YeohBalloon(mu=60e3)
    jump = balloon.inflation_jump()
    one = bs.CompliantContact(bs.Layout.hexagon(0), balloon)
    top = 33e3
    (snap,) = one.settle([[top]]).snaps
    assert snap.fraction * top == pytest.approx(jump.pressure, abs=5)
    assert snap.before_mm[0] == pytest.approx(1e3 * balloon.height(jump.from_stretch), abs=0.15)
    assert snap.after_mm[0] == pytest.approx(1e3 * balloon.height(jump.to_stretch), abs=0.15)
    assert snap.energy > 0
    assert snap.bubbles == (0,)
    back = one.settle([[28e3]], start=one.settle([[top]]))
    jump = balloon.deflation_jump()
    assert top + back.snaps[0].fraction * (28e3 - top) == pytest.approx(jump.pressure, abs=10)


def test_plateau_is_no_snap(model):
    assert not model.settle([CENTRE]).snaps


def test_lifted_centre_that_softens_lets_the_ring_buckle(model):
    """A snap on the way down, at a pressure at which nothing snapped on the way up: the path decides."""
    up = model.settle([CENTRE, ALL])
    softer = model.settle([CENTRE * 0.84 + RING], start=up)
    snap = softer.snaps[0]
    assert snap.bubbles in ((1, 3, 5), (2, 4, 6))
    assert snap.energy > 1e-6
    assert (snap.after_mm[list(snap.bubbles)] > 14).all()
    assert softer.height_mm[0] < snap.before_mm[0] - 1
    again = model.settle([ALL], start=softer)
    assert again.height_mm[0] == pytest.approx(11.76, abs=0.01)  # and back up it does not go


def test_slope_of_heights_is_their_difference(model):
    shape = model.settle([CENTRE, ALL])
    J = model.height_slope(shape)
    dP = 1.0
    for j in (0, 3):
        bumped = ALL + dP * (np.arange(7) == j)
        numeric = (model.settle([bumped], start=shape).height_mm - shape.height_mm) * 1e-3 / dP
        np.testing.assert_allclose(J[:, j], numeric, atol=2e-3 * np.abs(J[:, j]).max())


def test_air_says_how_high_a_bubble_would_be_alone(model):
    shape = model.settle([CENTRE])
    np.testing.assert_allclose(model.height_by_air(shape), shape.height_mm, atol=1e-6)
    squeezed = model.height_by_air(model.settle([CENTRE, ALL]))
    assert 11.8 < squeezed[0] < 12.0  # 13.9 mm high, and a little less air than alone


def test_each_bubble_may_be_another():
    balloons = [bs.YeohBalloon(mu=39.62e3 * (1 + 0.02 * i)) for i in range(3)]
    model = bs.CompliantContact(bs.Layout.grid(1, 3, pitch_mm=20), balloons)
    shape = model.settle([np.full(3, 24e3)])
    np.testing.assert_allclose(shape.height_mm, [1e3 * b.heights(24e3)[0] for b in balloons], atol=1e-3)


def test_thick_wall_has_its_outer_height():
    balloon = bs.YeohBalloon(wall="thick", surface="inner")
    shape = bs.CompliantContact(bs.Layout.hexagon(0), balloon).settle([[19.14e3]])
    assert shape.height_mm[0] == pytest.approx(12.0, abs=0.01)
    assert balloon.height(shape.stretch[0]) == pytest.approx(shape.radius[0] * 2)


def test_what_never_comes_to_rest_is_said(model):
    hopeless = bs.CompliantContact(model.layout, bs.YeohBalloon(mu=30e3, c2=0.0, c3=0.0))
    with pytest.raises(InvalidInput, match="no equilibrium at"):
        hopeless.settle([ALL])
    # Alone each would hold this, but on the way there is nothing beyond its limit point.
    top = hopeless.balloons[0].limit_points()[0].pressure
    shape = hopeless.settle([np.full(7, top - 1)])
    assert not shape.converged or shape.residual < 1e-6


def test_strict_raises(monkeypatch, model):
    monkeypatch.setattr("bubbleskin.contact.continuation.LIMIT", 1)
    assert not model.settle([ALL]).converged
    with pytest.raises(NoEquilibrium, match="more increments"):
        model.settle([ALL], strict=True)


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ([np.zeros(6)], r"\(k, 7\) array"),
        ([np.full(7, np.nan)], "finite"),
        ([np.full(7, -1.0)], "negative"),
        (np.zeros((0, 7)), r"\(k, 7\)"),
    ],
)
def test_pressures_that_mean_nothing_are_refused(model, steps, words):
    with pytest.raises(InvalidInput, match=words):
        model.settle(steps)


def test_other_nonsense_is_refused(model):
    layout = model.layout
    with pytest.raises(InvalidInput, match="kz"):
        bs.CompliantContact(layout, kz=-1)
    with pytest.raises(InvalidInput, match="3 balloons for 7"):
        bs.CompliantContact(layout, [bs.YeohBalloon()] * 3)
    with pytest.raises(InvalidInput, match="one place"):
        bs.CompliantContact(bs.Layout([[0, 0], [0, 0]], 10.0))
    with pytest.raises(InvalidInput, match="3 bubbles"):
        model.settle([ALL], start=bs.CompliantContact(bs.Layout.grid(1, 3)).rest())
