"""Write `tests/protocol/golden.json`: every message with example and extreme values, and its frame; and one session.

    python tools/generate/golden_vectors.py            # write it
    python tools/generate/golden_vectors.py --check    # fail if it is not what would be written

The frames are made here from the schema with struct, zlib and a textbook COBS encoder, not with the code
that they test.

`tests/protocol/sessions/<protocol>-<firmware>.json` is a conversation of SDK and firmware of this version: what
was sent and what was answered, tick by tick. Once a version is released its file stays as it is, and every later
version must understand both sides of it.
"""

import json
import struct
import zlib
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import generated

from bubble_firmware import boards
from bubble_protocol import codec, frame, version
from bubble_protocol.schema import messages
from bubbleskin.link import message
from bubbleskin.sim.firmware import InProcessFirmware

PATH = Path("tests/protocol/golden.json")

FORMATS = {
    messages.U8: "B",
    messages.U16: "H",
    messages.U32: "I",
    messages.I16: "h",
    messages.I32: "i",
    messages.TEXT: "16s",
}
RANGES = {
    messages.U8: (0, 0xFF),
    messages.U16: (0, 0xFFFF),
    messages.U32: (0, 0xFFFFFFFF),
    messages.I16: (-(1 << 15), (1 << 15) - 1),
    messages.I32: (-(1 << 31), (1 << 31) - 1),
}
TEXTS = {"least": "", "example": "wristband7", "greatest": "~" * 16}
EXAMPLE_BUBBLES = 7
SESSION_PATH = Path(f"tests/protocol/sessions/{version.PROTOCOL_MAX}-{'.'.join(map(str, version.FIRMWARE))}.json")
BOOT_ID, SESSION = 1, 0x12345678

Field = tuple[str, int, str, int | None, int | None, str]


def limits(field: Field) -> tuple[int, int]:
    """What the schema allows of a field that is a number."""
    lowest, highest = RANGES[field[1]]
    return lowest if field[3] is None else field[3], highest if field[4] is None else field[4]


def value(field: Field, case: str, number: int) -> int | str:
    """The value of the `number`th field of a frame."""
    if field[1] == messages.TEXT:
        return TEXTS[case]
    low, high = limits(field)
    if case == "example":  # scattered over what is allowed
        return low + (number + 1) * 0x9E3779B1 % (high - low + 1)
    return low if case == "least" else high


def repetitions(fixed: Sequence[Field], group: Sequence[Field], case: str) -> int:
    """None, one per bubble, as many as a frame holds."""
    if not group or case == "least":
        return 0
    room = frame.PAYLOAD_MAX - struct.calcsize(layout(fixed))
    return EXAMPLE_BUBBLES if case == "example" else room // struct.calcsize(layout(group))


def layout(fields: Sequence[Field]) -> str:
    """The struct format of some fields."""
    return "<" + "".join(FORMATS[field[1]] for field in fields)


def cobs(content: bytes) -> bytes:
    """The content without zeros, each replaced by the distance to the next (Cheshire and Baker)."""
    out = bytearray()
    for run in content.split(b"\0"):
        rest = run
        while len(rest) > 254:
            out += b"\xff" + rest[:254]
            rest = rest[254:]
        out += bytes([len(rest) + 1]) + rest
    return bytes(out)


def vectors() -> Iterator[dict[str, object]]:
    """One per message and case."""
    for place, (message_id, name, fixed, group, _) in enumerate(messages.MESSAGES):
        for case, sequence in (("least", 0), ("example", 0x0100 + place), ("greatest", 0xFFFF)):
            first = [value(field, case, number) for number, field in enumerate(fixed)]
            rows = [
                [value(field, case, len(fixed) + row * len(group) + number) for number, field in enumerate(group)]
                for row in range(repetitions(fixed, group, case))
            ]
            flat = [entry.encode() if isinstance(entry, str) else entry for entry in sum(rows, first)]
            payload = struct.pack(layout([*fixed, *group * len(rows)]), *flat)
            content = struct.pack("<BH", message_id, sequence) + payload
            content += struct.pack("<I", zlib.crc32(content))
            yield {
                "message": name,
                "case": case,
                "id": message_id,
                "sequence": sequence,
                "fixed": {field[0]: entry for field, entry in zip(fixed, first, strict=True)},
                "repeated": rows,
                "frame": (cobs(content) + b"\0").hex(),
            }


def text() -> str:
    """One vector a line, so that a diff shows which messages have changed."""
    head = {
        "protocol": [version.PROTOCOL_MIN, version.PROTOCOL_MAX],
        "schema_crc": zlib.crc32(codec.schema_bytes()),
    }
    lines = ",\n".join(json.dumps(vector) for vector in vectors())
    return f'{json.dumps(head)[:-1]}, "vectors": [\n{lines}\n]}}\n'


def session() -> str:
    """A conversation with a wristband at rest: every request that an SDK of this version makes."""
    board = boards.load("wristband7")
    firmware = InProcessFirmware(board, BOOT_ID)
    counts = array("H", [board.SENSOR_ZERO] * board.BUBBLES + [2560])
    key = message.session_key(BOOT_ID, SESSION)
    shape = [(9000 + 100 * bubble,) for bubble in range(board.BUBBLES)]
    asked: list[tuple[str, tuple[int, ...], list[tuple[int, ...]]]] = [
        ("INFO", (), []),
        ("SUBSCRIBE", (3,), []),
        ("SHOW", (200,), shape),
        ("STATE", (), []),
        ("TABLE_READ", (2, 40), []),
        ("TABLE_WRITE", (1, 0, 3), [(5000, 0), (9000, 20000), (14000, 40000)]),
        ("TABLE_COMMIT", (1,), []),
        ("SUBSCRIBE", (0,), []),
        ("SHOW", (0,), shape[1:]),
        ("STOP", (), []),
        ("VENT", (), []),
        ("CLEAR", (), []),
        ("TICKS", (), []),
        ("RESTART", (0,), []),
    ]
    sent = [message.encode("HELLO", 1, (version.PROTOCOL_MIN, version.PROTOCOL_MAX, SESSION))]
    sent.append(message.encode("PING", 1, (7,), key=key))
    for number, (name, fixed, rows) in enumerate(asked, 1):
        sent += [message.encode(name, number, fixed, rows, key), b"", b""]
    sent.insert(-3, sent[-6])  # TICKS once more, before RESTART: answered from the replies kept
    lines = [{"sent": data.hex(), "received": firmware.tick(counts, data).link.hex()} for data in sent]
    head = {"boot_id": BOOT_ID, "session": SESSION}
    ticks = ",\n".join(json.dumps(line) for line in lines)
    return f'{json.dumps(head)[:-1]}, "ticks": [\n{ticks}\n]}}\n'


if __name__ == "__main__":
    generated.main({PATH: text, SESSION_PATH: session})
