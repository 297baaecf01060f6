"""Requests and replies on a line that loses, damages and repeats; and the same run twice gives the same bytes."""

import gc
import random
import weakref
from itertools import islice

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol.schema import messages
from bubbleskin.link.link import Link, run_sync
from bubbleskin.link.message import encode

pytestmark = pytest.mark.timeout(60)


def damage(seed, share):
    """Changes `share` of all bytes to something else."""
    rng = random.Random(seed)

    def change(data):
        return bytes(byte ^ rng.randrange(1, 256) if rng.random() < share else byte for byte in data)

    return change


def lose(seed, share):
    """Loses `share` of all that is written or read at a time."""
    rng = random.Random(seed)
    return lambda data: b"" if rng.random() < share else data


def switched(change):
    """`change`, from the moment at which the list that is returned gets an entry."""
    on = []
    return on, lambda data: change(data) if on else data


@pytest.mark.medium
@pytest.mark.parametrize("direction", ["change", "change_sent"])
@pytest.mark.parametrize(("fault", "least"), [(damage(1, 0.003), 40), (damage(2, 0.03), 5), (lose(3, 0.4), 35)])
def test_a_bad_line_costs_time_and_no_truth(tapped, direction, fault, least):
    """Every call has its right answer by resending, or the device is called silent in time."""
    on, change = switched(fault)
    skin, tap = tapped(**{direction: change})
    skin.show(np.full(7, 10.0))
    on.append(True)
    answered = 0
    for _ in range(40):
        begin = tap.now()
        try:
            state = skin.state()
        except bs.DeviceSilent:
            assert tap.now() - begin == pytest.approx(2.0, abs=0.1)
            continue
        answered += 1
        assert begin - 1e-6 <= state.time <= tap.now() + 1e-6 <= begin + 2.1
        assert state.target_mm.tolist() == [10.0] * 7
        assert state.height_mm == pytest.approx(10, abs=0.2)
    assert answered >= least
    on.clear()
    assert skin.health().exceptions == 0
    skin.state()


def test_a_shape_is_taken_over_a_bad_line(tapped):
    rng = np.random.default_rng(4)
    skin, _ = tapped(change=damage(5, 0.002), change_sent=damage(6, 0.002))
    for _ in range(5):
        target = rng.uniform(9, 12.5, 7)
        skin.show(target)
        assert skin.simulated.height_mm == pytest.approx(target, abs=0.2)


def test_tables_arrive_over_a_bad_line(tapped):
    skin, _ = tapped(change=damage(7, 0.001), change_sent=damage(8, 0.001), timeout=5.0)
    table = bs.build_table(bs.YeohBalloon(mu=38e3))
    skin.upload_tables(table)
    assert all(read.to_bytes() == table.to_bytes() for read in skin.read_tables())


@pytest.mark.promise("silent-device")
def test_nothing_gets_through_and_the_call_ends_in_time(tapped):
    on, change = switched(lambda data: b"")
    skin, tap = tapped(change=change, timeout=1.0)
    on.append(True)
    before = len(tap.sent)
    begin = tap.now()
    with pytest.raises(bs.DeviceSilent, match="has not answered ESTIMATE within 1 s"):
        skin.state()
    assert tap.now() - begin == pytest.approx(1.0, abs=0.02)
    sent = tap.understood(tap.sent[before:])
    requests = [request for request in sent if request.id == messages.ESTIMATE]
    assert len({request.sequence for request in requests}) == 1, "a resent request keeps its number"
    assert 4 <= len(requests) <= 8, "30, 60, 120 ms … apart"
    assert {request.id for request in sent} == {messages.ESTIMATE, messages.HELLO}, "is it still the same device?"


def test_replies_that_come_twice_answer_once(tapped):
    skin, _ = tapped(change=lambda data: data + data)
    times = [skin.state().time for _ in range(50)]
    assert (np.diff(times) > 0).all()


def test_a_late_reply_answers_no_other_request(scripted):
    """Not the next one, and not the one that has the same number when the numbers come round again."""
    late = []

    def answer(request):
        if request.id != messages.TABLE_COMMIT:
            return b""
        before = b"".join(late)
        late[:] = [encode("TABLE_COMMIT_REPLY", request.sequence, (666,))]
        return before + encode("TABLE_COMMIT_REPLY", request.sequence, (request["crc"],))

    link = Link(scripted(answer), 1.0)
    for token in range(30):
        assert run_sync(link.call("TABLE_COMMIT", (token,)))["tables_crc"] == token
    link.window.next_number = 0x10000
    for token in range(100, 129):
        late.clear()
        assert run_sync(link.call("TABLE_COMMIT", (token,)))["tables_crc"] == token


def test_a_link_that_nobody_holds_is_gone_at_once(scripted):
    """Nothing in it refers back to it: its port is free again without waiting for the garbage collector."""
    link = Link(scripted(lambda request: b""), 1.0)
    run_sync(link.hello())
    gone = weakref.ref(link)
    gc.disable()
    try:
        del link
        assert gone() is None
    finally:
        gc.enable()


def test_the_answer_to_another_question_is_no_answer(scripted):
    def answer(request):
        return (
            b"" if request.id == messages.HELLO else encode("STATE_REPLY", request.sequence, (1, 1), [(1, 2, 3, 0, 0)])
        )

    with pytest.raises(bs.DeviceSilent):
        run_sync(Link(scripted(answer), 1.0).call("INFO"))


@pytest.mark.promise("no-frame")
def test_a_half_frame_on_the_line_does_not_spoil_the_greeting(tapped):
    skin, _ = tapped()
    skin.simulated.to_device += b"\x07half a frame"
    with pytest.raises(bs.DeviceRefused):  # the board is fine, only that frame was not
        run_sync(skin.link.call("SHOW", (0,), [(6000,)]))
    skin, tap = tapped(change=lambda data: data)
    assert tap.sent[0] == 0, "the first byte ends whatever stood on the line"


# Telemetry.


def test_telemetry_ends_with_its_iterator(tapped):
    skin, tap = tapped()
    for number, _ in enumerate(skin.telemetry(50)):
        if number == 5:
            break
    skin.sleep(0.1)
    before = len(tap.received)
    skin.sleep(1.0)
    assert tap.understood(tap.received[before:]) == []


def test_telemetry_in_pieces_is_whole(tapped):
    skin, _ = tapped()
    link = skin.link
    read = link.transport.transport.read
    rest = bytearray()

    def one_byte(timeout):
        if not rest:
            rest.extend(read(timeout))
        data = bytes(rest[:1])
        del rest[:1]
        return data

    link.transport.transport.read = one_byte
    times = [state.time for state in islice(skin.telemetry(100), 20)]
    assert np.diff(times) == pytest.approx(0.01)


def test_a_new_telemetry_ends_the_one_before(tapped):
    skin, _ = tapped()
    old = skin.telemetry(20)
    next(old)
    new = skin.telemetry(50)
    times = [next(new).time for _ in range(5)]
    assert list(old) == []
    times += [next(new).time for _ in range(5)]
    assert np.diff(times) == pytest.approx(0.02)


def test_telemetry_that_a_device_forgot_is_asked_for_again(tapped):
    """As after its reboot, or when another program has greeted it."""
    skin, tap = tapped(timeout=0.5)
    states = skin.telemetry(50)
    next(states)
    run_sync(skin.link.hello())
    begin = tap.now()
    times = [next(states).time for _ in range(5)]
    assert tap.now() - begin < 1.0
    assert np.diff(times) == pytest.approx(0.02)


def test_telemetry_of_a_closed_skin_can_be_closed(tapped):
    skin, _ = tapped()
    states = skin.telemetry(50)
    next(states)
    skin.close()
    states.close()


def test_frames_lost_on_the_way_are_only_missing(tapped):
    on, change = switched(lose(9, 0.3))
    skin, _ = tapped(change=change)
    states = skin.telemetry(50)
    next(states)
    on.append(True)
    steps = np.diff([next(states).time for _ in range(50)])
    assert (steps > 0).all()
    assert steps.max() > 0.03
    assert np.round(steps / 0.02) * 0.02 == pytest.approx(steps)


# Determinism.


def session(skin):
    """A bit of everything."""
    rng = np.random.default_rng(11)
    skin.show(rng.uniform(5.5, 12.5, len(skin.layout)), over=0.2, wait=False)
    list(islice(skin.telemetry(50), 20))
    skin.show(rng.uniform(5.5, 12.5, len(skin.layout)), wait=False)
    skin.sleep(0.333)
    skin.stop()
    skin.health()
    skin.read_tables()
    skin.vent()
    skin.sleep(0.5)
    return skin.simulated.height_mm


@pytest.mark.medium
@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
def test_the_same_run_twice_gives_the_same_bytes(tapped, board):
    runs = []
    for seed in (3, 3, 4):
        skin, tap = tapped(board, seed=seed, spread=0.1)
        heights = session(skin)
        runs.append((bytes(tap.sent), bytes(tap.received), heights.tolist(), tap.now()))
    assert runs[0] == runs[1]
    assert runs[0][1] != runs[2][1], "another seed is another sheet"
    assert len(runs[0][1]) > 1000
