"""Requests: what is refused and how it is named, tables, telemetry. A request refused changes nothing."""

import zlib

import numpy as np
import pytest

from bubble_firmware.control import nominal
from bubble_protocol import codec, version
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, HEADER, PAYLOAD_MAX, finish_frame, put_header
from bubble_protocol.schema import errors, messages, system, telemetry
from bubbleskin.link.message import encode

WHOLE = 255  # the element of a refusal that is about no bubble or knot
STEEPER = [(5000, 0), (8000, 20000), (14000, 40000)]


def raw(rig, message_id, payload):
    """Send any payload under any id; the answer's (error, field, element, asked, low, high)."""
    frame = bytearray(FRAME_MAX)
    sequence = rig.next_sequence(message_id)
    put_header(frame, message_id, sequence)
    frame[4 : 4 + len(payload)] = payload
    rig.hal.to_device += bytes(frame[: finish_frame(frame, HEADER + len(payload), crc32_into, rig.key)])
    rig.heard()
    rig.tick()
    (answer,) = rig.heard()
    assert (answer.id, answer.sequence, answer["request"]) == (messages.ERROR, sequence, message_id)
    return tuple(answer[field] for field in ("error", "field", "element", "asked", "low", "high"))


@pytest.fixture
def unchanged(rig):
    """What the firmware does is the same before the test and after it."""

    def all_of_it():
        state = rig.state()
        tables = [rig.ask("TABLE_READ", (bubble, 0)).columns["knot_pa"].sum() for bubble in range(rig.board.BUBBLES)]
        return (
            rig.app.safety.mode,
            state["target_um"].tolist(),
            tables,
            rig.ask("INFO")["tables_crc"],
            rig.app.stats.exceptions,
        )

    rig.show(*range(6000, 6000 + 100 * rig.board.BUBBLES, 100))
    before = all_of_it()
    yield
    assert all_of_it() == before


# Shapes.


@pytest.mark.promise("height-refused")
@pytest.mark.usefixtures("unchanged")
def test_a_height_above_the_boards_limit_is_refused(rig):
    high = rig.board.HEIGHT_MAX_UM
    heights = [(high,)] * rig.board.BUBBLES
    heights[3] = (high + 1,)
    assert rig.refused("SHOW", (0,), heights) == (errors.OUT_OF_RANGE, 1, 3, high + 1, 0, high)


def test_the_greatest_and_the_least_height_are_not(rig):
    rig.show(rig.board.HEIGHT_MAX_UM, over_ms=60000)
    assert set(rig.state()["target_um"]) == {rig.board.HEIGHT_MAX_UM}
    rig.show(0)
    assert set(rig.state()["target_um"]) == {0}


@pytest.mark.usefixtures("unchanged")
def test_a_time_above_the_schemas_limit_is_refused(rig):
    heights = [(9000,)] * rig.board.BUBBLES
    assert rig.refused("SHOW", (60001,), heights) == (errors.OUT_OF_RANGE, 0, WHOLE, 60001, 0, 60000)


@pytest.mark.usefixtures("unchanged")
def test_heights_for_another_number_of_bubbles_are_refused(rig):
    n = rig.board.BUBBLES
    for count in (0, 1, n - 1, n + 1, 122):
        assert rig.refused("SHOW", (0,), [(9000,)] * count) == (errors.WRONG_COUNT, 1, WHOLE, count, n, n)


# Anything.


@pytest.mark.promise("refused-not-applied")
@pytest.mark.usefixtures("unchanged")
def test_an_unknown_message_is_refused(rig):
    known = {message[0] for message in messages.MESSAGES if message[0] | messages.REPLY in codec.BY_ID}
    for message_id in set(range(256)) - {request for request in known if request < messages.REPLY}:
        assert raw(rig, message_id, b"12")[:4] == (errors.UNKNOWN_MESSAGE, 0, WHOLE, message_id)


@pytest.mark.promise("refused-not-applied")
@pytest.mark.usefixtures("unchanged")
def test_a_payload_of_the_wrong_length_is_refused(rig):
    for message in codec.BY_ID.values():
        if message.id | messages.REPLY in codec.BY_ID and message.id < messages.REPLY:
            low = message.size_min
            high = PAYLOAD_MAX
            wrong = {low - 1, low + 1} if message.stride else {0, low - 1}
            for size in wrong & set(range(low)) | wrong & {low + 1}:
                assert raw(rig, message.id, bytes(size)) == (errors.WRONG_LENGTH, 0, WHOLE, size, low, high)


def test_hello_introduces_the_board(rig):
    reply = rig.ask("HELLO", (version.PROTOCOL_MIN, version.PROTOCOL_MAX, 7))
    board = rig.board
    assert reply.fields == {
        "protocol_min": version.PROTOCOL_MIN,
        "protocol_max": version.PROTOCOL_MAX,
        "schema_crc": zlib.crc32(codec.schema_bytes()),
        "boot_id": rig.hal.boot_id,
        "firmware_major": version.FIRMWARE[0],
        "firmware_minor": version.FIRMWARE[1],
        "firmware_patch": version.FIRMWARE[2],
        "board": board.NAME,
        "bubbles": board.BUBBLES,
        "tick_us": board.TICK_US,
        "height_rest_um": board.HEIGHT_REST_UM,
        "height_max_um": board.HEIGHT_MAX_UM,
        "pressure_max_pa": board.PRESSURE_MAX_PA,
        "window": 8,
        "capabilities": sum(bit for bit, _, _ in system.CAPABILITIES),
        "tables_crc": zlib.crc32(np.array(nominal.KNOTS, "<u2").tobytes() * board.BUBBLES),
    }


def test_a_host_of_another_protocol_is_refused(rig7):
    low, high = version.PROTOCOL_MIN, version.PROTOCOL_MAX
    newer, older = (high + 1, high + 5, 7), (0, low - 1, 7)
    assert rig7.refused("HELLO", newer) == (errors.NO_COMMON_PROTOCOL, 1, WHOLE, high + 5, low, high)
    assert rig7.refused("HELLO", older) == (errors.NO_COMMON_PROTOCOL, 1, WHOLE, low - 1, low, high)
    assert rig7.ask("HELLO", (0, 255, 7)).id == messages.HELLO | messages.REPLY


def test_ping_gives_token_and_time_back(rig7):
    rig7.tick(1234)
    reply = rig7.ask("PING", (0xFFFFFFFF,))
    assert reply.fields == {"token": 0xFFFFFFFF, "ticks": 1234, "phase_us": 0}


def test_info_counts(rig7):
    rig7.hal.to_device += b"\x05abcd\0" + rig7.encode("PING", 1, (1,)) + encode("PING", 1, (1,))
    rig7.tick()
    info = rig7.ask("INFO")
    assert (info["frames_good"], info["frames_bad"], info["exceptions"]) == (3, 2, 0), "without the key it is no frame"
    assert info["supply_pa"] == rig7.board.SUPPLY_PA
    assert info["tables_crc"] == zlib.crc32(np.array(nominal.KNOTS, "<u2").tobytes() * 7)


def test_several_requests_in_one_tick_are_answered_in_order(rig7):
    rig7.hal.to_device += b"".join(rig7.encode("PING", sequence, (sequence,)) for sequence in range(5))
    rig7.tick()
    assert [reply["token"] for reply in rig7.heard()] == list(range(5))


# Telemetry.


def test_telemetry_comes_in_its_period_and_counts_what_was_due(rig7):
    rig7.ask("SUBSCRIBE", (4,))
    rig7.tick(23)
    samples = rig7.heard()
    assert {sample.id for sample in samples} == {messages.TELEMETRY}
    assert set(np.diff([sample["ticks"] for sample in samples])) == {4}
    assert [sample.sequence for sample in samples] == list(
        range(samples[0].sequence, samples[0].sequence + len(samples))
    )
    assert len(samples) in (5, 6)

    rig7.hal.full = True
    rig7.tick(12)
    rig7.hal.full = False
    assert rig7.heard() == []
    rig7.tick(4)
    (after,) = rig7.heard()
    assert after.sequence == samples[-1].sequence + 4, "a gap of three is a loss of three"
    rig7.ask("SUBSCRIBE", (0,))
    assert rig7.ask("INFO")["telemetry_dropped"] == 3
    rig7.tick(50)
    assert rig7.heard() == []


@pytest.mark.parametrize("fields", [1, 2, 0b101, 0b11001, 0b11100110, 0b111111])
def test_chosen_columns_say_the_same_as_the_state_of_that_tick(rig, fields):
    rig.show(*[9000 + 100 * bubble for bubble in range(rig.board.BUBBLES)], over_ms=1000)
    rig.sense(2, 12345)
    rig.hal.to_device += rig.encode("SUBSCRIBE_FIELDS", rig.next_sequence(messages.SUBSCRIBE_FIELDS), (1, fields))
    rig.tick(8)
    rig.hal.to_device += rig.encode("STATE", rig.next_sequence(messages.STATE))
    rig.heard()
    rig.tick()
    state, sample = rig.heard()
    assert (state.id, sample.id) == (messages.STATE | messages.REPLY, messages.TELEMETRY_FIELDS)
    assert (sample["ticks"], sample["mode"], sample["fields"]) == (state["ticks"], state["mode"], fields)
    assert (sample["dropped"], sample["board_faults"]) == (0, 0)
    assert sample["supply_pa"] == rig.app.supply.pressure_pa
    chosen = [column for column in telemetry.COLUMNS if column[0] & fields]
    rows = sample.columns["value"].reshape(rig.board.BUBBLES, len(chosen))
    told = {
        "height": "height_um",
        "pressure": "pressure_pa",
        "target": "target_um",
        "status": "status",
        "faults": "faults",
    }
    for column, (_, name, _, size, _) in zip(rows.T, chosen, strict=True):
        if name in told:
            assert column.tolist() == (state.columns[told[name]] // size).tolist()
        elif name == "setpoint":
            heights = state.columns["height_um"]
            assert (column >= rig.board.HEIGHT_REST_UM).all()
            assert (column <= heights.max() + 4000).all()
        else:
            assert column.tolist() == [rig.pulse(bubble)[name == "vent"] for bubble in range(rig.board.BUBBLES)]


def test_the_columns_of_telemetry_are_of_the_row_they_name(rig7):
    """Target, fill and vent from what the outputs were set to; a gap counted by the device too."""
    rig7.show(12000)
    rig7.ask("SUBSCRIBE_FIELDS", (2, 4))
    rig7.tick(4)
    assert {tuple(sample.columns["value"]) for sample in rig7.heard()} == {(12000,) * 7}
    rig7.hal.full = True
    rig7.tick(6)
    rig7.hal.full = False
    rig7.tick(2)
    (sample,) = rig7.heard()
    assert sample["dropped"] == 3
    rig7.ask("SUBSCRIBE_FIELDS", (0, 1))
    assert rig7.ask("INFO")["telemetry_dropped"] == 3
    rig7.ask("SUBSCRIBE", (2,))
    rig7.tick(4)
    assert {sample.id for sample in rig7.heard()} == {messages.TELEMETRY}
    rig7.ask("SUBSCRIBE_FIELDS", (0, 1))
    rig7.tick(10)
    assert rig7.heard() == []


@pytest.mark.usefixtures("unchanged")
def test_more_columns_than_a_frame_has_room_for_are_refused(rig):
    assert rig.refused("SUBSCRIBE_FIELDS", (4, 0))[:2] == (errors.OUT_OF_RANGE, 1)
    assert rig.refused("SUBSCRIBE_FIELDS", (4, 512))[:2] == (errors.OUT_OF_RANGE, 1)
    if rig.board.BUBBLES == 19:
        assert rig.refused("SUBSCRIBE_FIELDS", (4, 127))[:4] == (errors.OUT_OF_RANGE, 1, WHOLE, 127)
    else:
        assert rig.ask("SUBSCRIBE_FIELDS", (0, 511)).id == messages.SUBSCRIBE_FIELDS | messages.REPLY


def test_ticks_begin_again_before_they_would_allocate(rig7):
    rig7.app.clock.ticks = (1 << 30) - 3
    assert [rig7.ask("PING", (1,))["ticks"] for _ in range(4)] == [(1 << 30) - 2, (1 << 30) - 1, 0, 1]


def test_a_new_host_has_not_subscribed(rig7):
    rig7.ask("SUBSCRIBE", (60,))
    rig7.open(99)
    rig7.tick(200)
    assert rig7.heard() == []


@pytest.mark.usefixtures("unchanged")
def test_a_period_above_the_limit_is_refused(rig):
    assert rig.refused("SUBSCRIBE", (60001,)) == (errors.OUT_OF_RANGE, 0, WHOLE, 60001, 0, 60000)


# Tables.


def crc_of(*tables):
    return zlib.crc32(b"".join(np.array(table, "<u2").tobytes() for table in tables))


def read_table(rig, bubble):
    knots, total = [], 1
    while len(knots) < total:
        part = rig.ask("TABLE_READ", (bubble, len(knots)))
        assert (part["bubble"], part["first"]) == (bubble, len(knots))
        total = part["total"]
        knots += zip(part.columns["knot_um"].tolist(), part.columns["knot_pa"].tolist(), strict=True)
    return knots


def test_tables_are_written_committed_and_read_back(rig):
    tables = [
        [(5000, 0), *[(6000 + 100 * k + bubble, 300 * k) for k in range(62)], (15000, 42000)] for bubble in range(7)
    ]
    tables += [STEEPER] * (rig.board.BUBBLES - 7)
    for bubble, table in enumerate(tables):
        rig.write_table(bubble, table)
    assert read_table(rig, 0) == list(nominal.KNOTS), "nothing changes before the commit"
    crc = crc_of(*tables)
    assert rig.ask("TABLE_COMMIT", (crc,))["tables_crc"] == crc
    for bubble, table in enumerate(tables):
        assert read_table(rig, bubble) == table
    assert rig.ask("INFO")["tables_crc"] == crc

    # Writing one bubble's table keeps the others'.
    rig.write_table(2, STEEPER)
    crc = crc_of(*tables[:2], STEEPER, *tables[3:])
    assert rig.ask("TABLE_COMMIT", (crc,))["tables_crc"] == crc


def test_tables_are_those_that_the_sdk_makes(rig7):
    import bubbleskin

    table = bubbleskin.build_table(bubbleskin.YeohBalloon(mu=45e3))
    knots = list(zip(table.height_um.tolist(), table.pressure_pa.tolist(), strict=True))
    for bubble in range(7):
        rig7.write_table(bubble, knots, part=61)
    assert rig7.ask("TABLE_COMMIT", (zlib.crc32(table.to_bytes() * 7),)).id == messages.TABLE_COMMIT | messages.REPLY


@pytest.mark.usefixtures("unchanged")
def test_tables_with_another_crc_are_not_taken(rig):
    rig.write_table(1, STEEPER)
    crc = crc_of(nominal.KNOTS, STEEPER, *[nominal.KNOTS] * (rig.board.BUBBLES - 2))
    assert rig.refused("TABLE_COMMIT", (crc ^ 1,))[:3] == (errors.BAD_CRC, 0, WHOLE)


FLAWS = [
    pytest.param([(5000, 0), (9000, 20000), (9000, 21000), (14000, 30000)], 2, id="a height twice"),
    pytest.param([(5000, 0), (9000, 20000), (8999, 21000), (14000, 30000)], 2, id="a height that falls"),
    pytest.param([(5000, 0), (9000, 20000), (13999, 30000)], 2, id="not up to the greatest height"),
    pytest.param([(5000, 0), (9000, 20000), (16001, 30000)], 2, id="beyond what the arithmetic holds"),
    pytest.param([(5000, 0), (9000, 42001), (14000, 30000)], 1, id="a pressure above the limit"),
]


@pytest.mark.promise("uploads-raise-no-limit")
@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize(("table", "knot"), FLAWS)
def test_a_table_with_a_flaw_is_not_taken(rig, table, knot):
    bubble = rig.board.BUBBLES - 1
    rig.write_table(bubble, table)
    right = crc_of(*[nominal.KNOTS] * bubble, table)
    assert rig.refused("TABLE_COMMIT", (right,))[:3] == (errors.BAD_TABLE, 0, bubble)
    assert rig.refused("TABLE_COMMIT", (right,))[3] == knot


@pytest.mark.usefixtures("unchanged")
def test_what_is_no_part_of_a_table_is_refused(rig):
    n = rig.board.BUBBLES
    knots = [(5000, 0)] * 10
    out_of_range = errors.OUT_OF_RANGE
    assert rig.refused("TABLE_WRITE", (n, 0, 10), knots) == (out_of_range, 0, WHOLE, n, 0, n - 1)
    assert rig.refused("TABLE_WRITE", (0, 64, 64), knots) == (out_of_range, 1, WHOLE, 64, 0, 63)
    assert rig.refused("TABLE_WRITE", (0, 0, 65), knots) == (out_of_range, 2, WHOLE, 65, 2, 64)
    assert rig.refused("TABLE_WRITE", (0, 0, 1), knots[:1]) == (out_of_range, 2, WHOLE, 1, 2, 64)
    assert rig.refused("TABLE_WRITE", (0, 55, 64), knots) == (out_of_range, 1, WHOLE, 55, 0, 54)
    assert rig.refused("TABLE_WRITE", (0, 0, 5), knots) == (out_of_range, 1, WHOLE, 0, 0, 0)
    assert rig.refused("TABLE_WRITE", (0, 0, 10), [*knots[:9], (0, 1)]) == (out_of_range, 3, 9, 0, 1, 65535)
    assert rig.refused("TABLE_READ", (n, 0)) == (out_of_range, 0, WHOLE, n, 0, n - 1)
    assert rig.refused("TABLE_READ", (0, 64)) == (out_of_range, 1, WHOLE, 64, 0, 63)


def test_no_knot_is_read_beyond_the_end(rig7):
    for bubble in range(7):
        rig7.write_table(bubble, STEEPER)
    rig7.ask("TABLE_COMMIT", (crc_of(*[STEEPER] * 7),))
    assert rig7.refused("TABLE_READ", (0, 3)) == (errors.OUT_OF_RANGE, 1, WHOLE, 3, 0, 2)
