"""The larger board through the same SDK: its layout, its steps, its telemetry."""

from itertools import islice

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(120)


@pytest.fixture
def skin():
    with bs.connect("sim://wristband19?contact=0") as skin:
        yield skin


def test_it_is_what_it_says(skin):
    assert skin.info.board == "wristband19"
    assert skin.info.bubbles == 19
    assert skin.info.tick == 0.01
    assert skin.layout == bs.Layout.hexagon(2)


@pytest.mark.medium
def test_steps_of_all_bubbles(skin):
    """Within 0.2 mm from 0.6 s on, at most 0.3 mm beyond, with all 19 drawing on one reservoir."""
    rng = np.random.default_rng(1)
    start = skin.simulated.height_mm
    low, high = np.full(19, 5.5), np.full(19, 12.5)
    random = rng.uniform(5.5, 10.5, (2, 19))
    for target in (high, low, *np.where(random < 7, random, random + 2)):
        skin.show(target, wait=False)
        heights = []
        for _ in range(300):
            skin.sleep(skin.info.tick)
            heights.append(skin.simulated.height_mm)
        error = np.array(heights) - target
        assert np.abs(error[60:]).max() <= 0.2
        assert (error * np.sign(target - start)).max() <= 0.3
        start = heights[-1]


def test_telemetry_of_nineteen_fits_at_every_tick(skin):
    states = list(islice(skin.telemetry(100), 50))
    assert np.diff([state.time for state in states]) == pytest.approx(0.01)
    assert all(len(state.status) == 19 for state in states)
    assert skin.health().telemetry_dropped == 0


def test_tables_go_there_and_back(skin):
    sent = [bs.build_table(bs.YeohBalloon(mu=(38 + 0.1 * bubble) * 1e3)) for bubble in range(19)]
    skin.upload_tables(sent)
    assert [table.to_bytes() for table in skin.read_tables()] == [table.to_bytes() for table in sent]


def test_a_heightfield_and_a_callable_reach_the_same_shape(skin):
    x, y = skin.layout.positions_mm.T
    columns, rows = np.linspace(x.min(), x.max(), 5), np.linspace(y.min(), y.max(), 4)
    field = 10.5 + columns[None, :] / 20 + rows[:, None] / 40
    skin.show(field)
    assert skin.simulated.height_mm == pytest.approx(10.5 + x / 20 + y / 40, abs=0.2)
    skin.show(np.full(19, 6.0))
    skin.show(lambda x, y: 10.5 + x / 20 + y / 40)
    assert skin.simulated.height_mm == pytest.approx(10.5 + x / 20 + y / 40, abs=0.2)


def test_seven_heights_are_refused(skin):
    with pytest.raises(bs.InvalidInput, match="7 heights for 19 bubbles"):
        skin.show(np.full(7, 6.0))


def test_vent_and_stop(skin):
    skin.show(np.full(19, 12.0))
    skin.stop()
    skin.sleep(0.1)
    held = skin.simulated.height_mm
    skin.sleep(3.0)
    assert skin.simulated.height_mm == pytest.approx(held, abs=0.05)
    skin.vent()
    skin.sleep(1.0)
    assert np.abs(skin.state().pressure_kpa).max() < 0.4
