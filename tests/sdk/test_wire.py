"""Messages as Python values: what is decoded, and the sentence for every refusal."""

import random
import zlib
from array import array

import numpy as np
import pytest

from bubble_protocol import codec
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, Decoder, finish_frame, put_header
from bubble_protocol.schema import errors, faults, messages, modes, self_test, sequences, store
from bubbleskin.device.health import Health
from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.link.message import SCHEMA_CRC, encode
from bubbleskin.link.reader import Reader
from bubbleskin.link.refusals import describe_refusal


def receive(*frames):
    return list(Reader().feed(b"".join(frames)))


def error(code, request=messages.SHOW, field=0, element=255, asked=0, low=0, high=0):
    (received,) = receive(encode("ERROR", 1, (request, code, field, element, asked, low, high)))
    return received


def crc(data):
    return zlib.crc32(data).to_bytes(4, "little")


def text16(text):
    return list(text.encode().ljust(16, b"\0"))


HELLO = (
    2,
    2,
    SCHEMA_CRC,
    0xFFFFFFFE,
    0,
    1,
    7,
    *text16("wristband7"),
    7,
    5000,
    5000,
    14000,
    42000,
    1,
    0,
    0x80000001,
)


def test_a_message_has_fields_by_name_and_columns_by_name():
    rows = [(5000 + bubble, -10 * bubble, 6000, bubble % 5, bubble) for bubble in range(7)]
    (state,) = receive(encode("STATE_REPLY", 77, (0xFFFFFFFF, 1), rows))
    assert state.id == messages.STATE | messages.REPLY
    assert state.sequence == 77
    assert state.fields == {"ticks": 0xFFFFFFFF, "mode": 1}
    assert state["ticks"] == 0xFFFFFFFF
    assert list(state.columns) == ["height_um", "pressure_pa", "target_um", "status", "faults"]
    assert np.array_equal(np.column_stack(list(state.columns.values())), rows)


def test_text_arrives_as_text():
    (hello,) = receive(encode("HELLO_REPLY", 1, HELLO))
    assert hello.fields["board"] == "wristband7"
    assert hello["boot_id"] == 0xFFFFFFFE
    assert hello["tables_crc"] == 0x80000001


def test_info_health_and_state_are_in_the_units_of_their_names():
    (hello,) = receive(encode("HELLO_REPLY", 1, HELLO))
    info = Info.of(hello)
    assert (info.board, info.bubbles, info.firmware, info.protocol) == ("wristband7", 7, "0.1.7", (2, 2))
    assert info.same_schema
    assert (info.tick, info.height_rest_mm, info.height_max_mm, info.pressure_max_kpa) == (0.005, 5.0, 14.0, 42.0)
    counters = (400, 3, 1000, 1, 17, 2, 5, 123456, 59990, 0xDEADBEEF, modes.HOLDING)
    board = (faults.WATCHDOG, self_test.FAILED, 0b101, 0b10, 0, store.SLOT_B)
    (reply,) = receive(encode("INFO_REPLY", 1, (*counters, *board)))
    assert Health.of(reply, info.tick) == Health(
        time=2.0,
        late_ticks=3,
        tick_worst=0.001,
        exceptions=1,
        frames_good=17,
        frames_bad=2,
        telemetry_dropped=5,
        heap_free=123456,
        supply_kpa=59.99,
        tables_crc=0xDEADBEEF,
        mode="holding",
        board_faults=("watchdog",),
        self_test="failed",
        untrue_zero=(0, 2),
        unfilled=(1,),
        unvented=(),
        store="slot_b",
    )
    (reply,) = receive(encode("STATE_REPLY", 1, (400, 1), [(12345, -34, 12000, 2, 0), (5000, 0, 0, 4, 5)]))
    state = State.of(reply, info.tick)
    assert (state.time, state.mode, state.status) == (2.0, "active", ("settled", "fault"))
    assert state.height_mm.tolist() == [12.345, 5.0]
    assert state.pressure_kpa.tolist() == [-0.034, 0.0]
    assert state.target_mm.tolist() == [12.0, 0.0]
    assert state.faults == ((), ("overpressure", "valve_time"))
    assert state.unsettled == [1]
    assert not state.settled


def test_a_bubble_that_still_empties_or_has_not_begun_to_rise_is_not_settled():
    rows = [(5000, 80, 0, 0, 0), (9000, 21000, 0, 0, 0), (5000, 0, 10000, 0, 0), (5000, 0, 5050, 0, 0)]
    (reply,) = receive(encode("STATE_REPLY", 1, (400, 1), rows))
    assert State.of(reply, 0.005).unsettled == [1, 2]


def test_a_newer_firmwares_mode_and_status_are_unknown_and_no_failure():
    (reply,) = receive(encode("STATE_REPLY", 1, (400, 99), [(5000, 0, 0, 99, 0)]))
    state = State.of(reply, 0.005)
    assert (state.mode, state.status, state.faults) == ("unknown", ("unknown",), ((),))
    assert not state.settled
    (reply,) = receive(encode("INFO_REPLY", 1, (*[0] * 10, 99, 0, 99, 0, 0, 0, 0)))
    assert (Health.of(reply, 0.005).mode, Health.of(reply, 0.005).self_test) == ("unknown", "unknown")


@pytest.mark.parametrize(
    ("received", "sentence"),
    [
        (
            error(errors.UNKNOWN_MESSAGE, request=0x55),
            "The wristband does not know message 0x55: its firmware is older than this SDK. Update the firmware.",
        ),
        (
            error(errors.WRONG_LENGTH, asked=3, low=2, high=247),
            "The wristband refused SHOW: a payload of 3 bytes; 2 to 247 are allowed. Update SDK or firmware.",
        ),
        (
            error(errors.OUT_OF_RANGE, asked=60001, high=60000),
            "The wristband refused SHOW: over_ms is 60001 ms; 0 to 60000 ms is allowed.",
        ),
        (
            error(errors.OUT_OF_RANGE, field=1, element=3, asked=14001, high=14000),
            "The wristband refused SHOW: height_um (entry 3) is 14001 µm; 0 to 14000 µm is allowed.",
        ),
        (
            error(errors.OUT_OF_RANGE, request=messages.TABLE_READ, asked=7, high=6),
            "The wristband refused TABLE_READ: bubble is 7; 0 to 6 is allowed.",
        ),
        (
            error(errors.WRONG_COUNT, field=1, asked=6, low=7, high=7),
            "The wristband refused SHOW: 6 entries for its 7 bubbles; send one per bubble.",
        ),
        (
            error(errors.BAD_TABLE, request=messages.TABLE_COMMIT, element=4, asked=63, low=40387, high=42000),
            "The wristband refused the table of bubble 4 at knot 63: heights must rise to the board's greatest height, "
            "where pressure may be 40387 Pa (more, and it would take more air than a bubble of this board may have), "
            "and pressures stay within 42000 Pa.",
        ),
        (
            error(errors.BAD_CRC, request=messages.TABLE_COMMIT),
            "The wristband refused TABLE_COMMIT: what it received is not what was sent. Upload the tables again.",
        ),
        (
            error(errors.NO_COMMON_PROTOCOL, request=messages.HELLO),
            "The wristband refused HELLO with error 7.",  # the link has a better sentence for this one
        ),
        (
            error(errors.FAULTED),
            "The wristband failed at SHOW and vents. `bubbleskin info` counts its exceptions.",
        ),
        (
            error(errors.BOARD_FAULT, asked=faults.ESTOP),
            "The wristband refused SHOW: the emergency stop is pressed, or its loop is broken: everything vents. "
            "Mend the cause, then `clear_faults()`.",
        ),
        (
            error(errors.NO_SETTING, asked=9, low=0, high=2),
            "The wristband refused SHOW: it has no setting 9; they are numbered 0 to 2. Update its firmware.",
        ),
        (
            error(errors.OVERTAKEN),
            "The wristband refused SHOW: a later STOP or VENT has overtaken it. It was not applied.",
        ),
        (
            error(errors.WRONG_BOARD, request=messages.SEQUENCE_BEGIN),
            "The wristband refused SEQUENCE_BEGIN: the sequence is for other hardware. Make one for this board.",
        ),
        (
            error(errors.BAD_STEP, request=messages.SEQUENCE_WRITE, field=6, element=1, asked=15000, high=14000),
            "The wristband refused SEQUENCE_WRITE: the target (µm) of bubble 2 of record 1 in this message is 15000; "
            "0 to 14000 is allowed.",
        ),
        (
            error(errors.BAD_STEP, request=messages.SEQUENCE_WRITE, field=1, element=0, asked=60001, high=60000),
            "The wristband refused SEQUENCE_WRITE: the ramp (ms) of record 0 in this message is 60001; 0 to 60000 is allowed.",
        ),
        (
            error(errors.BAD_LOOP, request=messages.SEQUENCE_WRITE, field=255, element=2, asked=5, high=4),
            "The wristband refused SEQUENCE_WRITE: repeats and their ends do not fit at record 2: depth 5, 0 to 4 is "
            "allowed, and none is empty.",
        ),
        (
            error(errors.OUT_OF_ORDER, request=messages.SEQUENCE_WRITE, asked=9, low=5, high=5),
            "The wristband refused SEQUENCE_WRITE: record 9 came where 5 was expected. Upload again.",
        ),
        (
            error(errors.NO_ROOM, request=messages.SEQUENCE_WRITE, asked=9, high=5),
            "The wristband refused SEQUENCE_WRITE: 9 records, with room for 5. Send what there is room for.",
        ),
        (
            error(errors.NOT_READY, request=messages.SEQUENCE_ARM, asked=sequences.LOADING, low=3, high=5),
            "The wristband refused SEQUENCE_ARM: its sequence is loading, with 3 of 5 records, or is another one. "
            "Upload the sequence and arm it first.",
        ),
        (
            error(errors.TOO_LATE, request=messages.SEQUENCE_START, asked=7, low=100),
            "The wristband refused SEQUENCE_START: tick 7, at which to start, has passed; the next is 100. Start later, "
            "or at once.",
        ),
        (error(200), "The wristband refused SHOW with error 200."),
    ],
)
def test_every_refusal_has_its_sentence(received, sentence):
    assert describe_refusal(received) == sentence


def test_every_error_of_the_schema_is_explained():
    explained = {errors.UNKNOWN_MESSAGE, errors.WRONG_LENGTH, errors.OUT_OF_RANGE, errors.WRONG_COUNT}
    explained |= {errors.BAD_TABLE, errors.BAD_CRC, errors.NO_COMMON_PROTOCOL, errors.FAULTED}
    explained |= {errors.BOARD_FAULT, errors.OVERTAKEN, errors.WRONG_BOARD, errors.BAD_STEP, errors.BAD_LOOP}
    explained |= {errors.OUT_OF_ORDER, errors.NO_ROOM, errors.NOT_READY, errors.TOO_LATE}
    explained |= {errors.NOT_VENTED, errors.STORE_FOREIGN, errors.STORE_FAILED}
    explained |= {errors.NO_SETTING, errors.NOT_PERMITTED}
    assert explained == {code for code, _, _ in errors.ERRORS}


@pytest.mark.medium
def test_no_refusal_however_odd_is_without_a_sentence():
    rng = random.Random(1)
    for _ in range(3000):
        odd = [rng.choice((0, 1, 2, 4, 8, 0x7F, 255, rng.randrange(256))) for _ in range(4)]
        sentence = describe_refusal(
            error(odd[1], odd[0], odd[2], odd[3], *(rng.randrange(-(2**31), 2**31) for _ in "123"))
        )
        assert sentence.startswith("The wristband")
        assert sentence.endswith(".")


def test_what_is_no_message_is_counted_and_dropped():
    frame = encode("PING", 5, (9,))
    reader = Reader()
    bad_crc = bytes([frame[0], frame[1] ^ 1, *frame[2:]])
    assert list(reader.feed(bad_crc)) == []
    assert reader.bad == 1
    assert list(reader.feed(b"hello, I am no wristband\r\n\0")) == []
    assert reader.bad == 2
    unknown = bytearray(64)
    put_header(unknown, 0x70, 1)
    end = finish_frame(
        unknown, 3, lambda data, start, stop, out, at: out.__setitem__(slice(at, at + 4), crc(data[start:stop]))
    )
    assert list(reader.feed(unknown[:end])) == []
    assert reader.bad == 3
    assert [message["token"] for message in reader.feed(frame)] == [9]
    assert reader.bad == 3


def test_a_message_in_pieces_is_one_message():
    frame = encode("STATE_REPLY", 3, (1, 1), [(1, 2, 3, 4, 5)] * 19)
    reader = Reader()
    received = [message for byte in frame for message in reader.feed(bytes([byte]))]
    assert [message.sequence for message in received] == [3]


def test_the_host_can_write_and_read_every_message():
    rng = random.Random(2)
    for message in codec.BY_ID.values():
        fixed = [rng.randrange(1, 100) for _ in range(message.fixed_values)]
        rows = [[rng.randrange(100) for _ in range(message.stride_values)] for _ in range(3 * bool(message.repeated))]
        (received,) = receive(encode(message.name, 65535, fixed, rows))
        assert received.id == message.id
        assert received.sequence == 65535
        assert list(received.fields) == [field[0] for field in message.fixed]
        assert all(column.tolist() == [row[at] for row in rows] for at, column in enumerate(received.columns.values()))


def test_fields_that_newer_firmware_appends_are_passed_over():
    message = codec.BY_NAME["PING_REPLY"]
    frame = bytearray(FRAME_MAX)
    end = message.pack(array("i", [7, 8, 9]), 0, frame, Decoder.PAYLOAD_AT)
    frame[end : end + 5] = b"newer"
    put_header(frame, message.id, 1)
    sealed = bytes(frame[: finish_frame(frame, end + 5 - 1, crc32_into)])
    (received,) = Reader().feed(sealed)
    assert received.fields == {"token": 7, "ticks": 8, "phase_us": 9}
