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
from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput
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
    return enclose(pack(name, sequence, fixed, repeated), key)


def pack(name: str, sequence: int, fixed: Sequence[int], repeated: Sequence[Sequence[int]]) -> bytes:
    """Id, sequence number and payload of one message. `InvalidInput` for values that no message can have."""
    struct_codec = BY_NAME[name]
    if not (hasattr(fixed, "__len__") and hasattr(repeated, "__len__")) or len(repeated) > FRAME_MAX:
        raise InvalidInput(f"{name} takes numbers and a few rows of them, not {shown(repeated)}.")
    try:
        return struct_codec.pack(sequence, fixed, repeated)
    except (struct.error, TypeError):
        payload = _low_bits(struct_codec.message, fixed, repeated)
        return struct.pack("<BH", struct_codec.message.id, sequence & 0xFFFF) + payload


def _low_bits(message: codec.Message, fixed: Sequence[int], repeated: Sequence[Sequence[int]]) -> bytes:
    """The payload where a number is beyond its kind: its low bits, as of the device's codec; the device refuses what they say."""
    try:
        given = list(chain(fixed, *repeated))
    except TypeError:
        raise InvalidInput(f"{message.name} takes rows of numbers, not {shown(repeated)}.") from None
    wanted = message.fixed_values + len(repeated) * message.stride_values
    if len(given) != wanted:
        raise InvalidInput(f"{message.name} takes {wanted} values, not {len(given)}.")
    for value in given:
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or isinstance(value, np.timedelta64):
            raise InvalidInput(f"{message.name} takes whole numbers; {shown(value)} is none.")
    payload = bytearray(4 * wanted)  # none takes more than four bytes
    end = message.pack(array("i", map(signed_word, given)), len(repeated), payload, 0)
    return bytes(payload[:end])


def numbered(content: bytes, sequence: int, key: bytes) -> bytes:
    """The frame of what `pack` made, under another sequence number."""
    return enclose(content[:1] + sequence.to_bytes(2, "little") + content[3:], key)


def signed_word(value: int) -> int:
    """A number as a signed 32-bit word."""
    return ((int(value) & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
