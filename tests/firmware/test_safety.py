"""Whatever goes wrong, the outputs are safe within the ticks stated here, and what is sound goes on."""

import random

import pytest

from bubble_protocol.schema import errors, faults, messages, modes, statuses

WRONG_READINGS = 2  # in a row that make a fault; one alone is noise
HELD_PA, HELD_UM = 22609, 10008  # a knot of the nominal table


def hold(rig):
    """All bubbles at 10 mm and settled there."""
    for bubble in range(rig.board.BUBBLES):
        rig.sense(bubble, HELD_PA)
    rig.show(HELD_UM)
    rig.tick(40)
    assert set(rig.state()["status"]) <= {statuses.SETTLED, statuses.UNSURE}


def vented(rig, bubble):
    return rig.pulse(bubble) == (0, rig.board.TICK_US)


def assert_isolated(rig, bubble, fault):
    """This bubble is vented for its fault, all others are controlled as before."""
    state = rig.state()
    assert state["faults"][bubble] & fault
    assert state["status"][bubble] == statuses.FAULT
    assert vented(rig, bubble)
    others = [other for other in range(rig.board.BUBBLES) if other != bubble]
    assert not state["faults"][others].any()
    assert set(state["status"][others]) <= {statuses.SETTLED, statuses.UNSURE}
    assert not any(vented(rig, other) for other in others)
    assert rig.app.safety.mode == modes.ACTIVE


WRONG = [
    pytest.param(lambda rig: rig.board.PRESSURE_MAX_PA + 50, faults.OVERPRESSURE, id="overpressure"),
    pytest.param(lambda rig: 0, faults.SENSOR_LOST, id="count 0"),
    pytest.param(lambda rig: rig.board.COUNT_LOW, faults.SENSOR_LOST, id="lowest count"),
    pytest.param(lambda rig: rig.board.COUNT_HIGH, faults.SENSOR_LOST, id="highest count"),
    pytest.param(lambda rig: 4095, faults.SENSOR_LOST, id="count 4095"),
]


def go_wrong(rig, bubble, wrong, fault):
    if fault == faults.OVERPRESSURE:
        rig.sense(bubble, wrong(rig))
    else:
        rig.hal.counts[bubble] = wrong(rig)


@pytest.mark.promise("pressure-limit", "isolation")
@pytest.mark.parametrize(("wrong", "fault"), WRONG)
def test_a_wrong_reading_isolates_its_bubble_within_two_ticks(rig, wrong, fault):
    hold(rig)
    bubble = rig.board.BUBBLES - 1
    go_wrong(rig, bubble, wrong, fault)
    rig.tick(WRONG_READINGS)
    assert vented(rig, bubble)
    assert_isolated(rig, bubble, fault)

    # It latches: a sensor that is well again changes nothing, nor does another shape.
    rig.sense(bubble, 0)  # for it is vented
    rig.tick(20)
    rig.show(HELD_UM)
    rig.tick(20)
    assert_isolated(rig, bubble, fault)

    # Cleared, it is controlled again.
    rig.clear()
    rig.sense(bubble, HELD_PA)
    rig.tick(40)
    assert not vented(rig, bubble)
    assert not rig.state()["faults"].any()


@pytest.mark.parametrize(("wrong", "fault"), WRONG)
def test_a_fault_that_is_cleared_but_still_there_is_a_fault_again(rig7, wrong, fault):
    hold(rig7)
    go_wrong(rig7, 0, wrong, fault)
    rig7.tick(WRONG_READINGS)
    if fault == faults.OVERPRESSURE:
        rig7.sense(0, 0)  # for it is vented
    rig7.clear()
    go_wrong(rig7, 0, wrong, fault)
    rig7.tick(WRONG_READINGS)
    assert_isolated(rig7, 0, fault)


@pytest.mark.parametrize(("wrong", "fault"), WRONG)
def test_one_wrong_reading_is_noise(rig7, wrong, fault):
    hold(rig7)
    for _ in range(5):
        go_wrong(rig7, 0, wrong, fault)
        rig7.tick()
        rig7.sense(0, HELD_PA)
        rig7.tick()
    assert not rig7.state()["faults"].any()


def test_readings_just_inside_the_range_are_believed(rig7):
    for count in (rig7.board.COUNT_LOW + 1, rig7.board.SENSOR_ZERO):
        rig7.hal.counts[0] = count
        rig7.tick(5)
        assert not rig7.state()["faults"].any()


@pytest.mark.promise("fill-valve-time")
def test_a_fill_valve_open_too_long_isolates_its_bubble(rig):
    """Bubble 0 wants more pressure than the reservoir has: its valve stays open, its count never rises."""
    board = rig.board
    for bubble in range(board.BUBBLES):
        assert rig.write_table(bubble, [(5000, 0), (14000, 40000)] if bubble == 0 else [(5000, 0), (14000, 34000)])
    rig.app.tables.swap()
    rig.app.bubbles.use_tables()
    rig.supply(29000)
    rig.hal.sags = False
    least = rig.hal.counts[-1]

    def tick(ticks=1):
        for _ in range(ticks):  # the pump's work shows in the reservoir, and gets it nowhere
            rig.hal.counts[-1] = least + 4 * (rig.app.clock.ticks % 20)
            rig.tick()

    rig.sense(0, 26000)
    tick(20)
    rig.show(14000, *[5000] * (board.BUBBLES - 1))
    tick()

    open_ticks = int(rig.pulse(0)[0] == board.TICK_US)
    while not vented(rig, 0):
        tick()
        open_ticks += rig.pulse(0)[0] == board.TICK_US
        if open_ticks > 1:
            rig.sense(0, 28300)  # what flows shows in the tube
        assert open_ticks * board.TICK_US <= board.FILL_MAX_US, "the valve is open for longer than allowed"
    assert open_ticks * board.TICK_US == board.FILL_MAX_US
    state = rig.state()
    assert state["faults"].tolist() == [faults.VALVE_TIME] + [0] * (board.BUBBLES - 1)
    assert vented(rig, 0)
    assert rig.app.safety.mode == modes.ACTIVE


@pytest.mark.promise("fill-valve-time")
@pytest.mark.parametrize("seed", range(4))
def test_no_fill_valve_is_ever_open_for_longer_than_allowed(rig7, seed):
    """Sensors that lie at random, at times for seconds: the limit holds, and no tick fails."""
    board = rig7.board
    chance = random.Random(seed)
    number = 1
    stretch = [0] * board.BUBBLES
    for tick in range(3000):
        if tick % 200 == 0:
            heights = [chance.choice([5000, 8000, 14000, chance.randrange(14001)]) for _ in range(board.BUBBLES)]
            over_ms = chance.choice([0, 0, 500])
            rig7.hal.to_device += rig7.encode("SHOW", number, (over_ms,), [(height,) for height in heights])
            rig7.hal.to_device += rig7.encode("CLEAR", number + 1)
            number += 2
            rig7.hal.counts[-1] = chance.choice([160, 500, 2560, 4000])
        if tick % 50 == 0:
            for bubble in range(board.BUBBLES):
                rig7.sense(bubble, chance.choice([0, 0, 5000, 21000, 35000, chance.randrange(42000)]))
        rig7.tick()
        for bubble in range(board.BUBBLES):
            fill, vent = rig7.pulse(bubble)
            assert fill == 0 or vent == 0, "both valves open empty the reservoir"
            assert fill == 0 or fill >= board.PULSE_MIN_US or stretch[bubble], "too short for a valve to open"
            stretch[bubble] = stretch[bubble] + fill if fill == board.TICK_US else 0
            assert stretch[bubble] <= board.FILL_MAX_US
    assert rig7.app.stats.exceptions == 0


@pytest.mark.promise("clearing-disarms-nothing")
@pytest.mark.parametrize(("wrong", "fault"), WRONG)
def test_clearing_all_the_time_does_not_disarm_the_guard(rig7, wrong, fault):
    hold(rig7)
    go_wrong(rig7, 0, wrong, fault)
    rig7.ask("CLEAR")
    for _ in range(10):
        rig7.ask("CLEAR")
        assert vented(rig7, 0)


@pytest.mark.promise("stop", "vent")
def test_stop_closes_and_vent_opens_all_valves(rig):
    hold(rig)
    rig.show(14000)
    rig.tick(2)
    for bubble in range(rig.board.BUBBLES):
        rig.sense(bubble, HELD_PA + 3000)  # what flows shows in the tube
    rig.tick(10)
    rig.ask("STOP")
    rig.tick()  # decided in the tick after the request
    assert not any(rig.hal.pulses)
    assert set(rig.state()["status"]) == {statuses.STOPPED}
    rig.ask("VENT")
    rig.tick()
    assert all(vented(rig, bubble) for bubble in range(rig.board.BUBBLES))
    assert set(rig.state()["status"]) == {statuses.RESTING}
    assert rig.app.safety.mode == modes.VENTING


def test_the_board_starts_vented(rig):
    assert rig.hal.safe
    rig.tick(3)
    assert all(vented(rig, bubble) for bubble in range(rig.board.BUBBLES))
    assert rig.app.safety.mode == modes.IDLE


# Exceptions.


@pytest.mark.promise("failing-tick")
@pytest.mark.parametrize("method", ["read_sensors", "write_outputs"])
def test_an_exception_in_the_tick_vents(rig, method):
    hold(rig)
    rig.hal.broken.add(method)
    rig.tick()
    assert rig.hal.safe
    assert rig.app.safety.mode == modes.VENTING
    assert rig.app.stats.exceptions == 1

    rig.hal.broken.clear()
    assert rig.ask("INFO")["exceptions"] == 1
    assert all(vented(rig, bubble) for bubble in range(rig.board.BUBBLES)), "it goes on venting until the next SHOW"


@pytest.mark.promise("failing-tick")
@pytest.mark.parametrize("method", ["read_sensors", "write_outputs"])
def test_a_board_that_fails_in_every_tick_still_answers(rig7, method):
    """So that one can ask what is wrong with it; and however often it is asked for a shape, it vents."""
    rig7.hal.broken.add(method)
    rig7.tick(10)
    assert rig7.ask("INFO")["exceptions"] == 11
    rig7.show(12000)
    rig7.tick()
    assert rig7.hal.safe
    assert rig7.app.safety.mode == modes.VENTING


def test_a_request_at_which_the_device_fails_is_refused_once(rig7, monkeypatch):
    hold(rig7)

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(rig7.app.commands, "show", fail)
    assert rig7.refused("SHOW", (0,), [(9000,)] * 7)[0] == errors.FAULTED
    assert rig7.hal.safe
    assert rig7.app.safety.mode == modes.VENTING
    assert rig7.ask("PING", (1,)).id == messages.PING | messages.REPLY

    # A failure later, with no request at hand, has nobody to be told to.
    assert rig7.refused("SHOW", (0,), [(9000,)] * 7)[0] == errors.FAULTED
    rig7.hal.broken |= {"read_sensors", "receive"}
    rig7.tick(3)
    assert rig7.heard() == []


def test_the_outputs_are_safe_before_anything_else_is_tried(rig7, monkeypatch):
    def fail(*_):
        raise MemoryError

    hold(rig7)
    rig7.hal.broken.add("read_sensors")
    monkeypatch.setattr(rig7.app.bubbles, "retract", fail)
    with pytest.raises(MemoryError):
        rig7.tick()
    assert rig7.hal.safe


@pytest.mark.parametrize("method", ["send", "receive"])
def test_a_broken_link_does_not_stop_the_tick(rig7, method):
    hold(rig7)
    rig7.hal.broken.add(method)
    rig7.hal.to_device += rig7.encode("PING", 1, (1,))
    rig7.tick(5)
    rig7.hal.broken.clear()
    rig7.hal.to_device = b""
    answer = rig7.ask("INFO")
    assert answer["exceptions"] >= 1
    assert answer["mode"] == modes.VENTING
    assert answer["ticks"] == rig7.app.clock.ticks


def test_a_supply_sensor_at_the_end_of_its_range_stops_the_pump(rig7):
    rig7.hal.counts[-1] = rig7.board.SUPPLY_ZERO
    rig7.tick(3)
    assert rig7.hal.pump == 65535
    for count in (0, rig7.board.COUNT_LOW, rig7.board.COUNT_HIGH, 4095):
        rig7.hal.counts[-1] = count
        rig7.tick()
        assert rig7.hal.pump == 0


def test_a_reservoir_above_its_limit_is_dumped(rig7):
    board = rig7.board
    rig7.hal.counts[-1] = board.SUPPLY_ZERO + (board.SUPPLY_MAX_PA + 1000) // board.SUPPLY_PA_PER_COUNT
    rig7.tick(30)
    assert rig7.hal.dump
    assert rig7.hal.pump == 0
    rig7.hal.counts[-1] = board.SUPPLY_ZERO + board.SUPPLY_PA // board.SUPPLY_PA_PER_COUNT
    rig7.tick(30)
    assert not rig7.hal.dump


def test_an_exception_between_two_ticks_vents_too(rig7):
    rig7.show(9000)
    rig7.tick(5)
    rig7.hal.broken = {"receive"}
    rig7.app.listen()
    assert rig7.hal.safe
    assert (rig7.app.safety.mode, rig7.app.stats.exceptions) == (modes.VENTING, 1)
    rig7.hal.broken = set()
    assert rig7.ask("INFO")["exceptions"] == 1
