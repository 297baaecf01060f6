"""Vent and stop: what they do, how soon, and that a show goes on from there."""

import numpy as np
import pytest

pytestmark = pytest.mark.timeout(60)

NO_PRESSURE_KPA = 0.4  # sensor noise is 50 Pa


@pytest.mark.promise("vent")
@pytest.mark.medium
@pytest.mark.long
def test_vent_empties_every_bubble_within_a_second(skin, record_property):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.5), plan=False)
    skin.vent()
    skin.sleep(1.0)
    for _ in range(20):
        state = skin.state()
        assert state.mode == "idle"
        assert set(state.status) == {"resting"}
        record_property(f"pressure after 1 s, kPa (at most {NO_PRESSURE_KPA:g})", np.abs(state.pressure_kpa).max())
        assert np.abs(state.pressure_kpa).max() < NO_PRESSURE_KPA
        if skin.simulated:
            assert skin.simulated.alone_mm == pytest.approx(skin.info.height_rest_mm, abs=0.1)
            assert (skin.simulated.pulses == (0, skin.info.tick)).all()
        skin.sleep(0.25)


@pytest.mark.promise("vent")
@pytest.mark.parametrize(
    "after", [pytest.param(0.0, marks=pytest.mark.long), 0.02, pytest.param(0.1, marks=pytest.mark.long)]
)
def test_vent_ends_a_show_that_is_under_way(skin, after, record_property):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.0), wait=False, plan=False)
    skin.sleep(after)
    skin.vent()
    skin.sleep(1.0)
    state = skin.state()
    assert state.mode == "idle"
    record_property(f"pressure after 1 s, kPa (at most {NO_PRESSURE_KPA:g})", np.abs(state.pressure_kpa).max())
    assert np.abs(state.pressure_kpa).max() < NO_PRESSURE_KPA


@pytest.mark.promise("vent")
@pytest.mark.long
def test_vent_ends_a_ramp(skin):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.0), over=5.0, wait=False, plan=False)
    skin.sleep(2.0)
    skin.vent()
    skin.sleep(4.0)
    state = skin.state()
    assert state.mode == "idle"
    assert np.abs(state.pressure_kpa).max() < NO_PRESSURE_KPA


@pytest.mark.promise("stop")
@pytest.mark.long
def test_stop_keeps_the_air(skin, watch, record_property):
    n = skin.info.bubbles
    shape = np.linspace(9.0, 12.5, n)
    skin.show(shape, plan=False)
    skin.stop()
    seen = watch(5.0)
    assert np.abs(seen.height_mm - shape).max() <= 0.25
    moved = np.ptp(seen.since(0.1).height_mm, axis=0).max()
    record_property("moves within 5 s, mm (at most 0.1)", moved)
    assert moved <= 0.1
    if seen.pulses is not None:
        assert not seen.since(2 * skin.info.tick).pulses.any()
    state = skin.state()
    assert state.mode == "holding"
    assert set(state.status) == {"stopped"}


@pytest.mark.promise("stop")
@pytest.mark.long
def test_stop_in_the_middle_of_a_move(skin, watch):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.5), over=2.0, wait=False, plan=False)
    skin.sleep(1.5)
    skin.stop()
    held = watch(3.0).since(0.2)
    assert (held.height_mm > 9).all()
    assert (held.height_mm < 12).all()
    assert np.ptp(held.height_mm, axis=0).max() <= 0.1
    if held.pulses is not None:
        assert not held.pulses.any()
    state = skin.state()
    assert state.target_mm == pytest.approx(state.alone_mm, abs=0.2), "where they are is where they are wanted"


@pytest.mark.promise("stop")
@pytest.mark.long
def test_stop_while_vented_keeps_what_is_there(skin, watch):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.5), plan=False)
    skin.vent()
    skin.sleep(0.1)
    skin.stop()
    held = watch(2.0).since(0.3)
    assert np.ptp(held.height_mm, axis=0).max() <= 0.1
    assert (held.height_mm > skin.info.height_rest_mm + 0.5).all()


@pytest.mark.promise("states")
@pytest.mark.long
@pytest.mark.parametrize("interruption", ["stop", "vent"])
def test_a_show_goes_on_afterwards(skin, watch, interruption):
    n = skin.info.bubbles
    target = np.linspace(9.0, 12.5, n)
    skin.show(target[::-1], plan=False)
    getattr(skin, interruption)()
    skin.sleep(0.3)
    assert np.abs(skin.show(target, plan=False).alone_mm - target).max() <= 0.2
    assert np.abs(watch(3.0).since(0.6).height_mm - target).max() <= 0.2


@pytest.mark.promise("states")
def test_vent_and_stop_can_be_said_twice(skin):
    skin.stop()
    skin.stop()
    assert skin.state().mode == "holding"
    skin.vent()
    skin.vent()
    assert skin.state().mode == "idle"
