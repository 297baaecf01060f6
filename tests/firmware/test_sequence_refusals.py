"""Sequences that the device does not take, and what it says."""

import zlib

import pytest

from bubble_protocol.schema import errors, messages, sequences

WHOLE = 255


def test_what_is_for_other_hardware_is_refused(sequencer):
    name = zlib.crc32(sequencer.rig.board.NAME.encode())
    assert sequencer.begin(3, board=name).id != messages.ERROR
    assert sequencer.begin(3, board=name ^ 1)["error"] == errors.WRONG_BOARD
    n = sequencer.n
    assert sequencer.begin(3, board=name, bubbles=n + 1)["error"] == errors.WRONG_COUNT
    assert sequencer.state()["state"] == sequences.LOADING, "refused, so nothing has changed"


BAD = [
    ({"ramp": 60001}, errors.BAD_STEP, 1, 60001, 0, 60000),
    ({"after": 60001}, errors.BAD_STEP, 2, 60001, 0, 60000),
    ({"after": 4}, errors.BAD_STEP, 2, 4, 5, 60000),
    ({"tolerance": 49, "timeout": 100}, errors.BAD_STEP, 3, 49, 50, 5000),
    ({"tolerance": 5001, "timeout": 100}, errors.BAD_STEP, 3, 5001, 50, 5000),
    ({"tolerance": 100, "timeout": 0}, errors.BAD_STEP, 2, 0, 5, 60000),
]


@pytest.mark.parametrize(("how", "error", "word", "asked", "low", "high"), BAD)
def test_a_bad_step_is_refused_and_named(seven, how, error, word, asked, low, high):
    good = seven.all(8000, after=50)
    seven.begin(4)
    bad = seven.all(8000, **how)
    answer = seven.refusal("SEQUENCE_WRITE", 7, 0, repeated=[(w,) for r in (good, good, bad, good) for w in r])
    assert answer == (error, word, 2, asked, low, high)
    assert seven.state()["received"] == 0, "none of them was taken"


def test_a_target_above_the_limit_is_refused(sequencer):
    high = sequencer.rig.board.HEIGHT_MAX_UM
    for um in (high + 1, 0xFFFE):
        bad = sequencer.all(8000, after=50)
        bad[4 + 3] = um
        sequencer.begin(1)
        refused = sequencer.refusal("SEQUENCE_WRITE", 7, 0, repeated=[(w,) for w in bad])
        assert refused == (errors.BAD_STEP, 4 + 3, 0, um, 0, high)


def test_flags_that_mean_nothing_are_refused(seven):
    for flags in (3, 0x80, 0x8000, 4 | 1, 0x20):
        seven.begin(1)
        bad = [flags, 100, 100, 0, *[8000] * 7]
        assert seven.refusal("SEQUENCE_WRITE", 7, 0, repeated=[(w,) for w in bad])[0] in (
            errors.BAD_STEP,
            errors.BAD_LOOP,
        )


def test_repeats_that_do_not_fit_are_refused(seven):
    one = seven.all(8000, after=50)
    repeat, end = seven.repeat(2), seven.end()
    for records, where in (([end], 0), ([repeat, end], 1), ([repeat, one, end, end], 3), ([repeat] * 5, 4)):
        seven.begin(len(records))
        refused = seven.refusal("SEQUENCE_WRITE", 7, 0, repeated=[(w,) for r in records for w in r])
        assert refused[:3] == (errors.BAD_LOOP, WHOLE, where)
    seven.upload([repeat, one])
    assert seven.refusal("SEQUENCE_ARM", 7)[0] == errors.NOT_READY, "one that is not ended"


def test_what_is_not_whole_or_not_that_is_not_armed(seven):
    one = seven.all(8000, after=50)
    assert seven.refusal("SEQUENCE_ARM", 7) == (errors.NOT_READY, 0, WHOLE, sequences.EMPTY, 0, 0)
    assert seven.refusal("SEQUENCE_WRITE", 7, 0, repeated=[(w,) for w in one])[0] == errors.NOT_READY
    assert seven.refusal("SEQUENCE_START", 7, 0)[0] == errors.NOT_READY
    assert seven.refusal("SEQUENCE_CONTROL", 7, sequences.PAUSE)[0] == errors.NOT_READY
    seven.begin(3, crc=1)
    seven.write(0, [one, one])
    assert seven.refusal("SEQUENCE_ARM", 7) == (errors.NOT_READY, 0, WHOLE, sequences.LOADING, 2, 3)
    assert seven.refusal("SEQUENCE_ARM", 8)[0] == errors.NOT_READY, "another one"
    assert seven.refusal("SEQUENCE_WRITE", 7, 3, repeated=[(w,) for w in one]) == (
        errors.OUT_OF_ORDER,
        1,
        WHOLE,
        3,
        2,
        2,
    )
    seven.write(2, [one])
    assert seven.write(2, [one])["received"] == 3, "sent twice because the answer was lost"
    assert seven.refusal("SEQUENCE_WRITE", 7, 3, repeated=[(w,) for w in one])[:2] == (errors.NO_ROOM, 2)
    assert seven.refusal("SEQUENCE_ARM", 7)[0] == errors.BAD_CRC
    assert seven.refusal("SEQUENCE_START", 7, 0)[0] == errors.NOT_READY
    for count in (0, 1, 10, 12, 120):
        assert seven.refusal("SEQUENCE_WRITE", 7, 3, repeated=[(1,)] * count)[0] == errors.WRONG_LENGTH


def test_an_upload_cut_half_way_is_forgotten_by_the_next(seven):
    seven.begin(30)
    seven.write(0, [seven.repeat(2), seven.all(8000, after=50)])
    seven.id = 8
    start = seven.play(seven.all(6000, after=50), seven.all(7000, after=50))
    seven.until_ended()
    assert seven.begun() == [start, start + 10]
    assert {one["sequence"] for one in seven.told} == {8}
