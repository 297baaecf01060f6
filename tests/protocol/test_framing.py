"""Frames against a textbook COBS decoder and zlib, and the incremental decoder against any stream of bytes."""

import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, HEADER, OVERHEAD, PAYLOAD_MAX, Decoder, finish_frame, put_header

DIRTY = bytes(range(1, 256)) + b"\xff"  # what an earlier frame may have left in the buffer

ids = st.integers(0, 255)
sequences = st.integers(0, 0xFFFF)
# Zeros are what COBS is about: give them half of some payloads.
payloads = st.one_of(
    st.binary(max_size=PAYLOAD_MAX),
    st.lists(st.sampled_from([0, 0, 1, 255]), max_size=PAYLOAD_MAX).map(bytes),
    st.sampled_from([bytes(PAYLOAD_MAX), b"\x01" * PAYLOAD_MAX, b"\xff" * PAYLOAD_MAX]),
)
messages = st.tuples(ids, sequences, payloads)


def frame_of(message_id, sequence, payload):
    frame = bytearray(DIRTY)
    put_header(frame, message_id, sequence)
    frame[4 : 4 + len(payload)] = payload
    return bytes(frame[: finish_frame(frame, HEADER + len(payload), crc32_into)])


def take(decoder, data):
    """All messages that `data` completes, as (id, sequence number, payload)."""
    found = []
    at = 0
    while at < len(data):
        at = decoder.feed(data, at, len(data))
        if decoder.length:
            payload = bytes(decoder.frame[decoder.PAYLOAD_AT : 1 + decoder.length])
            found.append((decoder.message_id, decoder.sequence, payload))
    return found


def fresh():
    return Decoder(crc32_into)


def cobs_decode(block):
    """Cheshire and Baker's decoder, as in their paper: whole blocks, 255 without a zero."""
    out = bytearray()
    at = 0
    while at < len(block):
        code = block[at]
        assert code, "a zero inside a frame"
        assert at + code <= len(block), "a block beyond the end"
        out += block[at + 1 : at + code]
        at += code
        if code < 255 and at < len(block):
            out.append(0)
    return bytes(out)


def cobs_encode(content):
    """Their encoder, without a limit on the length."""
    out = bytearray()
    for run in content.split(b"\0"):
        rest = run
        while len(rest) >= 254:
            out += b"\xff" + rest[:254]
            rest = rest[254:]
        out += bytes([len(rest) + 1]) + rest
    return bytes(out)


@given(messages)
def test_a_frame_is_cobs_around_header_payload_and_crc(message):
    message_id, sequence, payload = message
    frame = frame_of(*message)
    assert frame.index(0) == len(frame) - 1
    content = cobs_decode(frame[:-1])
    assert content[:-4] == bytes([message_id]) + sequence.to_bytes(2, "little") + payload
    assert content[-4:] == zlib.crc32(content[:-4]).to_bytes(4, "little")
    assert len(frame) - len(payload) == OVERHEAD <= 9


@given(messages, st.sampled_from([bytes, bytearray]))
def test_a_message_comes_back(message, kind):
    decoder = fresh()
    assert take(decoder, kind(frame_of(*message))) == [message]
    assert (decoder.good, decoder.bad) == (1, 0)


@pytest.mark.medium
@given(st.lists(messages, max_size=5), st.data())
def test_frames_come_back_however_the_stream_is_cut(sent, data):
    stream = b"".join(frame_of(*message) for message in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    decoder = fresh()
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += take(decoder, stream[start:end])
    assert found == sent


def test_a_stream_may_come_byte_by_byte():
    sent = [(1, 2, b""), (255, 65535, bytes(247)), (0, 0, b"\xff" * 247)]
    decoder = fresh()
    stream = b"".join(frame_of(*message) for message in sent)
    assert [message for byte in stream for message in take(decoder, bytes([byte]))] == sent


@pytest.mark.medium
@given(st.lists(st.one_of(messages, st.binary(max_size=600)), max_size=6))
def test_what_is_not_a_frame_is_left_out_and_the_next_frame_understood(parts):
    """Garbage of any length ends at the next delimiter, as a host's first write does."""
    stream = b"".join(frame_of(*part) if isinstance(part, tuple) else part + b"\0" for part in parts)
    decoder = fresh()
    sent = [part for part in parts if isinstance(part, tuple)]
    assert take(decoder, stream) == sent
    assert decoder.good == len(sent)


@pytest.mark.medium
@given(st.binary(min_size=248, max_size=1000))
def test_a_frame_longer_than_allowed_is_dropped_however_right_it_is(payload):
    content = b"\x01\x02\x03" + payload
    long = cobs_encode(content + zlib.crc32(content).to_bytes(4, "little")) + b"\0"
    decoder = fresh()
    assert take(decoder, long + frame_of(4, 5, b"next")) == [(4, 5, b"next")]
    assert (decoder.good, decoder.bad) == (1, 1)


@pytest.mark.parametrize("length", [255, 256, 257, 5000])
def test_a_flood_without_a_delimiter_is_one_bad_frame(length):
    decoder = fresh()
    for _ in range(length):
        assert take(decoder, b"\x01") == []
    assert take(decoder, b"\0" + frame_of(4, 5, b"next")) == [(4, 5, b"next")]
    assert (decoder.good, decoder.bad) == (1, 1)


def test_every_small_error_in_a_frame_is_noticed():
    """All bits flipped, all bytes lost, doubled or zeroed, one at a time: nothing but what was sent is taken."""
    message = (4, 0x0100, b"\0\x01\0\0\xff" + bytes(range(20)))
    frame = frame_of(*message)
    wrong = [
        frame[:at] + bytes([frame[at] ^ 1 << bit]) + frame[at + 1 :] for at in range(len(frame)) for bit in range(8)
    ]
    for at in range(len(frame)):
        wrong += [
            frame[:at] + frame[at + 1 :],
            frame[:at] + frame[at : at + 1] + frame[at:],
            frame[:at] + b"\0" + frame[at:],
        ]
    decoder = fresh()
    for stream in wrong:
        found = take(decoder, stream + b"\0")
        # A delimiter put in just before a frame or just after it does no harm.
        assert found in ([], [message])
        assert found == [] or stream.strip(b"\0") == frame.strip(b"\0")
        assert take(decoder, frame) == [message]


def test_delimiters_alone_count_as_nothing():
    decoder = fresh()
    assert take(decoder, bytes(100)) == []
    assert (decoder.good, decoder.bad) == (0, 0)


def test_the_shortest_and_the_longest_frame():
    assert len(frame_of(1, 2, b"")) == OVERHEAD
    assert len(frame_of(1, 2, bytes(PAYLOAD_MAX))) == FRAME_MAX
    short = b"\x01\x02\x03"  # four bytes too few, with the CRC that would be theirs
    decoder = fresh()
    assert take(decoder, cobs_encode(short[:2] + zlib.crc32(short[:2]).to_bytes(4, "little")) + b"\0") == []
    assert decoder.bad == 1


def test_a_decoder_can_forget_a_frame_begun():
    decoder = fresh()
    frame = frame_of(9, 8, b"seven")
    take(decoder, frame[:4])
    decoder.reset()
    assert take(decoder, frame) == [(9, 8, b"seven")]
