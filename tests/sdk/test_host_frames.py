"""The host's frames, made and found as whole byte strings, against the device's, byte by byte."""

import tracemalloc
import zlib

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import CONTENT_MAX, CRC, FRAME_MAX, HEADER, NO_KEY, Decoder, finish_frame
from bubble_protocol.schema import messages
from bubbleskin.link.framing import FrameFinder, enclose

KEYS = st.sampled_from([NO_KEY, bytes(range(1, 5)), b"\xff\x00\x80\x01"])
ABOUT_HELLO = [bytes([messages.HELLO]), bytes([messages.HELLO | messages.REPLY])]
IDS = st.one_of(st.sampled_from([*ABOUT_HELLO, bytes([messages.ERROR]), b"\0"]), st.binary(min_size=1, max_size=1))
# Zeros and the id of HELLO are what frames treat differently.
PAYLOADS = st.lists(st.sampled_from([0, 0, 1, 7, 255]), max_size=CONTENT_MAX - HEADER - CRC - 1).map(bytes)
CONTENTS = st.builds(lambda head, number, rest: head + number + rest, IDS, st.binary(min_size=2, max_size=2), PAYLOADS)


def device_frame(content, key):
    frame = bytearray(FRAME_MAX)
    frame[1 : 1 + len(content)] = content
    return bytes(frame[: finish_frame(frame, len(content), crc32_into, key)])


def device_finds(decoder, data):
    """Contents of the frames in `data`, without their CRC."""
    at = 0
    found = []
    while at < len(data):
        at = decoder.feed(data, at, len(data))
        if decoder.length:
            found.append(bytes(decoder.frame[1 : 1 + decoder.length]))
    return found


@given(CONTENTS, KEYS)
@example(b"\x04\x00\x00" + b"\x01" * (CONTENT_MAX - HEADER - CRC), NO_KEY)
@example(bytes(CONTENT_MAX - CRC), NO_KEY)
@example(bytes([messages.ERROR, 0, 0]), b"abcd")
def test_both_ends_make_the_same_frame(content, key):
    if content[0] == messages.ERROR and len(content) == HEADER:
        content += b"\0"  # its first field says what it is about
    assert enclose(content, key) == device_frame(content, key)


def test_a_payload_that_no_frame_takes_is_refused():
    with pytest.raises(ValueError, match="a frame takes 247"):
        enclose(bytes(CONTENT_MAX - CRC + 1), NO_KEY)


@st.composite
def streams(draw):
    """Frames of two keys, some of them damaged, noise and delimiters, and where the stream is cut into pieces."""
    parts = []
    for _ in range(draw(st.integers(1, 6))):
        frame = bytearray(enclose(draw(CONTENTS) + b"\1", draw(KEYS)))
        kind = draw(st.sampled_from(["whole", "whole", "damaged", "cut", "noise", "delimiters", "too long"]))
        if kind == "damaged":
            frame[draw(st.integers(0, len(frame) - 1))] ^= draw(st.integers(1, 255))
        elif kind == "cut":
            del frame[draw(st.integers(0, len(frame) - 1)) :]
        elif kind == "noise":
            frame = bytearray(draw(st.binary(max_size=20)))
        elif kind == "delimiters":
            frame = bytearray(draw(st.integers(1, 3)))
        elif kind == "too long":
            frame = bytearray(b"\1" * draw(st.integers(FRAME_MAX - 3, 3 * FRAME_MAX)) + b"\0")
        parts.append(bytes(frame))
    stream = b"".join(parts)
    cuts = sorted(draw(st.lists(st.integers(0, len(stream)), max_size=4)))
    return [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]


@pytest.mark.medium
@given(streams(), KEYS)
def test_both_ends_find_the_same_frames(pieces, key):
    finder, decoder = FrameFinder(key), Decoder(crc32_into, key)
    for piece in pieces:
        assert [bytes(content[:-CRC]) for content in finder.feed(piece)] == device_finds(decoder, piece)
        assert finder.bad == decoder.bad


def test_neither_end_takes_a_frame_with_a_good_crc_that_is_too_long_or_ends_wrongly():
    content = bytes(CONTENT_MAX - CRC + 1)
    too_long = _by_hand(content + zlib.crc32(content).to_bytes(CRC, "little"))
    beyond = bytearray(enclose(b"\x04\1\1seven", NO_KEY))
    beyond[0] += 1
    for frame in (too_long, bytes(beyond)):
        finder, decoder = FrameFinder(NO_KEY), Decoder(crc32_into)
        assert list(finder.feed(frame)) == device_finds(decoder, frame) == []
        assert finder.bad == decoder.bad == 1


def _by_hand(content):
    return b"".join(bytes([1 + len(run)]) + run for run in content.split(b"\0")) + b"\0"


def test_the_key_may_change_between_two_frames_of_one_read():
    ours, other = b"ours", b"them"
    finder = FrameFinder(NO_KEY)
    found = []
    for content in finder.feed(enclose(b"\x81\1\0", ours) + enclose(b"\x84\2\0", ours) + enclose(b"\x84\3\0", other)):
        found.append(content[1])
        finder.key = ours
    assert found == [1, 2]
    assert finder.bad == 1


def test_what_waits_for_its_delimiter_stays_small():
    finder = FrameFinder(NO_KEY)
    noise = b"\1" * 1000
    tracemalloc.start()
    for _ in range(300):
        assert list(finder.feed(noise)) == []
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 10_000
    assert list(finder.feed(b"\0" + enclose(b"\x82\1\0", NO_KEY)))
    assert finder.bad == 1
