"""Sequences on the device: their schedule to the tick, conditions, repeats, streams, and everything that is refused."""

import random

import pytest

from bubble_firmware import boards
from bubble_protocol import codec, steps
from bubble_protocol.schema import errors, faults, messages, modes, sequences
from bubble_protocol.schema.sequences import (
    BY_SETTLING,
    BY_TIME,
    BY_TIMEOUT,
    CANCELLED,
    COMPLETE,
    SEQUENCE_ENDED,
    SEQUENCE_PAUSED,
    SEQUENCE_RESUMED,
    STEP_BEGUN,
    UNENDED,
)

WHOLE = 255


# The schedule.


def test_steps_begin_in_their_ticks(sequencer):
    tick = sequencer.rig.board.TICK_US // 1000
    start = sequencer.play(
        sequencer.all(6000, ramp=100, after=50), sequencer.all(8000, ramp=30), sequencer.all(7000, after=200)
    )
    sequencer.until_ended()
    assert sequencer.events == [
        (STEP_BEGUN, UNENDED, 0, start),
        (STEP_BEGUN, BY_TIME, 1, start + 150 // tick),
        (STEP_BEGUN, BY_TIME, 2, start + 180 // tick),
        (SEQUENCE_ENDED, COMPLETE, 2, start + 380 // tick),
    ]
    assert [one.sequence for one in sequencer.told] == [0, 1, 2, 3]


def test_times_that_are_no_whole_ticks_do_not_drift(sequencer):
    rng = random.Random(5)
    lengths = [rng.randrange(11, 60) for _ in range(200)]
    start = sequencer.play(*(sequencer.all(6000, ramp=ms // 3, after=ms - ms // 3) for ms in lengths))
    sequencer.until_ended()
    tick_us = sequencer.rig.board.TICK_US
    due = [start + sum(lengths[:k]) * 1000 // tick_us for k in range(len(lengths))]
    assert sequencer.begun() == due
    assert sequencer.told[-1]["ticks"] == start + sum(lengths) * 1000 // tick_us


def test_a_late_tick_changes_no_later_one(seven):
    start = seven.play(*(seven.all(6000 + 100 * k, after=15) for k in range(40)))
    seven.tick(20)
    seven.rig.app.clock.ticks += 30  # periods that nobody saw
    seven.until_ended()
    assert seven.begun()[-1] == start + 39 * 3
    assert seven.rig.app.stats.exceptions == 0


def test_a_start_at_a_tick(sequencer):
    sequencer.load(sequencer.all(9000, ramp=1000))
    at = sequencer.rig.app.clock.ticks + 50
    assert sequencer.start(at) == at
    sequencer.tick(20)
    assert sequencer.state()["state"] == sequences.WAITING
    assert sequencer.rig.app.safety.mode in (modes.BOOT, modes.IDLE), "until then nothing happens"
    sequencer.until_ended()
    assert sequencer.begun() == [at]
    assert sequencer.rig.app.safety.mode == modes.ACTIVE


def test_a_start_that_has_passed_is_refused(sequencer):
    sequencer.load(sequencer.all(9000, ramp=1000))
    now = sequencer.rig.app.clock.ticks
    assert sequencer.refusal("SEQUENCE_START", 7, now) == (errors.TOO_LATE, 1, WHOLE, now, now + 2, 0), (
        "it is heard in the next tick"
    )
    assert sequencer.refusal("SEQUENCE_START", 7, 1)[0] == errors.TOO_LATE
    assert sequencer.state()["state"] == sequences.ARMED
    soon = sequencer.rig.app.clock.ticks + 2
    assert sequencer.start(soon) == soon


# The way of a ramp.


@pytest.mark.parametrize("easing", [steps.LINEAR, steps.SMOOTH, steps.IN, steps.OUT])
def test_a_ramp_follows_its_easing(seven, easing):
    way = {
        steps.LINEAR: lambda p: p,
        steps.SMOOTH: lambda p: 3 * p**2 - 2 * p**3,
        steps.IN: lambda p: p**2,
        steps.OUT: lambda p: 1 - (1 - p) ** 2,
    }[easing]
    seven.play(seven.all(12000, ramp=500, easing=easing, after=100), seven.all(6000, ramp=400, easing=easing))
    for tick in range(1, 121):
        seven.tick()
        share = min(tick / 100, 1)
        assert seven.setpoints() == pytest.approx([5000 + 7000 * way(share)] * 7, abs=3)
    for tick in range(1, 80):
        seven.tick()
        assert seven.setpoints() == pytest.approx([12000 - 6000 * way(tick / 80)] * 7, abs=3)


def test_a_target_left_out_stays(seven):
    leave = steps.LEAVE
    first = seven.record(seven.step(6000, 7000, 8000, 9000, 10000, 11000, 12000, after=50))
    second = seven.record(seven.step(7000, leave, leave, leave, leave, leave, 0, ramp=100, after=500))
    seven.play(first, second)
    seven.tick(40)
    assert seven.setpoints() == [7000, 7000, 8000, 9000, 10000, 11000, 5000]
    assert seven.ask("STATE").columns["target_um"].tolist() == [7000, 7000, 8000, 9000, 10000, 11000, 5000]


def test_a_target_below_rest_is_reached_at_the_end_of_the_ramp(seven):
    seven.play(seven.all(12000, after=50), seven.all(0, ramp=500))
    seven.tick(10 + 50)
    assert seven.setpoints() == pytest.approx([8500] * 7, abs=80)


# Conditions.


def test_a_step_ends_when_all_are_settled(seven):
    pressure = 22600  # 10 mm by the nominal table
    seven.play(seven.all(10000, tolerance=300, timeout=5000), seven.all(6000, after=100))
    for pascals in range(0, pressure, 1500):  # or the guard would miss it
        assert seven.begun()[1:] == []
        for bubble in range(7):
            seven.rig.sense(bubble, pascals)
        seven.tick()
    for bubble in range(7):
        seven.rig.sense(bubble, pressure)
    seven.tick(60)
    assert seven.events[1][:3] == (STEP_BEGUN, BY_SETTLING, 1)
    assert seven.told[1]["unsettled"] == 0
    assert seven.events[2][:3] == (SEQUENCE_ENDED, COMPLETE, 1)
    assert seven.events[2][3] == seven.events[1][3] + 20


def test_no_step_settles_before_its_ramp_has_ended(seven):
    start = seven.play(seven.all(5000, ramp=400, tolerance=300, timeout=5000), seven.all(0, after=10))
    seven.until_ended()
    assert seven.events[1][1:] == (BY_SETTLING, 1, start + 80)


THEN = {
    steps.GO_ON: (STEP_BEGUN, modes.ACTIVE),
    steps.HOLD: (SEQUENCE_ENDED, modes.ACTIVE),
    steps.VENT: (SEQUENCE_ENDED, modes.IDLE),
    steps.STOP: (SEQUENCE_ENDED, modes.HOLDING),
}


@pytest.mark.parametrize("then", THEN)
def test_a_condition_that_never_comes_ends_by_its_timeout(seven, then):
    event, mode = THEN[then]
    targets = [5000, 10000, 5000, 5000, 10000, 5000, 5000]
    start = seven.play(
        seven.record(seven.step(*targets, ramp=100, tolerance=200, timeout=400, then=then)), seven.all(5000, after=1000)
    )
    seven.tick(110)
    assert seven.events[1][:2] == (event, BY_TIMEOUT)
    assert seven.events[1][3] == start + 100
    assert seven.told[1]["unsettled"] == 0b0010010, "those that were not there are named"
    assert seven.state()["timeouts"] == 1
    assert seven.rig.app.safety.mode == mode
    if then == steps.HOLD:
        assert seven.ask("STATE").columns["target_um"].tolist() == targets


def test_a_bubble_with_a_fault_never_settles_and_the_others_go_on(seven):
    seven.rig.hal.counts[2] = 0xFFFF
    seven.tick(5)
    seven.play(seven.all(5000, tolerance=200, timeout=300), seven.all(5000, after=50))
    seven.until_ended()
    assert seven.told[1]["reason"] == BY_TIMEOUT
    assert seven.told[1]["unsettled"] == 1 << 2


# Repeats.


def unrolled(records):
    """What a program of records plays, by recursion, unlike the device."""

    def block(at):
        played = []
        while at < len(records) and records[at][0] != steps.END:
            if records[at][0] == steps.REPEAT:
                inner, end = block(at + 1)
                played += inner * records[at][1]
                at = end + 1
            else:
                played.append(at)
                at += 1
        return played, at

    return block(0)[0]


def random_program(rng, sequencer, depth=4, most=4):
    records = []
    for _ in range(rng.randrange(1, most)):
        if depth and rng.random() < 0.4:
            inner = random_program(rng, sequencer, depth - 1, 3)
            records += [sequencer.repeat(rng.randrange(1, 4)), *inner, sequencer.end()]
        else:
            records.append(sequencer.all(rng.randrange(0, 14000), after=rng.randrange(10, 40)))
    return records


@pytest.mark.parametrize("seed", range(8))
def test_repeats_play_what_they_say(seven, seed):
    rng = random.Random(seed)
    records = random_program(rng, seven)
    start = seven.play(*records)
    seven.until_ended()
    order = unrolled(records)
    assert [one["record"] for one in seven.told if one["event"] == STEP_BEGUN] == order
    due, ms = [], 0
    for record in order:
        due.append(start + ms // 5)
        ms += records[record][2]
    assert seven.begun() == due


def test_a_repeat_without_end_ends_when_it_is_stopped(seven):
    seven.play(seven.repeat(0), seven.all(6000, after=20), seven.all(7000, after=20), seven.end())
    seven.tick(800)
    assert len(seven.begun()) == 200
    assert seven.ask("SEQUENCE_CONTROL", 7, sequences.END).id == messages.SEQUENCE_CONTROL | messages.REPLY
    seven.tick()
    assert seven.events[-1][:2] == (SEQUENCE_ENDED, CANCELLED)
    assert seven.rig.app.safety.mode == modes.HOLDING


# Pause, and what ends a sequence.


def test_pause_stops_time_and_setpoints(seven):
    start = seven.play(seven.all(12000, ramp=500), seven.all(6000, after=100))
    seven.tick(39)
    seven.ask("SEQUENCE_CONTROL", 7, sequences.PAUSE)
    still = seven.setpoints()
    assert still == pytest.approx([5000 + 7000 * 0.4] * 7, abs=3)
    assert seven.state()["state"] == sequences.PAUSED
    for _ in range(100):
        seven.tick()
        assert seven.setpoints() == still
    seven.ask("SEQUENCE_CONTROL", 7, sequences.PAUSE)  # twice is once
    seven.ask("SEQUENCE_CONTROL", 7, sequences.RESUME)
    seven.tick()
    assert seven.setpoints() == pytest.approx([5000 + 7000 * 0.41] * 7, abs=3)
    seven.until_ended()
    paused, resumed = (one["ticks"] for one in seven.told if one["event"] in (SEQUENCE_PAUSED, SEQUENCE_RESUMED))
    assert seven.begun() == [start, start + 100 + resumed - paused]


@pytest.mark.parametrize("name", ["SHOW", "STOP", "VENT"])
@pytest.mark.parametrize("waiting", [False, True])
def test_show_stop_and_vent_end_it(seven, name, waiting):
    seven.load(seven.all(12000, ramp=500), seven.all(6000, ramp=500))
    seven.start(seven.rig.app.clock.ticks + 100 if waiting else 0)
    seven.tick(50)
    seven.ask(name, *((0,) if name == "SHOW" else ()), repeated=[(8000,)] * 7 if name == "SHOW" else ())
    seven.tick(200)
    assert seven.events[-1][:2] == (SEQUENCE_ENDED, CANCELLED)
    assert len(seven.begun()) == (0 if waiting else 1)
    if name == "SHOW":
        assert seven.setpoints() == [8000] * 7


def test_an_emergency_stop_ends_it_and_forbids_another(seven):
    seven.load(seven.all(12000, ramp=500))
    seven.start()
    seven.tick(10)
    seven.rig.hal.active_faults = faults.ESTOP
    seven.tick(3)
    assert seven.events[-1][:2] == (SEQUENCE_ENDED, CANCELLED)
    assert seven.rig.app.safety.mode == modes.STOPPED
    seven.ask("SEQUENCE_ARM", 7)
    assert seven.refusal("SEQUENCE_START", 7, 0)[0] == errors.BOARD_FAULT


def test_an_emergency_stop_before_the_start_forbids_it(seven):
    seven.load(seven.all(12000, ramp=500))
    seven.start(seven.rig.app.clock.ticks + 50)
    seven.rig.hal.active_faults = faults.ESTOP
    seven.tick(100)
    assert seven.events == [(SEQUENCE_ENDED, CANCELLED, 0, seven.events[0][3])]
    assert seven.rig.app.safety.mode == modes.STOPPED


def test_it_can_be_armed_and_played_again(seven):
    records = [seven.all(12000, ramp=50), seven.all(6000, ramp=50)]
    seven.play(*records)
    seven.until_ended()
    seven.told.clear()
    seven.ask("SEQUENCE_ARM", 7)
    start = seven.start()
    seven.until_ended()
    assert seven.begun() == [start, start + 10]


def test_another_takes_over_where_the_bubbles_are(seven):
    seven.play(seven.all(12000, ramp=500))
    for tick in range(12):  # a line that is being filled
        for bubble in range(7):
            seven.rig.sense(bubble, 400 * tick)
        seven.tick()
    seven.load(seven.all(6000, after=100))
    assert seven.events[-1][:2] == (SEQUENCE_ENDED, CANCELLED)
    assert seven.rig.app.safety.mode == modes.ACTIVE
    (held,) = set(seven.ask("STATE").columns["target_um"])
    assert 5000 < held < 12000, "neither where they came from nor where they went"
    seven.told.clear()
    seven.start()
    seven.until_ended()
    assert seven.events[-1][1] == COMPLETE


def test_the_schemas_names_are_the_steps_own():
    assert codec.BY_NAME["SEQUENCE_WRITE"].fixed_size == 4
    assert (steps.HEAD, steps.LEAVE) == (4, 0xFFFF)


def test_where_the_heap_is_small_the_memory_is_what_there_is_room_for(micropython):
    said = micropython(
        """
        import gc
        room = bytearray(60000)
        from bubble_firmware import boards
        from bubble_firmware.sequence.memory import SequenceMemory
        board = boards.load("wristband7")
        gc.collect()
        taken = []
        try:
            while True:
                taken.append(bytearray(1000))
        except MemoryError:
            pass
        del room
        memory = SequenceMemory(board)
        gc.collect()
        print(memory.capacity, gc.mem_free())
        """
    )
    capacity, free = map(int, said.split())
    board = boards.load("wristband7")
    assert 0 < capacity < board.SEQUENCE_BYTES // (2 * (steps.HEAD + board.BUBBLES))
    assert free > 20000, "what is made after it has no room"
