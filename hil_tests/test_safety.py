"""The promises of safety that can be seen from outside: silence, limits of time, isolation of the ill and only of them.

A wristband on a desk cannot be made to fail, so what needs a failure is tried on simulated boards only, and said.
"""

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(60)


@pytest.fixture
def silence(skin, monkeypatch):
    """`silence(seconds)`: nothing leaves this computer for so long."""

    def silent(seconds):
        transport = skin.link.transport
        with monkeypatch.context() as cut:
            cut.setattr(transport, "write", lambda data: None)
            skin.sleep(seconds)

    return silent


@pytest.fixture
def failing(skin):
    """`failing(failure, bubble, value)`: make a simulated board fail; mended in the end."""
    if not skin.simulated:
        pytest.skip(
            "a real wristband is not made to fail; `bubbleskin hil --device sim://…` tries these on its firmware"
        )
    mend = []

    def fail(failure, bubble, value):
        skin.simulated.inject(failure, bubble, value)
        mend.append((failure, bubble))

    yield fail
    for failure, bubble in mend:
        skin.simulated.inject(failure, bubble, 0)
    skin.vent()
    skin.sleep(1.0)
    skin.clear_faults()


@pytest.mark.long
def test_a_move_is_held_soon_after_the_host_falls_silent(skin, silence):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.0), over=20.0, wait=False)
    skin.sleep(0.5)
    silence(skin.settings()["deadman_hold"].value + 0.25)
    assert skin.state().mode == "holding"
    assert [fault.name for fault in skin.fault_log()][-1] == "host_silent"


def test_a_shape_is_vented_when_the_host_stays_silent(skin, silence):
    n = skin.info.bubbles
    skin.show(np.full(n, 9.0))
    vent = skin.settings()["deadman_vent"].value
    silence(vent - 0.3)
    assert skin.state().mode == "active", "a shape that is held is not given up before its time"
    silence(vent + 0.3)
    assert skin.state().mode in ("venting", "idle")
    skin.sleep(1.0)
    assert np.abs(skin.state().pressure_kpa).max() < 1.0
    skin.show(np.full(n, 6.0), wait=False)
    assert skin.state().mode == "active", "it forbids nothing"


@pytest.mark.long
def test_the_deadman_cannot_be_switched_off(skin):
    before = {name: setting.value for name, setting in skin.settings().items()}
    for wrong in (0.0, 1e6, float("inf")):
        with pytest.raises(bs.InvalidInput):
            skin.configure(deadman_vent=wrong)
    assert {name: setting.value for name, setting in skin.settings().items()} == before


@pytest.mark.long
def test_pressure_and_time_have_a_budget(skin):
    n = skin.info.bubbles
    before = skin.settings()["budget_kpa_s"].value
    skin.configure(budget_kpa_s=10.0)
    try:
        heights = np.full(n, 6.0)
        heights[1] = 12.0
        skin.show(heights)
        for _ in range(60):
            if skin.faults():
                break
            skin.sleep(0.1)
        assert skin.faults() == {1: ("budget",)}, "those at low pressure have their budget left"
        skin.sleep(0.5)
        assert skin.state().pressure_kpa[1] < 5
        skin.sleep(1.0)
        skin.clear_faults()
        assert skin.faults() == {}, "without pressure it recovers"
    finally:
        skin.configure(budget_kpa_s=before)
        skin.vent()
        skin.sleep(1.0)
        skin.clear_faults()


FAILURES = {
    "a sensor that repeats itself": ("sensor_stuck", 700, {"sensor_stuck"}),
    "a sensor that is gone": ("sensor_absent", 1, {"sensor_lost"}),
    "a bubble off its barb": ("pop_off", 1, {"leak"}),
    "a fill valve that does not close": ("fill_stuck", 1, {"valve_stuck"}),
    "a vent valve that does not close": ("vent_stuck", 1, {"leak", "no_air"}),
}


@pytest.mark.parametrize(
    "what",
    [name if name == "a sensor that is gone" else pytest.param(name, marks=pytest.mark.long) for name in FAILURES],
)
def test_the_ill_bubble_is_isolated_and_only_that(skin, failing, what):
    failure, value, names = FAILURES[what]
    n, ill = skin.info.bubbles, skin.info.bubbles - 1
    skin.show(np.full(n, 9.0))
    failing(failure, ill, value)
    for _ in range(25):
        skin.sleep(0.02)
        if skin.faults():
            break
    faults = skin.faults()
    assert list(faults) == [ill]
    assert set(faults[ill]) & names
    state = skin.state()
    assert state.status[ill] == "fault"
    assert "fault" not in state.status[:ill]
    skin.sleep(1.0)
    others = np.arange(n) != ill
    if skin.state().mode == "active":
        assert skin.simulated.alone_mm[others] == pytest.approx(9.0, abs=0.3)


@pytest.mark.long
@pytest.mark.parametrize(
    ("failure", "first", "then", "name"), [("fill_stuck", 5.0, 9.0, "no_air"), ("vent_stuck", 9.0, 5.0, "valve_stuck")]
)
def test_a_valve_that_does_not_open_is_found_when_it_is_asked_to(skin, failing, failure, first, then, name):
    n, ill = skin.info.bubbles, 0
    skin.show(np.full(n, first))
    failing(failure, ill, -1)
    skin.sleep(0.5)
    assert skin.faults() == {}, "it is not asked for anything"
    skin.show(np.full(n, then), wait=False)
    skin.sleep(0.3)
    assert list(skin.faults()) == [ill]
    assert name in skin.faults()[ill]


@pytest.mark.long
def test_a_leak_that_control_makes_up_for_is_found_by_the_air_that_it_takes(skin, failing):
    ill = 2
    skin.show(np.full(skin.info.bubbles, 10.5))
    failing("leak", ill, 9e-6)  # 200 µJ/ms at this height
    for _ in range(15):
        skin.sleep(0.1)
        if skin.faults():
            break
    assert skin.faults() == {ill: ("leak",)}


@pytest.mark.long
def test_a_fault_stays_until_it_is_acknowledged(skin, failing):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    failing("sensor_absent", 2, 1)
    skin.sleep(0.5)
    assert 2 in skin.faults()
    skin.simulated.inject("sensor_absent", 2, 0)
    skin.sleep(1.5)
    assert 2 in skin.faults()
    skin.show(np.full(n, 8.0), wait=False)
    skin.sleep(0.5)
    assert skin.state().pressure_kpa[2] < 1.0, "whatever is asked"
    skin.clear_faults()
    assert skin.faults() == {}
    skin.show(np.full(n, 8.0))


@pytest.mark.long
def test_one_acknowledged_fault_leaves_the_later_ones(skin, failing):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    for bubble in (1, 3):
        failing("sensor_absent", bubble, 1)
        skin.sleep(0.3)
    first = next(fault for fault in skin.fault_log() if fault.bubble == 1 and not fault.acknowledged)
    for bubble in (1, 3):
        skin.simulated.inject("sensor_absent", bubble, 0)
    skin.acknowledge(first)
    assert list(skin.faults()) == [3]


@pytest.mark.long
def test_an_acknowledgement_shortens_no_isolation(skin, failing):
    skin.show(np.full(skin.info.bubbles, 8.0))
    failing("sensor_absent", 2, 1)
    skin.sleep(0.1)
    (fault,) = (fault for fault in skin.fault_log() if fault.bubble == 2 and not fault.acknowledged)
    skin.simulated.inject("sensor_absent", 2, 0)
    skin.clear_faults()
    assert skin.faults() == {}
    assert skin.state().time - fault.time >= 1.0


@pytest.mark.long
def test_a_supply_that_is_gone_vents_and_is_named(skin, failing):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    failing("supply_absent", 0, 1)
    skin.sleep(1.0)
    assert "supply_lost" in skin.health().board_faults
    skin.sleep(0.5)
    assert np.abs(skin.state().pressure_kpa).max() < 1.0
    with pytest.raises(bs.BubbleskinError):
        skin.show(np.full(n, 6.0))


def press(skin, failing):
    """Press the emergency stop."""
    try:
        failing("estop", 0, 1)
    except bs.InvalidInput as problem:
        pytest.skip(str(problem))


def test_the_emergency_stop_vents_whatever_is_asked(skin, failing):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    press(skin, failing)
    skin.sleep(0.1)
    assert skin.state().mode == "stopped"
    assert skin.health().board_faults == ("emergency_stop",)
    skin.sleep(1.0)
    assert np.abs(skin.state().pressure_kpa).max() < 1.0
    with pytest.raises(bs.DeviceRefused):
        skin.show(np.full(n, 6.0), wait=False)
    assert skin.state().mode == "stopped"


@pytest.mark.long
def test_the_emergency_stop_cannot_be_cleared_while_it_is_pressed(skin, failing):
    n = skin.info.bubbles
    press(skin, failing)
    skin.sleep(1.5)
    pressed = skin.fault_log()[-1]
    skin.clear_faults()
    assert skin.fault_log()[-1] == pressed, "neither acknowledged nor, a tick later, there again"
    assert skin.state().mode == "stopped"
    assert skin.health().board_faults == ("emergency_stop",)
    skin.simulated.inject("estop", 0, 0)
    skin.sleep(1.5)
    assert skin.state().mode == "stopped", "releasing it starts nothing, nor does what was cleared before"
    skin.clear_faults()
    assert skin.state().mode in ("venting", "idle")
    skin.show(np.full(n, 6.0))
