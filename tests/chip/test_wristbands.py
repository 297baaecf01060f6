"""Whole wristbands with the real firmware on the emulated chip: boot, shapes, and chips that fail."""

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol.schema import injection
from bubbleskin.link.link import run_sync
from bubbleskin.sim.wiring import Wiring

pytestmark = pytest.mark.chip

DOME = {"wristband7": 12.0 - 0.02 * np.sum(bs.Layout.hexagon(rings=1).positions_mm ** 2, axis=1)}
DOME["wristband19"] = 12.0 - 0.015 * np.sum(bs.Layout.hexagon(rings=2).positions_mm ** 2, axis=1)


@pytest.mark.parametrize("name", list(DOME))
def test_a_dome_settles_through_the_chips(emulated, name):
    skin = emulated(name)
    board = skin.simulated
    assert skin.info.board == name
    assert board.time < 1.0  # HELLO has been answered
    assert board.chip.resets == 0
    skin.show(DOME[name])
    assert np.abs(board.height_mm - DOME[name]).max() < 0.2
    skin.sleep(0.3)
    assert np.abs(board.height_mm - DOME[name]).max() < 0.2
    health = skin.health()
    assert health.exceptions == 0
    skin.vent()
    skin.sleep(0.02)
    assert (board.pulses == [0.0, board.tick_s]).all()


def test_two_runs_are_the_same_to_the_bit(emulated):
    def run():
        skin = emulated("wristband7")
        skin.show(DOME["wristband7"], wait=False)
        skin.sleep(0.05)
        return skin.simulated.time, skin.simulated.height_mm.tobytes(), bytes(skin.simulated.chip.mcu.sram)

    assert run() == run()


def vented(board) -> bool:
    return bool((board.pulses == [0.0, board.tick_s]).all())


@pytest.mark.parametrize("name", ["wristband7", "wristband19"])
def test_a_converter_that_falls_silent_vents_its_bubbles_and_is_named(emulated, name):
    skin = emulated(name)
    board = skin.simulated
    skin.show(DOME[name], wait=False)
    skin.sleep(0.1)
    assert not vented(board)
    board.inject("converter_silent", 0)
    skin.sleep(5 * board.tick_s)
    on_it = board.data.CONVERTERS[0][1]
    assert (board.pulses[:on_it] == [0.0, board.tick_s]).all()
    assert "sensor_chip" in skin.health().board_faults
    assert set(skin.faults()) == set(range(on_it))
    others = slice(on_it, None)  # go on
    assert not (board.pulses[others] == [0.0, board.tick_s]).all() or on_it == len(board.pulses)


def test_a_valve_driver_that_falls_silent_is_cut_off_by_output_enable(emulated):
    skin = emulated("wristband19")
    board = skin.simulated
    skin.show(DOME["wristband19"], wait=False)
    skin.sleep(0.1)
    board.inject("driver_silent", 1)
    skin.sleep(3 * board.tick_s)
    assert vented(board)
    assert "valve_chip" in skin.health().board_faults


@pytest.mark.promise("emergency-stop")
def test_the_emergency_stop_vents_within_a_tick(emulated):
    skin = emulated("wristband7")
    board = skin.simulated
    skin.show(DOME["wristband7"], wait=False)
    skin.sleep(0.1)
    board.inject("estop")
    skin.sleep(2 * board.tick_s)  # the ticks of the chip are not in step with ours
    assert vented(board)
    assert "emergency_stop" in skin.health().board_faults
    with pytest.raises(bs.DeviceRefused):
        skin.show(DOME["wristband7"])
    board.inject("estop", value=0)
    skin.sleep(2 * board.tick_s)  # an emergency stop that is pressed cannot be acknowledged
    skin.clear_faults()
    skin.show(DOME["wristband7"], wait=False)
    skin.sleep(3 * board.tick_s)
    assert not vented(board)


def test_a_board_that_is_wired_wrongly_moves_what_is_wired(emulated):
    """Place 1 leads to bubble 4 and its sensor says so: the firmware notices nothing. Vent 6 has no current."""
    board = (skin := emulated("wristband7", wiring=Wiring(tubes=((1, 4),), dead=("vent6",)))).simulated
    skin.show([5.0, 9.0, 5.0, 5.0, 5.0, 5.0, 5.0])
    assert board.height_mm.argmax() == 4
    assert np.abs(board.height_mm[4] - 9.0) < 0.2
    skin.show([5.0] * 6 + [9.0], wait=False)
    skin.sleep(0.3)
    assert board.height_mm[6] < 7.0
    assert 6 in skin.faults()


def test_an_emergency_stop_the_wrong_way_round_is_found(emulated):
    found = bs.bring_up(emulated("wristband7", wiring=Wiring(estop="open")))
    assert [finding.name for finding in found.findings] == ["estop_normally_open"]


def test_a_converter_that_is_missing_is_named_after_boot(emulated):
    skin = emulated("wristband7", absent=("converter0",))
    skin.sleep(0.05)
    assert vented(skin.simulated)
    assert "sensor_chip" in skin.health().board_faults


def test_a_valve_driver_that_is_missing_is_named_after_boot_and_the_others_stay_safe(emulated):
    skin = emulated("wristband19", absent=("driver2",))
    skin.sleep(0.05)
    assert vented(skin.simulated)
    assert "valve_chip" in skin.health().board_faults
    with pytest.raises(bs.DeviceRefused, match="valve driver"):
        skin.show(DOME["wristband19"])
    assert vented(skin.simulated)


@pytest.mark.promise("self-test")
def test_the_self_test_at_boot_finds_a_stuck_valve_and_no_other(emulated):
    skin = emulated("wristband7")
    skin.simulated.inject("fill_stuck", 3, -1)
    for _ in range(40):
        skin.sleep(0.1)
        health = skin.health()
        if health.self_test not in ("running", "not_run"):
            break
    assert health.self_test == "failed"
    assert health.unfilled == (3,)
    assert health.untrue_zero == ()


@pytest.mark.promise("failing-tick")
def test_a_program_that_hangs_is_ended_by_the_watchdog_and_says_so_afterwards(emulated):
    skin = emulated("wristband7")
    board = skin.simulated
    skin.show(DOME["wristband7"], wait=False)
    skin.sleep(0.1)
    assert not vented(board)
    board.inject("hang")
    hung = board.time
    while not vented(board):
        board.tick()
        assert board.time < hung + 0.12
    assert board.chip.resets == 1
    while not board.chip.connected:
        board.tick()

    def ask():
        for _ in range(20):
            skin.sleep(0.1)
            skin.state()

    with pytest.raises(bs.DeviceRestarted):  # told once, to whoever asks when it is noticed
        ask()
    health = skin.health()
    assert "watchdog" in health.board_faults
    assert health.mode in ("boot", "idle")


@pytest.mark.parametrize("name", ["wristband7", "wristband19"])
def test_failures_on_request_make_no_tick_late(emulated, name):
    """As a real board is asked for them: by the link."""
    skin = emulated(name)
    ill = skin.info.bubbles - 1
    skin.permit_injection()
    skin.show(DOME[name], wait=False)
    for request in ((injection.FILL_SHUT, 0, 1), (injection.VENT_OPEN, ill, 1), (injection.SENSOR_MISSING, ill - 1, 1)):
        run_sync(skin.link.call("INJECT", request))
    skin.sleep(0.3)
    assert ill - 1 in skin.faults()
    assert skin.simulated.pulses[0, 0] == 0.0
    assert skin.simulated.pulses[ill, 1] == skin.simulated.tick_s
    assert skin.health().late_ticks == 0
