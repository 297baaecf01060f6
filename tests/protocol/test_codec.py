"""The codec against Python's struct, for every message of the schema."""

import struct
import zlib
from array import array

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bubble_protocol import codec, packing
from bubble_protocol.frame import PAYLOAD_MAX
from bubble_protocol.schema import messages, packed

FORMATS = {
    messages.U8: "B",
    messages.U16: "H",
    messages.U32: "I",
    messages.I16: "h",
    messages.I32: "i",
    messages.TEXT: "16B",
}
every_message = pytest.mark.parametrize("message", codec.BY_ID.values(), ids=lambda message: message.name)


def layout(message, count):
    return "<" + "".join(FORMATS[field[1]] for field in [*message.fixed, *message.repeated * count])


def kinds(message, count):
    """The kind of each value: a text is sixteen bytes."""
    for field in [*message.fixed, *message.repeated * count]:
        yield from [messages.U8] * 16 if field[1] == messages.TEXT else [field[1]]


def extremes(kind):
    bits = 8 * (kind & 15)
    ends = (
        [-(1 << bits - 1), -1, 0, 1, (1 << bits - 1) - 1]
        if kind in (messages.I16, messages.I32)
        else [0, 1, 1 << bits - 1, (1 << bits) - 1]
    )
    return st.one_of(st.sampled_from(ends), st.integers(ends[0], ends[-1]))


def room(message):
    return (PAYLOAD_MAX - message.fixed_size) // message.stride if message.stride else 0


def word(value):
    """As `array('i')` holds it."""
    return value - (value >> 31 << 32) if value > 0 else value


@pytest.mark.medium
@every_message
@settings(max_examples=settings.default.max_examples // 5)  # of every message
@given(data=st.data())
def test_pack_and_unpack_are_structs(message, data):
    count = data.draw(st.integers(0, room(message)))
    values = data.draw(st.tuples(*(extremes(kind) for kind in kinds(message, count))))
    packed = struct.pack(layout(message, count), *values)
    words = array("i", map(word, values))
    start = data.draw(st.integers(0, 9))

    payload = bytearray(b"\xaa" * (start + len(packed) + 2))
    assert message.pack(words, count, payload, start) == start + len(packed)
    assert payload == b"\xaa" * start + packed + b"\xaa" * 2

    back = array("i", [123456789] * (len(words) + 2))
    assert message.unpack(payload, start, len(packed), back) == count
    assert back[:-2] == words
    assert list(back[-2:]) == [123456789] * 2


@every_message
def test_a_payload_of_another_size_is_refused_and_not_read(message):
    """Another size than an older version's, this one's or a newer one's."""
    sizes = {struct.calcsize(layout(message, count)): count for count in range(room(message) + 1)}
    if not message.repeated:
        first = messages.FIRST_SIZES.get(message.id, min(sizes))
        sizes = dict.fromkeys(range(first, PAYLOAD_MAX + 1), 0)
    assert max(sizes) <= PAYLOAD_MAX
    payload = bytearray(PAYLOAD_MAX)
    untouched = array("i", [7] * PAYLOAD_MAX)
    values = untouched[:]
    for size in range(PAYLOAD_MAX + 1):
        if size not in sizes:
            assert message.unpack(payload, 0, size, values) == -1
            assert values == untouched
        assert message.count(size) == sizes.get(size, -1)


@every_message
def test_fields_that_a_newer_version_has_appended_are_not_read(message):
    if message.repeated:
        return
    payload = bytearray(range(message.fixed_size)) + bytearray(b"\xff" * (PAYLOAD_MAX - message.fixed_size))
    values = array("i", [7] * PAYLOAD_MAX)
    assert message.unpack(payload, 0, PAYLOAD_MAX, values) == 0
    exact = array("i", [7] * PAYLOAD_MAX)
    assert message.unpack(payload, 0, message.fixed_size, exact) == 0
    assert values == exact


def test_a_device_packs_as_the_schema_says():
    """Its table is generated; here it is compared with the messages themselves, field by field."""
    assert list(packing.BY_ID) == list(codec.BY_ID)
    assert zlib.crc32(codec.schema_bytes()) == packed.SCHEMA_CRC & 0xFFFFFFFF
    for message_id, message in codec.BY_ID.items():
        device, host = vars(packing.BY_ID[message_id]), vars(message)
        assert device == {name: host[name] for name in device}, message.name
        assert set(host) - set(device) == {"id", "name", "fixed", "repeated", "meaning"}


def test_fields_that_an_older_version_does_not_send_are_zero():
    """HELLO had no session in protocol 1. What stands behind the payload is not taken for it."""
    hello = codec.BY_NAME["HELLO"]
    values = array("i", [7] * hello.fixed_values)
    assert hello.unpack(bytearray(b"\x01\x01\xff\xff\xff\xff"), 0, 2, values) == 0
    assert values.tolist() == [1, 1, 0]


def test_what_decides_the_bytes_decides_the_schemas_crc(monkeypatch):
    """Ids, names, order and kinds do; units, limits and meanings do not."""
    before = codec.schema_bytes()

    def changed(edit):
        data = [list(message) for message in messages.MESSAGES]
        edit(data)
        monkeypatch.setattr(codec, "MESSAGES", data)
        return codec.schema_bytes() != before

    def field(data, **new):
        name, kind, unit, low, high, meaning = data[1][2][0]
        first = (
            new.get("name", name),
            new.get("kind", kind),
            new.get("unit", unit),
            low,
            new.get("high", high),
            meaning,
        )
        data[1][2] = (first, *data[1][2][1:])

    assert not changed(lambda data: None)
    assert changed(lambda data: data[3].__setitem__(0, 0x55))
    assert changed(lambda data: data[3].__setitem__(1, "SHAPE"))
    assert changed(lambda data: data.reverse())
    assert changed(lambda data: field(data, name="other"))
    assert changed(lambda data: field(data, kind=messages.U16))
    assert changed(lambda data: data[1].__setitem__(2, data[1][2][::-1]))
    assert not changed(lambda data: data[3].__setitem__(4, "said otherwise"))
    assert not changed(lambda data: field(data, unit="m", high=5))


@every_message
def test_the_first_value_beyond_its_limit_is_named_and_none_at_it(message):
    count = min(room(message), 3) if message.stride else 0
    fixed, stride = message.fixed_values, message.stride_values
    total = fixed + count * stride
    none = [None] * (fixed + stride)
    assert message.limits is None or len(message.limits) == 2
    lows, highs = message.limits or (none, none)
    for ends, others, beyond in ((lows, highs, -1), (highs, lows, 1)):
        at = [place if place < fixed else fixed + (place - fixed) % stride for place in range(total)]
        values = array("i", [others[place] or 0 if ends[place] is None else ends[place] for place in at])
        assert message.first_out_of_range(values, count) == -1
        for place in range(total):
            if ends[at[place]] is not None:
                values[place] += beyond
                assert message.first_out_of_range(values, count) == place
                values[place] -= beyond
