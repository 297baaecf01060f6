"""Each request once and in order, whatever comes early, late, twice or never; STOP and VENT first."""

import random

import pytest

from bubble_firmware.link import receive_window
from bubble_protocol import codec
from bubble_protocol.schema import errors, messages, modes, system
from bubbleskin.link.message import encode, session_key
from bubbleskin.link.reader import Reader

SHOW_REPLY = messages.SHOW | messages.REPLY


@pytest.fixture
def device(rig7):
    """A rig whose `applied` are the heights of every SHOW that was applied, `send(…)` frames and `said()` the answers."""
    rig7.applied = []
    show = rig7.app.commands.show

    def tapped(values, first, over_ms):
        rig7.applied.append(values[first])
        show(values, first, over_ms)

    rig7.app.commands.show = tapped

    def send(*frames):
        rig7.hal.to_device += b"".join(frames)

    def said():
        return [
            (message.sequence, message["error"] if message.id == messages.ERROR else message.id)
            for message in rig7.heard()
        ]

    rig7.send, rig7.said = send, said
    return rig7


def show(device, number):
    return device.encode("SHOW", number, (0,), [(6000 + number % 1000,)] * 7)


def applied(*numbers):
    return [6000 + number % 1000 for number in numbers]


@pytest.mark.promise("exactly-once")
def test_a_request_that_comes_twice_is_applied_once_and_answered_twice(device):
    device.send(show(device, 1))
    device.tick()
    first = bytes(device.hal.from_device)
    device.heard()
    device.send(show(device, 1), show(device, 1))
    device.tick()
    assert bytes(device.hal.from_device) == first * 2, "to the byte"
    assert device.applied == applied(1)


@pytest.mark.promise("exactly-once")
@pytest.mark.parametrize("seed", range(5))
def test_whatever_order_they_come_in_they_are_applied_in_theirs(device, seed):
    order = list(range(1, 1 + receive_window.WINDOW))
    random.Random(seed).shuffle(order)
    for number in order:
        device.send(show(device, number))
        device.tick()
    device.tick(4)
    assert device.applied == applied(*range(1, 1 + receive_window.WINDOW))
    assert [number for number, _ in device.said()] == list(range(1, 1 + receive_window.WINDOW))


def test_only_some_are_handled_in_one_tick(device):
    device.send(*(show(device, number) for number in range(1, 9)))
    for ticks in range(1, 5):
        device.tick()
        assert device.applied == applied(*range(1, 1 + 2 * ticks))
    reads = [device.encode("TABLE_READ", number, (0, 0)) for number in range(9, 12)]
    device.said()
    device.send(*reads)
    for number in range(9, 12):  # one that takes long is all that a tick does
        device.tick()
        assert [answered for answered, _ in device.said()] == [number]


def test_the_numbers_come_round(device):
    device.app.server.window.expected = 0xFFFD
    for number in (0xFFFE, 0xFFFD, 0, 0xFFFF, 2, 1, 0xFFFD, 0):
        device.send(show(device, number))
        device.tick()
    assert device.applied == applied(0xFFFD, 0xFFFE, 0xFFFF, 0, 1, 2)
    assert [number for number, _ in device.said()] == [0xFFFD, 0xFFFE, 0xFFFF, 0, 1, 2, 0xFFFD, 0]


@pytest.mark.parametrize("number", [1 + receive_window.WINDOW, 100, 0x8000, 0xFFFF - system.REPLIES_KEPT])
def test_what_is_far_from_its_turn_is_dropped(device, number):
    device.send(show(device, number))
    device.tick(3)
    assert (device.applied, device.said()) == ([], [])


@pytest.mark.promise("overtaking")
@pytest.mark.parametrize("urgent", ["STOP", "VENT"])
@pytest.mark.parametrize("ahead", [0, 1, 5, system.REPLIES_KEPT - 1])
def test_stop_and_vent_overtake(device, urgent, ahead):
    device.send(show(device, 1))
    device.tick()
    number = 2 + ahead
    if ahead > 1:
        device.send(show(device, 3))  # it waits for 2
    device.send(device.encode(urgent, number))
    device.tick()
    assert device.app.safety.mode == {"STOP": modes.HOLDING, "VENT": modes.VENTING}[urgent]
    reply = codec.BY_NAME[urgent].id | messages.REPLY
    assert device.said() == [(1, SHOW_REPLY), (number, reply)]
    skipped = range(2, number)
    device.send(*(show(device, late) for late in skipped), device.encode(urgent, number))
    device.tick(2)
    assert device.said() == [*((late, errors.OVERTAKEN) for late in skipped), (number, reply)]
    assert device.applied == applied(1)
    device.send(show(device, number + 1))
    device.tick()
    assert device.applied == applied(1, number + 1)


def test_what_was_sent_after_a_vent_and_comes_before_it_is_applied_after_it(device):
    device.send(show(device, 3), device.encode("VENT", 2), show(device, 1))
    device.tick(2)
    assert device.applied == applied(3)
    assert device.app.safety.mode == modes.ACTIVE
    assert dict(device.said())[1] == errors.OVERTAKEN


@pytest.mark.promise("sessions")
def test_frames_without_the_key_of_boot_and_session_are_none(device):
    bad = device.app.server.decoder.bad
    for key in (
        b"\0" * 4,
        session_key(device.hal.boot_id, 5),
        session_key(device.hal.boot_id ^ 1, device.session),
    ):
        device.send(encode("VENT", 1, key=key))
    device.tick()
    assert device.said() == []
    assert device.app.server.decoder.bad == bad + 3


def test_a_new_session_begins_anew_and_a_late_greeting_does_not_end_it(device):
    device.send(show(device, 1))
    device.tick()
    old = show(device, 2)
    assert device.open(7)["window"] == receive_window.WINDOW
    device.send(old, show(device, 1))
    device.tick()
    assert device.applied == applied(1, 1), "number 1 of another session is another request"
    hello = encode("HELLO", 70, (2, 2, 0x89ABCDEF))
    device.heard()
    device.send(hello, show(device, 2))
    device.tick()
    assert device.said() == [(70, errors.OVERTAKEN), (2, SHOW_REPLY)]
    for session in range(100, 114):
        device.open(session)
    device.heard()
    device.send(hello)
    device.tick()
    assert device.said() == [(70, errors.OVERTAKEN)], "the last sixteen are remembered"


def test_a_greeting_of_the_open_session_changes_nothing(device):
    device.ask("SUBSCRIBE", (2,))
    device.send(show(device, 2))
    device.tick()
    device.said()
    device.send(encode("HELLO", 71, (2, 2, device.session)), show(device, 2), show(device, 3))
    device.tick(6)
    said = device.said()
    assert [answer for answer in said if answer[1] != messages.TELEMETRY] == [
        (71, messages.HELLO | messages.REPLY),
        (2, SHOW_REPLY),
        (3, SHOW_REPLY),
    ]
    assert messages.TELEMETRY in dict(said).values()
    assert device.applied == applied(2, 3)


def test_a_session_without_a_number_is_refused(device):
    device.send(encode("HELLO", 72, (2, 2, 0)))
    device.tick()
    assert device.said() == [(72, errors.OUT_OF_RANGE)]


def test_a_host_of_protocol_1_is_refused_in_words_it_knows(device):
    """Its HELLO has no session."""
    from bubble_protocol.crc import crc32_into
    from bubble_protocol.frame import FRAME_MAX, HEADER, finish_frame, put_header

    frame = bytearray(FRAME_MAX)
    put_header(frame, messages.HELLO, 1)
    frame[4:6] = bytes((1, 1))
    device.send(bytes(frame[: finish_frame(frame, HEADER + 2, crc32_into)]))
    device.tick()
    (answer,) = Reader().feed(bytes(device.hal.from_device))
    assert (answer["error"], answer["low"], answer["high"]) == (errors.NO_COMMON_PROTOCOL, 2, 2)


def test_a_reply_that_found_no_room_goes_out_later_in_order_and_before_telemetry(device):
    device.ask("SUBSCRIBE", (5,))
    device.hal.full = True
    for number in (2, 3, 4):
        device.send(show(device, number))
        device.tick()
    device.send(device.encode("VENT", 7))
    device.tick()
    dropped = device.app.server.telemetry.dropped
    device.tick(5)
    assert device.app.server.telemetry.dropped == dropped + 1
    device.hal.full = False
    device.heard()
    device.tick(5)
    said = device.said()
    assert [number for number, _ in said[:4]] == [2, 3, 4, 7]
    assert [kind for _, kind in said[4:]] == [messages.TELEMETRY]
    assert device.applied == applied(2, 3, 4)


def test_every_frame_of_the_session_is_understood(device):
    decoder = device.app.server.decoder
    before = decoder.good
    device.send(device.encode("PING", 9, (1,)), show(device, 1), show(device, 1), show(device, 500))
    device.send(encode("PING", 9, (1,)))
    device.tick()
    assert decoder.good == before + 4
