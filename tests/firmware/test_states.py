"""The board's states, the deadman and the settings: whatever happens in whatever order, and to the tick."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bubble_firmware.app import App
from bubble_firmware.device_clock import LATEST, DeviceClock
from bubble_firmware.safety import state as safety
from bubble_firmware.safety.fault_log import FaultLog
from bubble_protocol.schema import errors, messages, modes, system
from bubble_protocol.schema.faults import BOARD, BUDGET, ESTOP, HOST_SILENT, OVERFILLED, VALVE_CHIP, VENTING
from bubble_protocol.schema.modes import ACTIVE, BOOT, FAULTED, HOLDING, IDLE, STOPPED
from bubble_protocol.schema.modes import VENTING as MODE_VENTING
from bubble_protocol.schema.settings import BUDGET_KPA_S, DEADMAN_HOLD
from bubbleskin.link import message as wire

HELD_PA, HELD_UM = 22609, 10008  # a knot of the nominal table
SESSION = 0x89ABCDEF  # that a rig opens


def hold(rig):
    for bubble in range(rig.board.BUBBLES):
        rig.sense(bubble, HELD_PA)
    rig.show(HELD_UM)
    rig.tick(40)


def silence(rig, ticks):
    """Let periods pass without a word of the host's."""
    for _ in range(ticks):
        rig.app.tick()


def vented(rig):
    return all(rig.pulse(bubble) == (0, rig.board.TICK_US) for bubble in range(rig.board.BUBBLES))


# The table.

EVENTS = range(safety.CLEAR + 1)


@pytest.mark.promise("states")
@given(st.lists(st.sampled_from(EVENTS), max_size=40))
def test_whatever_happens_the_emergency_stop_wins_and_a_fault_is_cleared_before_a_show(events):
    class Board:
        TICK_US = 5000

    state = safety.SafetyState(Board)
    standing = None  # what has to be acknowledged
    for event in events:
        state.handle(event)
        if event == safety.ESTOP:
            standing = STOPPED
        elif event == safety.BOARD_FAULT and standing is None:
            standing = FAULTED
        elif event == safety.CLEAR:
            standing = None
        assert (state.mode == standing) if standing is not None else state.mode not in (STOPPED, FAULTED)
        assert state.control_mode == {ACTIVE: 1, HOLDING: 2}.get(state.mode, 0)
        if event in (safety.VENT, safety.HOST_SILENT, safety.EXCEPTION):
            assert state.control_mode == 0
    assert state.mode in {number for number, _, _ in modes.MODES}


@pytest.mark.parametrize("event", EVENTS)
def test_only_a_clear_ends_an_emergency_stop(event):
    class Board:
        TICK_US = 5000

    state = safety.SafetyState(Board)
    state.handle(safety.ESTOP)
    assert state.handle(event) == (event == safety.CLEAR)
    assert state.mode == (MODE_VENTING if event == safety.CLEAR else STOPPED)


REQUESTS = ("SHOW", "STOP", "VENT", "CLEAR", "FAULTS_ACK", "PING", "silence", "long silence", "tick")
THINGS = st.one_of(
    st.sampled_from(REQUESTS), st.sampled_from([("alarm", bits) for bits in (0, ESTOP, VALVE_CHIP, ESTOP | VALVE_CHIP)])
)


@pytest.mark.promise("states")
@pytest.mark.medium
@settings(max_examples=25)
@given(things=st.lists(THINGS, max_size=20))
def test_the_firmware_is_never_active_while_a_venting_fault_stands(new_rig, things):
    rig = new_rig("wristband7")
    for thing in things:
        if isinstance(thing, tuple):
            rig.hal.active_faults = thing[1]
            rig.app.deadman.host_activity()
            rig.app.tick()
        elif "silence" in thing:
            silence(rig, 210 if "long" in thing else 55)
            if "long" in thing:
                assert rig.app.safety.control_mode == 0
        elif thing == "tick":
            rig.tick(3)
        elif thing == "SHOW":
            rig.ask("SHOW", (0,), [(9000,)] * 7)
        else:
            rig.ask(thing, (rig.app.faults.log.newest,) if thing == "FAULTS_ACK" else (0,) if thing == "PING" else ())
        mode, faults = rig.app.safety.mode, rig.app.faults.board
        if rig.hal.active_faults & VENTING:
            rig.tick()
            assert rig.app.safety.mode == (STOPPED if rig.app.faults.board & ESTOP else FAULTED)
            assert vented(rig), "whatever was asked"
        elif faults & ESTOP:
            assert mode == STOPPED
        elif faults & VENTING:
            assert mode == FAULTED
        else:
            assert mode not in (STOPPED, FAULTED)
    assert rig.app.stats.exceptions == 0


@pytest.mark.promise("states")
def test_boot_idle_active_venting_idle(rig):
    assert rig.app.safety.mode == BOOT
    rig.tick()
    assert rig.app.safety.mode == IDLE
    hold(rig)
    assert rig.app.safety.mode == ACTIVE
    rig.ask("VENT")
    rig.tick(3)
    assert rig.app.safety.mode == MODE_VENTING
    for bubble in range(rig.board.BUBBLES):
        rig.sense(bubble, 0)
    rig.tick()
    assert rig.app.safety.mode == IDLE


# The deadman.


@pytest.mark.promise("silence")
@pytest.mark.parametrize("moving", [True, False])
def test_a_silent_host_holds_what_moves_and_then_vents_to_the_tick(rig, moving):
    board = rig.board
    hold(rig)
    if moving:
        rig.show(12000, over_ms=5000)  # answered in this tick: silence begins
    else:
        rig.ask("PING", (0,))
    hold_ticks, vent_ticks = 250000 // board.TICK_US, 1000000 // board.TICK_US
    for tick in range(1, vent_ticks + 1):
        rig.app.tick()
        expected = MODE_VENTING if tick == vent_ticks else HOLDING if moving and tick >= hold_ticks else ACTIVE
        assert rig.app.safety.mode == expected, tick
        if expected == HOLDING and tick > hold_ticks:
            assert not any(rig.hal.pulses)
    assert vented(rig), "decided in the same tick"
    log = rig.ask("FAULTS_READ", (0,))
    assert log.columns["what"].tolist() == [HOST_SILENT] * (2 if moving else 1)
    assert log.columns["value"].tolist() == [250, 1000][0 if moving else 1 :]
    assert set(log.columns["bubble"]) == {BOARD}
    assert not rig.app.faults.board, "it forbids nothing"
    rig.show(HELD_UM)
    assert rig.app.safety.mode == ACTIVE


def test_a_host_that_speaks_is_not_silent(rig7):
    hold(rig7)
    rig7.show(12000, over_ms=5000)
    for _ in range(30):
        silence(rig7, 48)
        rig7.ask("PING", (0,))
        assert rig7.app.safety.mode == ACTIVE
    garbage = b"\x07garbage\x00"
    for _ in range(25):
        rig7.hal.to_device += garbage
        silence(rig7, 10)
    assert rig7.app.safety.mode == MODE_VENTING


@pytest.mark.promise("silence")
@pytest.mark.parametrize("greeting", ["no protocol in common", "no session", "a session that is over"])
def test_a_host_that_is_refused_keeps_nothing_alive(rig7, greeting):
    rig7.open(SESSION + 1)
    hold(rig7)
    asked = {"no protocol in common": (9, 9, 5), "no session": (2, 2, 0), "a session that is over": (2, 2, SESSION)}
    for tick in range(3_000_000 // rig7.board.TICK_US):
        if not tick % 10:
            rig7.hal.to_device += wire.encode("HELLO", 0, asked[greeting])
        rig7.app.tick()
    assert rig7.app.safety.control_mode == 0
    assert vented(rig7)
    refusals = [message for message in rig7.heard() if message.id == messages.ERROR]
    assert len(refusals) > 50


def test_a_host_without_a_session_keeps_nothing_alive(rig7):
    rig7.app = App(rig7.board, rig7.hal)
    key = wire.session_key(rig7.hal.boot_id, 0)
    rig7.hal.to_device += wire.encode("SHOW", 1, (0,), [(9000,)] * 7, key)
    for tick in range(3_000_000 // rig7.board.TICK_US):
        if not tick % 10:
            rig7.hal.to_device += wire.encode("PING", 0, (0,), (), key)
        rig7.app.tick()
    assert rig7.app.safety.control_mode == 0
    assert vented(rig7)


def test_a_host_that_has_a_session_keeps_alive_by_its_greeting_too(rig7):
    hold(rig7)
    for tick in range(3_000_000 // rig7.board.TICK_US):
        if not tick % 10:
            rig7.hal.to_device += wire.encode("HELLO", 0, (2, 2, SESSION))
        rig7.app.tick()
    assert rig7.app.safety.mode == ACTIVE


@pytest.mark.promise("silence")
def test_held_by_stop_it_vents_when_the_host_is_silent(rig7):
    hold(rig7)
    rig7.ask("STOP")
    silence(rig7, 199)
    assert rig7.app.safety.mode == HOLDING
    silence(rig7, 1)
    assert rig7.app.safety.mode == MODE_VENTING


# Settings.


@pytest.mark.promise("deadman-stays")
def test_settings_are_kept_within_the_boards_limits(rig7):
    read = rig7.ask("SETTING_READ").columns
    for number, low, high in zip(read["setting"].tolist(), read["low"].tolist(), read["high"].tolist(), strict=True):
        for value in (*range(max(low - 1, 0), low), high + 1):
            answer = rig7.refused("SETTING_WRITE", (), [(DEADMAN_HOLD, 60), (number, value)])
            assert answer == (errors.OUT_OF_RANGE, 1, 1, value, low, high)
    assert rig7.refused("SETTING_WRITE", (), [(0, 100), (5, 1)]) == (errors.NO_SETTING, 0, 1, 5, 0, 4)
    assert rig7.refused("SETTING_WRITE", (), [(0, 3000)]) == (errors.OUT_OF_RANGE, 1, 255, 1000, 3000, 60000)
    assert (rig7.ask("SETTING_READ").columns["value"] == read["value"]).all(), "all or none"
    rig7.ask("SETTING_WRITE", (), [(1, 5000), (0, 3000)])
    assert rig7.ask("SETTING_READ").columns["value"].tolist() == [3000, 5000, 3600, 101325, 250]
    assert rig7.app.settings.version == 1
    hold(rig7)
    rig7.ask("PING", (0,))
    silence(rig7, 999)
    assert rig7.app.safety.mode == ACTIVE
    silence(rig7, 1)
    assert rig7.app.safety.mode == MODE_VENTING


@pytest.mark.promise("budget")
def test_the_budget_vents_a_bubble_and_lets_it_recover(rig7):
    rig7.ask("SETTING_WRITE", (), [(BUDGET_KPA_S, 60)])
    hold(rig7)
    ticks = 0
    while not rig7.app.bubbles.faults(0):
        rig7.tick()
        ticks += 1
    assert rig7.app.bubbles.faults(0) == BUDGET
    assert 40 + ticks == pytest.approx(60_000 / (HELD_PA - 20_000) * 200, rel=0.02)
    for bubble in range(7):
        rig7.sense(bubble, 0)
    rig7.clear()
    rig7.tick()
    assert rig7.app.bubbles.faults(0) == BUDGET, "not yet: 20 kPa below the threshold, half of 60 kPa s takes 1.5 s"
    rig7.clear()
    rig7.tick()
    assert rig7.app.bubbles.faults(0) == 0


# The log.


@pytest.mark.promise("fault-stays")
def test_what_comes_after_the_entry_acknowledged_stays(rig7):
    hold(rig7)
    rig7.hal.counts[0] = 0
    rig7.tick(5)
    seen = rig7.ask("FAULTS_READ", (0,))["newest"]
    rig7.hal.counts[1] = 0
    rig7.tick(5)
    rig7.sense(0, 0)
    rig7.tick(rig7.isolation_ticks(rig7.ask("FAULTS_ACK", (seen,))))
    assert rig7.app.bubbles.faults(0) == 0
    assert rig7.app.bubbles.faults(1)
    log = rig7.ask("FAULTS_READ", (seen,))
    assert log["acknowledged"] == seen
    assert log.columns["bubble"].tolist()[0] == 1


@pytest.mark.promise("fault-stays")
def test_the_log_keeps_the_last_sixteen(rig7):
    for tick in range(40):
        rig7.app.faults.log.add(tick, 1, 0, tick)
    first = rig7.ask("FAULTS_READ", (0,))
    rest = rig7.ask("FAULTS_READ", (int(first.columns["id"][-1]),))
    assert [*first.columns["id"], *rest.columns["id"]] == list(range(25, 41))
    assert len(rig7.ask("FAULTS_READ", (40,)).columns["id"]) == 0


def test_ids_end_before_integers_become_long():
    log = FaultLog()
    log.newest = 0x3FFFFFFE
    assert [log.add(0, 1, 0, 0) for _ in range(3)] == [0x3FFFFFFF] * 3


def test_device_time_wraps_before_integers_become_long(rig7):
    assert system.TICKS_WRAP - 1 == LATEST
    clock = DeviceClock()
    for ticks, periods, expected in ((LATEST, 0, LATEST), (LATEST, 1, 0), (LATEST - 3, 10, 6)):
        clock.ticks = ticks
        clock.advance(periods)
        assert clock.ticks == expected
    rig7.app.clock.ticks = LATEST - 1
    rig7.tick(3)
    assert rig7.app.clock.ticks == 1


@pytest.mark.promise("stuck-fill-valve")
def test_an_overfilled_bubble_vents_all_and_empties_the_reservoir(rig7):
    hold(rig7)
    rig7.ask("VENT")
    for bubble in range(7):
        rig7.sense(bubble, 0)
    rig7.tick(5)
    rig7.sense(2, 25000)  # it fills by itself
    rig7.tick(1 + 300000 // rig7.board.TICK_US)
    assert rig7.app.safety.mode == FAULTED
    assert rig7.app.faults.board == OVERFILLED
    rig7.tick()
    assert (rig7.hal.pump, rig7.hal.dump) == (0, 1)
    assert vented(rig7)
    assert rig7.refused("SHOW", (0,), [(9000,)] * 7)[0] == errors.BOARD_FAULT


@pytest.mark.promise("supply-below-bubble")
def test_no_fill_valve_opens_to_a_supply_below_the_bubble(rig7):
    hold(rig7)
    rig7.supply(20000)
    rig7.tick(10)
    rig7.show(13000)
    for _ in range(60):
        rig7.tick()
        assert not any(rig7.hal.pulses[::2])
    assert not any(rig7.app.bubbles.faults(bubble) for bubble in range(7)), "nor is that the bubbles' fault"
