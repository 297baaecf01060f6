"""Rules that nothing else would miss: each of these tests fails when one line of the firmware is left out or moved."""

import pytest

from bubble_firmware.control.state_layout import ROW_WORDS, STATUS
from bubble_protocol.schema import errors, faults, messages, modes, statuses

HELD_PA, HELD_UM = 22609, 10008  # a knot of the nominal table


def hold(rig):
    for bubble in range(rig.board.BUBBLES):
        rig.sense(bubble, HELD_PA)
    rig.show(HELD_UM)
    rig.tick(40)


@pytest.mark.promise("height-refused")
def test_no_bubble_may_be_asked_for_more_than_the_boards_height(rig):
    n, most = rig.board.BUBBLES, rig.board.HEIGHT_MAX_UM
    for bubble in range(n):
        heights = [(most + 1 if other == bubble else most,) for other in range(n)]
        answer = rig.refused("SHOW", (0,), heights)
        assert answer == (errors.OUT_OF_RANGE, 1, bubble, most + 1, 0, most)
    assert set(rig.state()["target_um"]) == {rig.board.HEIGHT_REST_UM}


# The emergency stop.


def press(rig, pressed):
    rig.hal.active_faults = faults.ESTOP if pressed else 0
    rig.tick()


@pytest.mark.promise("emergency-stop")
def test_a_pressed_emergency_stop_cannot_be_acknowledged(rig):
    hold(rig)
    press(rig, True)
    rig.tick(1_500_000 // rig.board.TICK_US)
    n = rig.board.BUBBLES
    for _ in range(3):  # CLEAR and SHOW in the same tick
        for name, fixed, repeated in (("CLEAR", (), ()), ("SHOW", (0,), [(9000,)] * n)):
            rig.hal.to_device += rig.encode(name, rig.next_sequence(messages.SHOW), fixed, repeated)
        rig.heard()
        rig.tick()
        clear, show = rig.heard()
        assert clear.id == messages.CLEAR | messages.REPLY
        assert (show.id, show["error"], show["asked"]) == (messages.ERROR, errors.BOARD_FAULT, faults.ESTOP)
        assert rig.app.safety.mode == modes.STOPPED
    assert rig.app.faults.log.acknowledged < rig.app.faults.log.newest


@pytest.mark.promise("emergency-stop")
def test_releasing_the_button_starts_nothing_even_after_a_clear_while_it_was_pressed(rig):
    press(rig, True)
    rig.ask("CLEAR")
    press(rig, False)
    rig.tick(3_000_000 // rig.board.TICK_US)
    assert rig.app.safety.mode == modes.STOPPED
    rig.ask("CLEAR")
    assert rig.app.safety.mode == modes.VENTING


@pytest.mark.promise("emergency-stop")
def test_pressed_again_within_the_isolation_it_has_to_be_acknowledged_again(rig):
    press(rig, True)
    press(rig, False)
    assert rig.ask("CLEAR")["isolated_ms"] > 0
    press(rig, True)
    press(rig, False)
    rig.tick(3_000_000 // rig.board.TICK_US)
    assert rig.app.safety.mode == modes.STOPPED


# The watchdog.


@pytest.mark.promise("failing-tick")
@pytest.mark.parametrize("method", ["read_sensors", "write_outputs"])
def test_a_tick_that_fails_does_not_feed_the_watchdog(rig, method):
    fed = []
    rig.hal.feed_watchdog = lambda mode, faults: fed.append(mode)
    rig.tick(5)
    assert len(fed) == 5
    rig.hal.broken.add(method)
    rig.tick(20)
    assert len(fed) == 5
    rig.hal.broken.clear()
    rig.tick()
    assert len(fed) == 6


# Acknowledging.


@pytest.mark.promise("fault-stays")
def test_acknowledging_one_fault_forgets_no_other(rig):
    """Both have passed: what stands is only what has not been acknowledged, of bubbles and of the board."""
    hold(rig)
    seen = []
    for bubble in (0, 1):
        rig.hal.counts[bubble] = 0
        rig.tick(3)
        rig.sense(bubble, 0)
        rig.tick(3)
        seen.append(rig.app.faults.log.newest)
    rig.hal.active_faults = faults.VALVE_CHIP
    rig.tick(2)
    rig.hal.active_faults = 0
    for bubble in range(rig.board.BUBBLES):
        rig.sense(bubble, 0)
    rig.tick(1_500_000 // rig.board.TICK_US)
    assert rig.ask("FAULTS_ACK", (seen[0],))["isolated_ms"] == 0
    rig.tick(5)
    assert (rig.app.bubbles.faults(0), rig.app.bubbles.faults(1)) == (0, faults.SENSOR_LOST)
    assert rig.app.faults.board == faults.VALVE_CHIP
    rig.ask("FAULTS_ACK", (seen[1],))
    rig.tick(5)
    assert (rig.app.bubbles.faults(1), rig.app.faults.board) == (0, faults.VALVE_CHIP)


def test_what_went_wrong_before_the_emergency_stop_can_be_acknowledged_while_it_is_pressed(rig):
    rig.hal.counts[0] = 0
    rig.tick(3)
    press(rig, True)
    newest = rig.app.faults.log.newest
    rig.ask("CLEAR")
    assert rig.app.faults.log.acknowledged == newest - 1


# Leaks, in a plant.


def simulated(attack, heights_um=(10500,)):
    attacked = attack(1.0, heights_um)
    attacked.run(1.0, attack=False)
    assert not attacked.seen
    return attacked


def seconds_until(attacked, fault, most):
    board = attacked.board
    begun = board.time
    while board.time - begun < most:
        attacked.run(0.05, attack=False)
        if attacked.seen & fault:
            return board.time - begun
    raise AssertionError(f"not found within {most} s")


def test_a_leak_that_control_makes_up_for_is_found_by_the_air_that_is_missing(attack):
    attacked = simulated(attack)
    attacked.board.inject("leak", attacked.ILL, 200e-3 / HELD_PA)  # 200 µJ/ms at 10 mm
    assert seconds_until(attacked, faults.LEAK, 3.0) < 1.0
    assert attacked.pressure_pa.max() < attacked.board.data.PRESSURE_MAX_PA


@pytest.mark.parametrize(
    ("failure", "value", "fault"),
    [("leak", 200e-3 / HELD_PA, faults.LEAK), ("fill_stuck", 1.0, faults.VALVE_STUCK)],
)
def test_a_closed_line_that_does_not_keep_its_pressure_is_found_while_no_valve_moves(attack, failure, value, fault):
    """Held by STOP nothing is dosed: neither the air balance nor the flow of an open valve says anything."""
    attacked = simulated(attack)
    attacked.send("STOP")
    attacked.run(0.5, attack=False)
    rows = attacked.app.bubbles.rows
    assert {rows[at] for at in range(STATUS, len(rows), ROW_WORDS)} == {statuses.STOPPED}
    attacked.board.inject(failure, attacked.ILL, value)
    assert seconds_until(attacked, fault, 1.0) <= 0.35
