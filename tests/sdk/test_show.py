"""What `show` says when a shape is not reached."""

import asyncio

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(60)


@pytest.fixture
def skin():
    with bs.connect("sim://wristband7?contact=0") as skin:
        yield skin


def test_not_waiting_returns_at_once(skin):
    before = skin.simulated.time
    assert skin.show(np.full(7, 10.0), wait=False) is None
    assert skin.simulated.time - before < 0.02


def test_a_bubble_that_does_not_fill_is_named(skin):
    skin.simulated.inject("fill_stuck", 3, -1)
    before = skin.simulated.time
    with pytest.raises(bs.DeviceFault, match=r"reports faults \(bubble 3: no_air\)"):
        skin.show(np.full(7, 10.0))
    assert skin.simulated.time - before < 0.5


def test_bubbles_that_do_not_fill_on_a_ramp_are_named(skin):
    skin.simulated.inject("fill_stuck", 0, -1)
    skin.simulated.inject("fill_stuck", 6, -1)
    before = skin.simulated.time
    with pytest.raises(bs.DeviceFault, match=r"reports faults .*bubble [06]: no_air"):  # whichever is found first
        skin.show(np.full(7, 10.0), over=2.0)
    assert skin.simulated.time - before < 2.0


def test_a_bubble_that_does_not_empty_is_named(skin):
    skin.show(np.full(7, 10.0))
    skin.simulated.inject("vent_stuck", 5, -1)
    with pytest.raises(bs.DeviceFault, match=r"reports faults \(bubble 5: valve_stuck\)"):
        skin.show(np.zeros(7))


def test_a_fault_is_told_and_kept_until_it_is_cleared(skin):
    skin.simulated.inject("sensor_absent", 2, 1)
    with pytest.raises(bs.DeviceFault, match=r"reports faults \(bubble 2: sensor_lost\).*clear_faults"):
        skin.show(np.full(7, 10.0))
    assert skin.faults() == {2: ("sensor_lost",)}
    skin.simulated.inject("sensor_absent", 2, 0)
    skin.sleep(0.1)
    assert skin.faults() == {2: ("sensor_lost",)}
    skin.clear_faults()
    assert skin.faults() == {}
    assert skin.show(np.full(7, 10.0)).height_mm == pytest.approx(10, abs=0.2)


@pytest.mark.parametrize(("interrupt", "mode"), [("stop", "holding"), ("vent", "venting")])
def test_a_show_that_is_interrupted_says_so(interrupt, mode):
    async def script():
        async with await bs.aconnect("sim://wristband7?contact=0") as skin, asyncio.timeout(10):
            showing = asyncio.create_task(skin.show(np.full(7, 10.0), over=2.0))
            await skin.sleep(0.5)
            await getattr(skin, interrupt)()
            with pytest.raises(bs.DeviceFault, match=f"is {mode} in the middle of a show"):
                await showing

    asyncio.run(script())
