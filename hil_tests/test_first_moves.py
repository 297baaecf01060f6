"""The first moves of a board that nobody has seen move: self-test, one bubble low, each by itself, all of them, and high."""

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(60)

LOW_MM = 6.5  # some 18 kPa: little air, and a bubble that is seen to rise


@pytest.mark.promise("self-test")
@pytest.mark.long
def test_the_self_test_has_found_nothing(target):
    """It runs at boot, and whatever is asked of the board ends it: so this only waits."""
    with bs.connect(target) as skin:
        for _ in range(100):
            if skin.health().self_test != "running":
                break
            skin.sleep(0.1)
        health = skin.health()
        # Simulated boards begin after it; on another somebody may have asked for a shape in the middle of it.
        assert health.self_test in {"passed", "skipped", *({"not_run"} if skin.simulated else ())}
        assert health.untrue_zero == health.unfilled == health.unvented == ()
        assert health.board_faults == ()


@pytest.mark.promise("own-height")
def test_the_first_bubble_rises_a_little_and_comes_back(skin, record_property):
    _alone(skin, 0, record_property)


@pytest.mark.promise("own-height")
@pytest.mark.long
def test_each_bubble_moves_when_it_is_asked_and_no_other(skin, record_property):
    """Swapped tubes and wires show here: the pressure rises elsewhere."""
    for bubble in range(skin.info.bubbles):
        _alone(skin, bubble, record_property)


def _alone(skin, bubble, record_property):
    heights = np.zeros(skin.info.bubbles)
    heights[bubble] = LOW_MM
    skin.show(heights)
    pressure = skin.state().pressure_kpa
    others = np.arange(skin.info.bubbles) != bubble
    assert pressure[bubble] > 5, f"bubble {bubble} was asked to rise: is its tube where its valves are?"
    record_property("pressure of the others, kPa (at most 2)", np.abs(pressure[others]).max())
    assert np.abs(pressure[others]).max() < 2, f"only bubble {bubble} was asked to rise"
    skin.vent()
    skin.sleep(0.8)
    assert np.abs(skin.state().pressure_kpa).max() < 1, "vented"


@pytest.mark.long
def test_all_rise_low(skin):
    skin.show(np.full(skin.info.bubbles, LOW_MM))
    assert (skin.state().pressure_kpa > 5).all()
    assert skin.faults() == {}


@pytest.mark.long
@pytest.mark.parametrize("height_mm", [9.0, 12.0])
def test_all_rise_high(skin, height_mm):
    skin.show(np.full(skin.info.bubbles, height_mm))
    assert skin.faults() == {}
    skin.vent()
