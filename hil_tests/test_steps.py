"""Step response and ramps: heights from 5.5 to 12.5 mm beside the plateau (7 to 9 mm), on bubbles that match their tables."""

from itertools import pairwise

import numpy as np
import pytest

pytestmark = pytest.mark.timeout(240)

LOW, PLATEAU_LOW, PLATEAU_HIGH, HIGH = 5.5, 7.0, 9.0, 12.5
NEAR, BEYOND = 0.2, 0.3
NEAR_PRESSED, BEYOND_PRESSED = 0.3, 0.5
"""Of bubbles that a neighbour presses, or has pressed: its push raises the pressure, and the firmware reads that as height."""
SOON = 0.6
STAYS = 10.0


def random_heights(rng, n):
    heights = rng.uniform(LOW, HIGH - (PLATEAU_HIGH - PLATEAU_LOW), n)
    return np.where(heights < PLATEAU_LOW, heights, heights + PLATEAU_HIGH - PLATEAU_LOW)


def check_step(skin, watch, pressed, record_property, start, target):
    """Show `target` from `start` and check all that is promised of a step. Returns the heights at the end."""
    skin.show(target, wait=False, plan=False)
    seen = watch(SOON + STAYS)
    error = seen.height_mm - target
    settled = seen.since(SOON)
    alone = ~pressed(target) & ~pressed(start)
    if alone.any():
        record_property(f"error from 0.6 s on, mm (at most {NEAR})", np.abs(settled.height_mm - target)[:, alone].max())
    assert (np.abs(settled.height_mm - target) <= np.where(pressed(target), NEAR_PRESSED, NEAR)).all()
    beyond = (error * np.sign(target - start)).max(axis=0)
    if alone.any():
        record_property(f"overshoot, mm (at most {BEYOND})", beyond[alone].max())
    assert (beyond <= np.where(pressed(start), BEYOND_PRESSED, BEYOND)).all(), "overshoot"
    if settled.pulses is not None:
        record_property("pulses of a bubble in a second at rest (at most 2)", int(settled.busiest_second().max()))
        assert settled.busiest_second().max() <= 2, "valve pulses of a bubble in one second at rest"
    return seen.height_mm[-1]


@pytest.mark.promise("height-held", "quiet-at-rest")
@pytest.mark.medium
@pytest.mark.long
def test_extremes_in_a_row(skin, watch, pressed, record_property):
    n = skin.info.bubbles
    other = np.where(np.arange(n) % 2, LOW, HIGH)
    heights = np.full(n, skin.info.height_rest_mm)
    for target in (np.full(n, HIGH), np.full(n, LOW), other, LOW + HIGH - other):
        heights = check_step(skin, watch, pressed, record_property, heights, target)


@pytest.mark.promise("height-held", "quiet-at-rest")
@pytest.mark.medium
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_random_heights_in_a_row(skin, watch, pressed, seed, record_property):
    rng = np.random.default_rng(seed)
    heights = np.full(skin.info.bubbles, skin.info.height_rest_mm)
    for _ in range(4):
        heights = check_step(skin, watch, pressed, record_property, heights, random_heights(rng, skin.info.bubbles))


@pytest.mark.promise("height-held")
@pytest.mark.long
def test_show_returns_when_all_is_settled(skin):
    rng = np.random.default_rng(3)
    for _ in range(5):
        target = random_heights(rng, skin.info.bubbles)
        before = skin.state().time
        state = skin.show(target, plan=False)
        assert state.arrived
        assert state.mode == "active"
        assert state.time - before < 1.0
        assert state.target_mm == pytest.approx(target, abs=0.001)
        assert state.alone_mm == pytest.approx(target, abs=NEAR)


@pytest.mark.promise("height-held")
@pytest.mark.long
def test_a_new_show_takes_over_at_once(skin, watch):
    """Shows that do not wait for each other: only the last one counts."""
    n = skin.info.bubbles
    for height in (12.0, 6.0, 11.0, 5.5, 10.0):
        skin.show(np.full(n, height), wait=False, plan=False)
        skin.sleep(0.07)
    assert watch(2.0).since(SOON).height_mm == pytest.approx(10.0, abs=NEAR)


@pytest.mark.promise("vent")
@pytest.mark.long
def test_heights_up_to_rest_take_no_pressure(skin):
    n = skin.info.bubbles
    skin.show(np.full(n, 11.0), plan=False)
    state = skin.show(np.linspace(0, skin.info.height_rest_mm, n), plan=False)
    assert set(state.status) == {"resting"}
    assert state.alone_mm.max() <= skin.info.height_rest_mm + NEAR
    if skin.simulated:
        assert skin.simulated.alone_mm.max() <= skin.info.height_rest_mm + NEAR
    skin.sleep(1.0)
    assert skin.state().pressure_kpa == pytest.approx(0, abs=0.4)


@pytest.mark.promise("own-height")
@pytest.mark.long
def test_each_bubble_goes_its_own_way(skin):
    """The order of bubbles is the layout's on the whole way to the membranes and back."""
    n = skin.info.bubbles
    for bubble in range(n):
        target = np.full(n, 6.0)
        target[bubble] = 11.0
        skin.show(target, plan=False)
        if skin.simulated:
            assert skin.simulated.alone_mm == pytest.approx(target, abs=NEAR)
        state = skin.state()
        assert state.alone_mm == pytest.approx(target, abs=NEAR)
        assert np.argmax(state.pressure_kpa) == bubble


@pytest.mark.promise("ramp")
@pytest.mark.medium
@pytest.mark.long
@pytest.mark.parametrize("over", [1.0, 3.0])
@pytest.mark.parametrize(("low", "high"), [(5.5, 6.9), (9.2, 12.5)])
def test_a_ramp_takes_its_time(skin, watch, pressed, over, low, high, record_property):
    n = skin.info.bubbles
    skin.show(np.full(n, low), plan=False)
    skin.sleep(1.0)
    for start, end in pairwise((low, high, low)):
        skin.show(np.full(n, end), over=over, wait=False, plan=False)
        seen = watch(over + 1.0)
        share = np.clip(seen.time / over, 0, 1)[:, None]
        line = start + share * (end - start)
        record_property("off the ramp, mm (at most 0.35)", np.abs(seen.height_mm - line).max())
        assert np.abs(seen.height_mm - line).max() <= 0.35
        way = seen.height_mm * np.sign(end - start)
        assert (np.maximum.accumulate(way, axis=0) - way).max() <= 0.15, "monotonic"
        assert (
            np.abs(seen.since(over + SOON).height_mm - end) <= np.where(pressed(np.full(n, end)), NEAR_PRESSED, NEAR)
        ).all()


@pytest.mark.promise("ramp")
@pytest.mark.long
@pytest.mark.parametrize("start", [0.0, 9.5, 12.5])
def test_a_ramp_is_waited_for(skin, start):
    n = skin.info.bubbles
    skin.show(np.full(n, start), plan=False)
    before = skin.state().time
    state = skin.show(np.full(n, 12.0), over=2.0, plan=False)
    assert 1.9 <= state.time - before <= 3.0
    assert state.arrived
    assert state.alone_mm == pytest.approx(12.0, abs=NEAR)


@pytest.mark.promise("ramp")
@pytest.mark.long
def test_a_ramp_to_rest_is_waited_for(skin):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.0), plan=False)
    before = skin.state().time
    state = skin.show(np.zeros(n), over=2.0, plan=False)
    assert 0.5 <= state.time - before <= 3.5
    assert state.alone_mm == pytest.approx(skin.info.height_rest_mm, abs=NEAR)


@pytest.mark.promise("height-held")
def test_a_dome_settles_and_stays(skin, watch, record_property):
    """The shortest whole way from heights to membranes and back; it runs on emulated chips too."""
    distance = np.linalg.norm(skin.layout.positions_mm, axis=1) / skin.layout.pitch_mm
    dome = np.interp(distance, [0, 1, 2], [12.0, 6.8, 5.5])  # so low around the centre that nobody touches
    state = skin.show(dome, plan=False)
    assert state.arrived
    assert state.alone_mm == pytest.approx(dome, abs=NEAR)
    stays = watch(0.3).height_mm[-1]
    record_property(f"error of a dome, mm (at most {NEAR})", np.abs(stays - dome).max())
    assert stays == pytest.approx(dome, abs=NEAR)


@pytest.mark.promise("height-neighbours")
@pytest.mark.long
def test_tops_where_neighbours_lift_and_squeeze(skin, record_property):
    """Heights are tops: the middle is lifted by bubbles that would otherwise touch it, and stands no higher than was asked."""
    distance = np.linalg.norm(skin.layout.positions_mm, axis=1) / skin.layout.pitch_mm
    skin.show(np.full(skin.info.bubbles, 6.0))
    for middle, ring in ((12.5, 9.0), (11.5, 9.8), (13.0, 8.5)):
        asked = np.interp(distance, [0, 1, 2], [middle, ring, 5.5])
        state = skin.show(asked)
        assert state.arrived
        assert state.height_mm == pytest.approx(asked, abs=NEAR_PRESSED)
        assert state.target_mm == pytest.approx(asked, abs=0.001)
        if skin.simulated:
            off = np.abs(skin.simulated.height_mm - asked).max()
            record_property(f"error of true tops, mm (at most {NEAR_PRESSED})", off)
            assert skin.simulated.height_mm == pytest.approx(asked, abs=NEAR_PRESSED)


@pytest.mark.promise("how-sure")
@pytest.mark.long
@pytest.mark.not_on("board", "nobody knows its true heights")
def test_heights_are_told_with_how_sure_they_are(skin, record_property):
    rng = np.random.default_rng(5)
    for _ in range(5):
        skin.show(random_heights(rng, skin.info.bubbles), plan=False)
        state, true_mm = skin.state(), skin.simulated.alone_mm
        off = np.abs(true_mm - state.alone_mm)
        record_property("off by, standard deviations (at most 2)", (off / state.sd_mm).max())
        assert (off <= 2 * state.sd_mm).all()
        settled = np.array([status == "settled" for status in state.status])
        assert np.abs(true_mm - state.target_mm)[settled].max(initial=0.0) < 0.5
