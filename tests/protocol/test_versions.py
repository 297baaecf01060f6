"""Older and newer peers: conversations recorded by earlier versions, and peers that have appended fields.

Protocol 1 and 3 are refused with the sentence that mends it: see `tests/sdk/test_connect.py` for the SDK's side and
`tests/firmware/test_delivery.py` for the firmware's.
"""

import json
from array import array
from pathlib import Path

import pytest

from bubble_firmware import boards
from bubble_protocol import codec
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, Decoder, finish_frame
from bubble_protocol.schema import messages
from bubbleskin.link.message import session_key
from bubbleskin.link.reader import Reader
from bubbleskin.sim.firmware import InProcessFirmware

RECORDED = sorted((Path(__file__).parent / "sessions").glob("*.json"))
every_version = pytest.mark.parametrize("path", RECORDED, ids=lambda path: path.stem)


@pytest.fixture
def recorded(path):
    return json.loads(path.read_text(encoding="utf-8"))


def read(recorded, key, side):
    reader = Reader(key)
    found = [message for tick in recorded["ticks"] for message in reader.feed(bytes.fromhex(tick[side]))]
    assert reader.bad == 0
    return found


@every_version
def test_todays_sdk_understands_the_devices_of_then(recorded):
    key = session_key(recorded["boot_id"], recorded["session"])
    received = read(recorded, key, "received")
    sent = read(recorded, key, "sent")
    answers = [message for message in received if message.id != messages.TELEMETRY]
    assert [answer.sequence for answer in answers] == [request.sequence for request in sent]
    for request, answer in zip(sent, answers, strict=True):
        assert answer.id in (request.id | messages.REPLY, messages.ERROR)


@every_version
def test_todays_firmware_answers_the_sdks_of_then_as_then(recorded):
    """Every field that was there then has the value of then, but for versions, CRC of the schema, and what counts on."""
    board = boards.load("wristband7")
    firmware = InProcessFirmware(board, recorded["boot_id"])
    counts = array("H", [board.SENSOR_ZERO] * board.BUBBLES + [2560])
    key = session_key(recorded["boot_id"], recorded["session"])
    then, now = Reader(key), Reader(key)
    changing = {"schema_crc", "firmware_major", "firmware_minor", "firmware_patch", "capabilities", "protocol_max"}
    for tick in recorded["ticks"]:
        link = firmware.tick(counts, bytes.fromhex(tick["sent"])).link
        for old, new in zip(then.feed(bytes.fromhex(tick["received"])), now.feed(link), strict=True):
            assert (old.id, old.sequence) == (new.id, new.sequence)
            for name in old.fields.keys() - changing:
                assert new.fields[name] == old.fields[name], name
            for name, column in old.columns.items():
                assert new.columns[name].tolist() == column.tolist(), name
    assert (then.bad, now.bad) == (0, 0)


def longer(frame, key):
    """The frame with six more bytes of payload, as a version sends it that has appended fields."""
    decoder = Decoder(crc32_into, key)
    decoder.feed(frame, 0, len(frame))
    message = codec.BY_ID.get(decoder.message_id)
    if message is None or message.stride:  # nothing can be appended behind a repeated group
        return frame
    content = bytearray(FRAME_MAX)
    content[: 1 + decoder.length] = decoder.frame[: 1 + decoder.length]
    content[1 + decoder.length : 7 + decoder.length] = b"\xff\x01\x00\x02\xfe\x03"
    return bytes(content[: finish_frame(content, decoder.length + 6, crc32_into, key)])


@every_version
def test_fields_appended_by_newer_peers_are_ignored_by_both_ends(recorded):
    board = boards.load("wristband7")
    counts = array("H", [board.SENSOR_ZERO] * board.BUBBLES + [2560])
    key = session_key(recorded["boot_id"], recorded["session"])
    plain, newer = (InProcessFirmware(board, recorded["boot_id"]) for _ in range(2))
    for tick in recorded["ticks"]:
        frame = bytes.fromhex(tick["sent"])
        link = plain.tick(counts, frame).link
        # frames_good counts alike; whatever a newer host has appended, the answers are the same
        assert newer.tick(counts, longer(frame, key) if frame else b"").link == link
        for part in link.split(b"\0")[:-1]:
            (one,) = Reader(key).feed(part + b"\0")
            (other,) = Reader(key).feed(longer(part + b"\0", key))
            assert one.fields == other.fields
