"""Messages as Python values, and the frames that carry them. No I/O, no clock."""

import struct
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bubble_protocol import codec
from bubble_protocol.frame import FRAME_MAX, NO_KEY
from bubbleskin.link.framing import crc32, enclose
from bubbleskin.link.struct_codec import BY_NAME

SCHEMA_CRC = crc32(codec.schema_bytes())


@dataclass(slots=True)
class Message:
    """One message: its fixed fields by name, its repeated fields as columns by name."""

    id: int
    sequence: int
    fields: dict[str, int | str]
    columns: Mapping[str, NDArray[np.int64]]

    def __getitem__(self, name: str) -> int:
        value = self.fields[name]
        assert isinstance(value, int)
        return value


def name_of(message_id: int) -> str:
    """What the schema calls a message, for people."""
    message = codec.BY_ID.get(message_id)
    return message.name if message else f"message 0x{message_id:02x}"


def session_key(boot_id: int, session: int) -> bytes:
    """What the CRCs of one session's frames are mixed with: CRC-32 of boot id and session, both u32."""
    return crc32(boot_id.to_bytes(4, "little") + session.to_bytes(4, "little")).to_bytes(4, "little")


def encode(
    name: str,
    sequence: int,
    fixed: Sequence[int] = (),
    repeated: Sequence[Sequence[int]] = (),
    key: bytes = NO_KEY,
) -> bytes:
    """The frame of one message: `fixed` fields in the schema's order, `repeated` rows likewise; `key` of `session_key`."""
    struct_codec = BY_NAME[name]
    try:
        content = struct_codec.pack(sequence, fixed, repeated)
    except struct.error:  # a number beyond its kind: the codec keeps its low bits, and the device refuses what they say
        message = struct_codec.message
        values = array("i", map(signed_word, chain(fixed, *repeated)))
        payload = bytearray(FRAME_MAX)
        end = message.pack(values, len(repeated), payload, 0)
        content = struct.pack("<BH", message.id, sequence & 0xFFFF) + payload[:end]
    return enclose(content, key)


def signed_word(value: int) -> int:
    """A number as a signed 32-bit word."""
    return ((int(value) & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
