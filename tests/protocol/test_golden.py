"""The golden vectors: host and device make exactly these frames and understand them.

A change here is a change of the wire: old firmware and new SDK no longer understand each other.
"""

import json
from array import array
from itertools import chain
from pathlib import Path

import pytest

from bubble_protocol import codec
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.link.message import SCHEMA_CRC, encode, signed_word
from bubbleskin.link.reader import Reader

GOLDEN = json.loads((Path(__file__).parent / "golden.json").read_text(encoding="utf-8"))
every_vector = pytest.mark.parametrize(
    "vector", GOLDEN["vectors"], ids=lambda vector: f"{vector['message']}-{vector['case']}"
)


def fixed_values(vector):
    """One number per value: a text is sixteen bytes."""
    values = []
    for value in vector["fixed"].values():
        values += value.encode().ljust(16, b"\0") if isinstance(value, str) else [value]
    return values


def test_every_message_is_there():
    assert {vector["message"] for vector in GOLDEN["vectors"]} == set(codec.BY_NAME)


def test_schema_and_version():
    assert GOLDEN["schema_crc"] == SCHEMA_CRC
    assert GOLDEN["protocol"] == [PROTOCOL_MIN, PROTOCOL_MAX]


@every_vector
def test_the_host_makes_the_frame(vector):
    frame = encode(vector["message"], vector["sequence"], fixed_values(vector), vector["repeated"])
    assert frame.hex() == vector["frame"]


@every_vector
def test_the_host_understands_the_frame(vector):
    (message,) = Reader().feed(bytes.fromhex(vector["frame"]))
    assert (message.id, message.sequence, message.fields) == (vector["id"], vector["sequence"], vector["fixed"])
    names = [field[0] for field in codec.BY_NAME[vector["message"]].repeated]
    assert list(message.columns) == names
    rows = list(zip(*(message.columns[name].tolist() for name in names), strict=True))
    assert rows == [tuple(row) for row in vector["repeated"]]


def test_the_device_makes_and_understands_the_frames(micropython):
    lines = []
    for vector in GOLDEN["vectors"]:
        values = array("i", map(signed_word, [*fixed_values(vector), *chain(*vector["repeated"])]))
        lines.append(
            " ".join(
                [
                    vector["message"],
                    str(vector["sequence"]),
                    str(len(vector["repeated"])),
                    vector["frame"],
                    *map(str, values),
                ]
            )
        )
    said = micropython(
        """
        import sys
        from array import array
        from bubble_protocol import codec, frame as framing
        from bubble_protocol.crc import crc32_into, crc32_word

        decoder = framing.Decoder(crc32_into)
        out = bytearray(framing.FRAME_MAX)
        right = 0
        for line in sys.stdin:
            name, sequence, count, frame, *values = line.split()
            message = codec.BY_NAME[name]
            sequence = int(sequence)
            count = int(count)
            frame = bytes.fromhex(frame)
            values = array("i", [int(value) for value in values])

            end = message.pack(values, count, out, framing.Decoder.PAYLOAD_AT)
            framing.put_header(out, message.id, sequence)
            made = bytes(out[: framing.finish_frame(out, end - 1, crc32_into)])

            taken = decoder.feed(frame, 0, len(frame))
            back = array("i", bytearray(4 * len(values)))
            found = message.unpack(decoder.frame, framing.Decoder.PAYLOAD_AT, decoder.length - framing.HEADER, back)
            if (
                made == frame
                and taken == len(frame)
                and (decoder.message_id, decoder.sequence, found) == (message.id, sequence, count)
                and list(back) == list(values)
            ):
                right += 1
            else:
                print(name, sequence, made.hex(), frame.hex(), list(back), list(values))
        schema = codec.schema_bytes()
        print(right, crc32_word(schema, 0, len(schema)))
        """,
        stdin="\n".join(lines) + "\n",
    )
    assert said.split() == [str(len(GOLDEN["vectors"])), str(signed_word(GOLDEN["schema_crc"]))]
