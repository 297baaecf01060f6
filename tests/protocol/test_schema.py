"""The schema is data: what everyone who reads it relies on."""

import pytest

from bubble_firmware import boards
from bubble_protocol import codec, steps
from bubble_protocol.frame import PAYLOAD_MAX
from bubble_protocol.schema import (
    errors,
    faults,
    messages,
    modes,
    self_test,
    sequences,
    settings,
    statuses,
    store,
    system,
    telemetry,
)
from bubble_protocol.schema.messages import I16, I32, MESSAGES, REPLY, TEXT, U8, U16, U32
from bubbleskin.boards import NAMES
from bubbleskin.link.message import Message
from bubbleskin.link.refusals import describe_refusal

RANGES = {
    U8: (0, 0xFF),
    U16: (0, 0xFFFF),
    U32: (0, 0xFFFFFFFF),
    I16: (-(1 << 15), (1 << 15) - 1),
    I32: (-(1 << 31), (1 << 31) - 1),
}
UNASKED = {messages.TELEMETRY, messages.TELEMETRY_FIELDS, messages.ERROR, messages.SEQUENCE_EVENT}
NAMESPACES = (errors, faults, modes, self_test, sequences, settings, statuses, store, system)
BUBBLES = 24  # the largest board a frame has room for

FIELDS = [
    pytest.param(message, field, id=f"{message[1]}.{field[0]}")
    for message in MESSAGES
    for field in (*message[2], *message[3])
]


def requests():
    return [message for message in MESSAGES if message[0] < REPLY and message[0] not in UNASKED]


def test_ids_and_names_are_unique():
    assert len({message[0] for message in MESSAGES}) == len({message[1] for message in MESSAGES}) == len(MESSAGES)
    assert all(0 < message[0] <= 0xFF for message in MESSAGES)
    assert len(codec.BY_ID) == len(codec.BY_NAME) == len(MESSAGES)


def test_every_request_has_its_reply_and_every_reply_its_request():
    names = {message[0]: message[1] for message in MESSAGES}
    for message_id, name, *_ in requests():
        assert names[message_id | REPLY] == name + "_REPLY"
    assert {message[0] for message in MESSAGES if message[0] & REPLY} == {message[0] | REPLY for message in requests()}


def test_names_of_ids_are_the_names_of_the_messages():
    for message_id, name, *_ in MESSAGES:
        if not message_id & REPLY:
            assert getattr(messages, name) == message_id


@pytest.mark.parametrize(("message", "field"), FIELDS)
def test_a_field_is_sound(message, field):
    name, kind, unit, low, high, meaning = field
    assert name.isidentifier()
    assert name == name.lower()
    assert kind in messages.KIND_NAMES
    assert isinstance(meaning, str)
    for suffix, meant in (("_um", "µm"), ("_pa", "Pa"), ("_us", "µs"), ("_ms", "ms"), ("ticks", "ticks")):
        assert not name.endswith(suffix) or unit == meant
    if kind == TEXT:
        assert (low, high) == (None, None)
        assert field in message[2], "a text is not repeated"
        assert message[0] & REPLY, "the firmware's limits count one value per field: no text in a request"
    else:
        lowest, highest = RANGES[kind]
        assert lowest <= (lowest if low is None else low) <= (highest if high is None else high) <= highest
    if kind == U32:
        assert (low or 0, high) == (0, None), "the firmware compares limits as signed words"


def test_names_of_fields_are_unique_in_a_message():
    for _, _, fixed, group, meaning in MESSAGES:
        names = [field[0] for field in (*fixed, *group)]
        assert len(set(names)) == len(names)
        assert meaning


@pytest.mark.parametrize(
    ("name", "entries"),
    [
        ("SHOW", BUBBLES),
        ("STATE_REPLY", BUBBLES),
        ("TELEMETRY", BUBBLES),
        ("TABLE_WRITE", 48),
        ("TABLE_READ_REPLY", 48),
        ("TRIM_WRITE", BUBBLES),
        ("TRIM_READ_REPLY", BUBBLES),
        ("LAYOUT_REPLY", BUBBLES),
        ("SEQUENCE_WRITE", steps.HEAD + BUBBLES),
    ],
)
def test_a_frame_has_room_for_every_bubble(name, entries):
    message = codec.BY_NAME[name]
    assert message.fixed_size + entries * message.stride <= PAYLOAD_MAX
    assert max(boards.load(board).BUBBLES for board in NAMES) <= BUBBLES
    tables = codec.BY_NAME["TABLE_WRITE"]
    assert tables.fixed_size + messages.KNOTS_PER_MESSAGE * tables.stride <= PAYLOAD_MAX


def test_every_message_fits_a_frame():
    for message in codec.BY_ID.values():
        assert message.fixed_size + message.stride <= PAYLOAD_MAX


def test_telemetry_is_an_unasked_state():
    assert codec.BY_NAME["TELEMETRY"].fixed == codec.BY_NAME["STATE_REPLY"].fixed
    assert codec.BY_NAME["TELEMETRY"].repeated == codec.BY_NAME["STATE_REPLY"].repeated


ENUMERATIONS = {
    "modes": modes.MODES,
    "statuses": statuses.STATUSES,
    "stores": store.SOURCES,
    "slots": store.SLOTS,
    "sequence states": sequences.STATES,
    "sequence reasons": sequences.REASONS,
    "sequence events": sequences.EVENTS,
    "sequence actions": sequences.ACTIONS,
    "settings": settings.SETTINGS,
    "errors": errors.ERRORS,  # allotted in blocks
}


@pytest.mark.parametrize("table", ENUMERATIONS.values(), ids=list(ENUMERATIONS))
def test_an_enumeration_counts_on(table):
    first = table[0][0]
    assert first in (0, 1)
    numbers = [entry[0] for entry in table]
    assert numbers == (sorted(set(numbers)) if table is errors.ERRORS else list(range(first, first + len(table))))
    assert len({entry[1] for entry in table}) == len(table)
    for number, name, *_, meaning in table:
        constant = name.upper().removesuffix("_MS")
        constant = {"NONE": "NO_STORE", "EMERGENCY_STOP": "ESTOP"}.get(constant, constant)
        spaces = [vars(space) for space in NAMESPACES if table in vars(space).values()]
        assert number in [space.get(prefix + constant) for space in spaces for prefix in ("", "SLOT_", "CAN_")]
        assert meaning


def test_faults_are_bits_of_a_byte():
    assert [fault[0] for fault in faults.FAULTS] == [1 << bit for bit in range(len(faults.FAULTS))]
    assert faults.FAULTS[-1][0] <= 0x80
    for bit, name, _ in faults.FAULTS:
        assert getattr(faults, name.upper()) == bit


def test_telemetry_columns_are_bits_of_the_field_that_chooses_them():
    assert [column[0] for column in telemetry.COLUMNS] == [1 << bit for bit in range(len(telemetry.COLUMNS))]
    (fields,) = [field for field in codec.BY_NAME["SUBSCRIBE_FIELDS"].fixed if field[0] == "fields"]
    assert fields[4] == sum(column[0] for column in telemetry.COLUMNS)


def test_every_error_of_the_schema_can_be_explained():
    for number, name, _ in errors.ERRORS:
        values = {
            "request": messages.SHOW,
            "error": number,
            "field": 1,
            "element": 3,
            "asked": 15000,
            "low": 0,
            "high": 14000,
        }
        sentence = describe_refusal(Message(messages.ERROR, 0, values, {}))
        # Another protocol is the session's to explain; everything else has a sentence of its own.
        assert ("with error" in sentence) == (name == "no_common_protocol")
