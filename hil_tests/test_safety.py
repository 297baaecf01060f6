"""The promises of safety that can be seen from outside: silence, limits of time, isolation of the ill and only of them.

A wristband on a desk fails on purpose only where that is permitted, and in ways that harm nobody; what it cannot do to itself is
tried on simulated boards only, and said.
"""

import contextlib
import dataclasses

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(60)

no_pin = pytest.mark.not_on("micropython", "what runs the firmware there has no pin for an emergency stop")
beyond_a_board = pytest.mark.not_on("board", "no board does that to itself")


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
def press(skin):
    """`press(pressed)`: the emergency stop of a simulated board; released in the end."""
    yield lambda pressed: skin.simulated.inject("estop", 0, float(pressed))
    skin.simulated.inject("estop", 0, 0.0)
    skin.vent()
    skin.sleep(1.0)
    skin.clear_faults()


@pytest.mark.promise("silence")
@pytest.mark.long
def test_a_move_is_held_soon_after_the_host_falls_silent(skin, silence, record_property):
    n = skin.info.bubbles
    skin.show(np.full(n, 12.0), over=20.0, wait=False)
    skin.sleep(0.5)
    hold = skin.settings()["deadman_hold"].value
    silence(hold + 0.25)
    assert skin.state().mode == "holding"
    held = skin.fault_log()[-1]
    assert held.name == "host_silent"
    record_property(f"held after, s of silence (at most {hold + 2 * skin.info.tick:g})", held.value)
    assert held.value <= hold + 2 * skin.info.tick


@pytest.mark.promise("silence")
def test_a_shape_is_vented_when_the_host_stays_silent(skin, silence, record_property):
    n = skin.info.bubbles
    skin.show(np.full(n, 9.0))
    vent = skin.settings()["deadman_vent"].value
    silence(vent - 0.3)
    assert skin.state().mode == "active", "a shape that is held is not given up before its time"
    silence(vent + 0.3)
    assert skin.state().mode in ("venting", "idle")
    silent = skin.fault_log()[-1].value
    record_property(f"vented after, s of silence (at most {vent + 2 * skin.info.tick:g})", silent)
    assert silent <= vent + 2 * skin.info.tick
    skin.sleep(1.0)
    assert np.abs(skin.state().pressure_kpa).max() < 1.0
    skin.show(np.full(n, 6.0), wait=False)
    assert skin.state().mode == "active", "it forbids nothing"


@pytest.mark.promise("deadman-stays")
@pytest.mark.long
def test_the_deadman_cannot_be_switched_off(skin):
    before = {name: setting.value for name, setting in skin.settings().items()}
    for wrong in (0.0, 1e6, float("inf")):
        with pytest.raises(bs.InvalidInput):
            skin.configure(deadman_vent=wrong)
    assert {name: setting.value for name, setting in skin.settings().items()} == before


@pytest.mark.promise("budget")
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
    "a sensor that repeats itself": ("sensor", "stuck", {"sensor_stuck"}),
    "a sensor that is gone": ("sensor", "missing", {"sensor_lost"}),
    "a bubble off its barb": ("bubble", "off", {"leak"}),
    "a fill valve that does not close": ("fill valve", "stuck", {"valve_stuck"}),
    "a vent valve that does not close": ("vent valve", "off", {"leak", "no_air"}),
}


@pytest.mark.promise("isolation", "faults-found")
@pytest.mark.fails_on_purpose
@pytest.mark.parametrize(
    "what",
    [
        "a sensor that is gone",
        pytest.param("a sensor that repeats itself", marks=pytest.mark.long),
        pytest.param("a vent valve that does not close", marks=pytest.mark.long),
        pytest.param("a bubble off its barb", marks=[pytest.mark.long, beyond_a_board]),
        pytest.param("a fill valve that does not close", marks=[pytest.mark.long, beyond_a_board]),
    ],
)
def test_the_ill_bubble_is_isolated_and_only_that(skin, failing, what, record_property):
    part, how, names = FAILURES[what]
    n, ill = skin.info.bubbles, skin.info.bubbles - 1
    skin.show(np.full(n, 9.0))
    began = skin.state().time
    failing(part, ill, how)
    for _ in range(25):
        skin.sleep(0.02)
        if skin.faults():
            break
    faults = skin.faults()
    assert list(faults) == [ill]
    assert set(faults[ill]) & names
    found = next(fault.time for fault in skin.fault_log() if fault.bubble == ill and not fault.acknowledged) - began
    record_property("found after, s (at most 0.5)", found)
    assert found <= 0.5
    state = skin.state()
    assert state.status[ill] == "fault"
    assert "fault" not in state.status[:ill]
    skin.sleep(1.0)
    others = np.arange(n) != ill
    if skin.state().mode == "active" and skin.simulated:
        assert skin.simulated.alone_mm[others] == pytest.approx(9.0, abs=0.3)


@pytest.mark.promise("faults-found")
@pytest.mark.fails_on_purpose
@pytest.mark.long
@pytest.mark.parametrize(
    ("part", "how", "first", "then", "name"),
    [
        ("fill valve", "off", 5.0, 9.0, "no_air"),
        pytest.param("vent valve", "stuck", 9.0, 5.0, "valve_stuck", marks=beyond_a_board),
    ],
)
def test_a_valve_that_does_not_open_is_found_when_it_is_asked_to(skin, failing, part, how, first, then, name):
    n, ill = skin.info.bubbles, 0
    skin.show(np.full(n, first))
    failing(part, ill, how)
    skin.sleep(0.5)
    assert skin.faults() == {}, "it is not asked for anything"
    skin.show(np.full(n, then), wait=False)
    skin.sleep(0.3)
    assert list(skin.faults()) == [ill]
    assert name in skin.faults()[ill]


@pytest.mark.promise("faults-found")
@beyond_a_board
@pytest.mark.long
def test_a_leak_that_control_makes_up_for_is_found_by_the_air_that_it_takes(skin, failing):
    ill = 2
    skin.show(np.full(skin.info.bubbles, 10.5))
    failing("bubble", ill, "wrong")
    skin.simulated.inject("leak", ill, 9e-6)  # 200 µJ/ms at this height
    for _ in range(15):
        skin.sleep(0.1)
        if skin.faults():
            break
    assert skin.faults() == {ill: ("leak",)}


@pytest.mark.promise("fault-stays")
@pytest.mark.fails_on_purpose
@pytest.mark.long
def test_a_fault_stays_until_it_is_acknowledged(skin, failing):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    failing("sensor", 2, "missing")
    skin.sleep(0.5)
    assert 2 in skin.faults()
    failing("sensor", 2, "healthy")
    skin.sleep(1.5)
    assert 2 in skin.faults()
    skin.show(np.full(n, 8.0), wait=False)
    skin.sleep(0.5)
    assert skin.state().pressure_kpa[2] < 1.0, "whatever is asked"
    skin.clear_faults()
    assert skin.faults() == {}
    skin.show(np.full(n, 8.0))


@pytest.mark.promise("fault-stays")
@pytest.mark.fails_on_purpose
@pytest.mark.long
def test_one_acknowledged_fault_leaves_the_later_ones(skin, failing):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    for bubble in (1, 3):
        failing("sensor", bubble, "missing")
        skin.sleep(0.3)
    first = next(fault for fault in skin.fault_log() if fault.bubble == 1 and not fault.acknowledged)
    for bubble in (1, 3):
        failing("sensor", bubble, "healthy")
    skin.acknowledge(first)
    assert list(skin.faults()) == [3]


@pytest.mark.promise("isolation")
@pytest.mark.fails_on_purpose
@pytest.mark.long
def test_an_acknowledgement_shortens_no_isolation(skin, failing, record_property):
    skin.show(np.full(skin.info.bubbles, 8.0))
    failing("sensor", 2, "missing")
    skin.sleep(0.1)
    (fault,) = (fault for fault in skin.fault_log() if fault.bubble == 2 and not fault.acknowledged)
    failing("sensor", 2, "healthy")
    skin.clear_faults()
    assert skin.faults() == {}
    isolated = skin.state().time - fault.time
    record_property("isolated for, s (at least 1)", isolated)
    assert isolated >= 1.0


@pytest.mark.promise("supply-lost")
@pytest.mark.fails_on_purpose
@pytest.mark.long
def test_a_supply_that_is_gone_vents_and_is_named(skin, failing):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    failing("supply", 0, "missing")
    skin.sleep(1.0)
    assert "supply_lost" in skin.health().board_faults
    skin.sleep(0.5)
    assert np.abs(skin.state().pressure_kpa).max() < 1.0
    with pytest.raises(bs.BubbleskinError):
        skin.show(np.full(n, 6.0))


@pytest.mark.promise("failure-on-request")
def test_failures_on_request_are_permitted_only_while_all_is_vented(skin):
    skin.show(np.full(skin.info.bubbles, 6.0))
    with pytest.raises(bs.DeviceRefused, match="not vented"):
        skin.permit_injection()
    assert skin.state().mode == "active"
    skin.vent()
    skin.permit_injection()
    skin.permit_injection(False)
    assert skin.faults() == {}


@pytest.mark.promise("emergency-stop")
@beyond_a_board
@no_pin
def test_the_emergency_stop_vents_whatever_is_asked(skin, press):
    n = skin.info.bubbles
    skin.show(np.full(n, 8.0))
    press(True)
    skin.sleep(0.1)
    assert skin.state().mode == "stopped"
    assert skin.health().board_faults == ("emergency_stop",)
    skin.sleep(1.0)
    assert np.abs(skin.state().pressure_kpa).max() < 1.0
    with pytest.raises(bs.DeviceRefused):
        skin.show(np.full(n, 6.0), wait=False)
    assert skin.state().mode == "stopped"


@pytest.mark.promise("emergency-stop")
@beyond_a_board
@no_pin
@pytest.mark.long
def test_the_emergency_stop_cannot_be_cleared_while_it_is_pressed(skin, press):
    n = skin.info.bubbles
    press(True)
    skin.sleep(1.5)
    pressed = skin.fault_log()[-1]
    skin.clear_faults()
    assert skin.fault_log()[-1] == pressed, "neither acknowledged nor, a tick later, there again"
    assert skin.state().mode == "stopped"
    assert skin.health().board_faults == ("emergency_stop",)
    press(False)
    skin.sleep(1.5)
    assert skin.state().mode == "stopped", "releasing it starts nothing, nor does what was cleared before"
    skin.clear_faults()
    assert skin.state().mode in ("venting", "idle")
    skin.show(np.full(n, 6.0))


@pytest.mark.promise("stuck-fill-valve")
@beyond_a_board
@pytest.mark.long
def test_a_fill_valve_that_stays_open_vents_all_and_empties_the_reservoir(skin, failing, record_property):
    n = skin.info.bubbles
    skin.show(np.full(n, 10.0), plan=False)
    failing("fill valve", 0, "stuck")
    highest = 0.0
    for _ in range(round(2.0 / skin.info.tick)):
        skin.sleep(skin.info.tick)
        highest = max(highest, skin.simulated.alone_mm.max())
    record_property("true height, mm (at most 15.6)", highest)
    assert highest <= 15.6
    assert "overfilled" in skin.health().board_faults
    assert skin.health().supply_kpa < 5
    assert np.abs(skin.state().pressure_kpa).max() < 1.0


@pytest.mark.promise("supply-lost", "reservoir-limit")
@beyond_a_board
@pytest.mark.long
def test_a_reservoirs_sensor_that_repeats_itself_is_not_believed(skin, failing, record_property):
    skin.show(np.full(skin.info.bubbles, 8.0))
    failing("supply", 0, "stuck")
    skin.simulated.inject("supply_stuck", 0, 2160)  # 50 kPa, so that the pump would go on
    most = 0.0
    for _ in range(round(2.0 / skin.info.tick)):
        skin.sleep(skin.info.tick)
        most = max(most, skin.simulated.plant.supply_pa / 1e3)
    record_property("true pressure of the reservoir, kPa (at most 75)", most)
    assert most <= 75.0
    assert "supply_lost" in skin.health().board_faults


@pytest.mark.promise("trim-limits")
def test_a_trim_beyond_the_boards_limits_is_refused_and_not_used(skin):
    trim = skin.trim()
    with pytest.raises(bs.DeviceRefused, match="zero"):
        skin.upload_trim(dataclasses.replace(trim, zero=trim.zero + 300))
    assert (skin.trim().zero == trim.zero).all()


@pytest.mark.promise("pressure-limit", "height-limit", "clearing-disarms-nothing")
@beyond_a_board
@pytest.mark.long
@pytest.mark.parametrize(
    ("part", "how"), [("sensor", "stuck"), ("fill valve", "off"), ("vent valve", "stuck"), ("tube", "off")]
)
def test_a_host_that_clears_all_the_time_disarms_nothing(skin, failing, part, how, record_property):
    """By the plant's truth, with heights up to the limit asked again and again."""
    n, board = skin.info.bubbles, skin.simulated
    most_kpa = most_mm = 0.0
    failing(part, 2, how)
    for k in range(40):
        asked = np.full(n, (9.0, skin.info.height_max_mm)[k // 4 % 2])
        with contextlib.suppress(bs.DeviceRefused):
            skin.show(asked, wait=False, plan=False)
        with contextlib.suppress(StopIteration):  # `clear_faults` would wait until an isolation is over
            skin.link.call("CLEAR").send(None)
        for _ in range(20):
            skin.sleep(skin.info.tick)
            most_kpa, most_mm = max(most_kpa, board.plant.pressure_pa.max() / 1e3), max(most_mm, board.alone_mm.max())
    record_property(f"true pressure, kPa (at most {skin.info.pressure_max_kpa + 1:g})", most_kpa)
    record_property(f"true height, mm (at most {skin.info.height_max_mm + 0.4:g})", most_mm)
    assert most_kpa <= skin.info.pressure_max_kpa + 1
    assert most_mm <= skin.info.height_max_mm + 0.4
