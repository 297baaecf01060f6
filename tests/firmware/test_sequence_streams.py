"""Sequences that are written while they are played, and the memory that they go through."""

import pytest

from bubble_protocol.schema import errors, messages, modes
from bubble_protocol.schema.sequences import (
    COMPLETE,
    SEQUENCE_ENDED,
    UNDERRUN,
)

WHOLE = 255


@pytest.mark.slow
def test_a_stream_plays_on_while_it_is_written(sequencer):
    ring = sequencer.rig.app.player.sequence.capacity
    most = 121 // sequencer.size
    tick = sequencer.rig.board.TICK_US // 1000
    total = 2 * ring + 17
    records = [sequencer.all(5000 + k % 9000, after=tick) for k in range(total)]
    sequencer.begin(total)
    written = 0
    while written < ring:
        part = records[written : min(written + most, ring)]
        assert sequencer.write(written, part)["received"] == written + len(part)
        written += len(part)
    assert (
        sequencer.refusal("SEQUENCE_WRITE", 7, ring & 0xFFFF, repeated=[(w,) for w in records[ring]])[0]
        == errors.NO_ROOM
    )
    sequencer.ask("SEQUENCE_ARM", 7)
    start = sequencer.start()
    while written < total:
        part = records[written : written + most]
        answer = sequencer.write(written, part)
        if answer.id == messages.ERROR:
            assert answer["error"] == errors.NO_ROOM
            sequencer.tick(3)
        else:
            written += len(part)
    sequencer.until_ended()
    assert sequencer.events[-1] == (SEQUENCE_ENDED, COMPLETE, total - 1, start + total)
    assert sequencer.begun() == list(range(start, start + total)), "no gap"


@pytest.mark.medium
def test_a_stream_that_runs_dry_is_held_and_says_so(seven):
    ring = seven.rig.app.player.sequence.capacity
    seven.begin(0)
    written = 0
    while written < ring:
        part = min(11, ring - written)
        seven.write(written, [seven.all(6000 + written, after=5)] * part)
        written += part
    seven.ask("SEQUENCE_ARM", 7)
    start = seven.start()
    seven.until_ended()
    assert seven.events[-1] == (SEQUENCE_ENDED, UNDERRUN, ring - 1, start + ring)
    assert seven.rig.app.safety.mode == modes.ACTIVE
    assert seven.setpoints() == [6000 + ring - ring % 11] * 7


def test_a_stream_has_no_repeats(seven):
    seven.begin(0)
    error = seven.refusal("SEQUENCE_WRITE", 7, 0, repeated=[(w,) for w in seven.repeat(2)])
    assert error == (errors.BAD_LOOP, WHOLE, 0, 1, 0, 0)


def test_more_than_the_memory_is_a_stream_and_room_is_told(sequencer):
    board = sequencer.rig.board
    ring = sequencer.begin(1)["capacity"]
    assert ring >= 1000
    assert ring * 2 * sequencer.size <= board.SEQUENCE_BYTES
    assert sequencer.begin(ring)["free"] == ring
    assert sequencer.begin(ring + 1)["free"] == ring
    assert sequencer.begin(0xFFFFFFFF)["free"] == ring
    assert sequencer.begin(3)["free"] == 3


def test_events_that_find_no_room_are_missed_by_their_number(seven):
    seven.load(*(seven.all(6000, after=5) for _ in range(60)))
    seven.start()
    seven.rig.hal.full = True
    for _ in range(40):
        seven.rig.app.tick()
    seven.rig.hal.full = False
    seven.until_ended()
    numbers = [one.sequence for one in seven.told]
    assert numbers[-1] == 60
    assert len(numbers) < 61
    assert seven.told[-1]["event"] == SEQUENCE_ENDED
    assert [one["record"] for one in seven.told[:-1]] == numbers[:-1], "none is told twice, none out of turn"
