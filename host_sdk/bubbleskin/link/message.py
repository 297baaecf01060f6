"""Messages as Python values: names and numbers to frames, bytes to received messages. No I/O, no clock."""

import struct
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import crcmod.predefined
import numpy as np
from numpy.typing import NDArray

from bubble_protocol import codec, steps
from bubble_protocol.frame import FRAME_MAX, HEADER, NO_KEY, Decoder, finish_frame, put_header
from bubble_protocol.schema import errors, sequences
from bubble_protocol.schema.faults import BOARD_FAULTS, VENTING
from bubble_protocol.schema.modes import MODES
from bubbleskin.link.struct_codec import BY_ID, BY_NAME

_crc32 = crcmod.predefined.mkPredefinedCrcFun("crc-32")


def crc32(data: bytes | bytearray | memoryview) -> int:
    """CRC-32 as in zlib, by crcmod."""
    return _crc32(data)


def _crc32_into(buffer: bytearray, start: int, end: int, out: bytearray, at: int) -> None:
    out[at : at + 4] = _crc32(memoryview(buffer)[start:end]).to_bytes(4, "little")


SCHEMA_CRC = crc32(codec.schema_bytes())


@dataclass(frozen=True)
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
    packing = BY_NAME[name]
    message = packing.message
    frame = bytearray(FRAME_MAX)
    try:
        end = packing.pack(frame, Decoder.PAYLOAD_AT, fixed, repeated)
    except struct.error:  # a number beyond its kind: the codec keeps its low bits, and the device refuses what they say
        values = array("i", map(_signed, chain(fixed, *repeated)))
        end = message.pack(values, len(repeated), frame, Decoder.PAYLOAD_AT)
    put_header(frame, message.id, sequence)
    return bytes(frame[: finish_frame(frame, end - 1, _crc32_into, key)])


class Reader:
    """Bytes in, messages out. What is not a message of this protocol, or of the session of `key`, is dropped and counted."""

    def __init__(self, key: bytes = NO_KEY) -> None:
        self._decoder = Decoder(_crc32_into, key)
        self.unknown = 0

    def use(self, key: bytes) -> None:
        """Understand the frames of the session of `key` from now on."""
        self._decoder.key = key

    def reset(self) -> None:
        """Forget a frame begun, as after a reconnect."""
        self._decoder.reset()

    @property
    def bad(self) -> int:
        """Frames dropped: CRC, COBS, length, or a message that this side does not know."""
        return self._decoder.bad + self.unknown

    def feed(self, data: bytes) -> Iterator[Message]:
        """The messages completed by `data`."""
        at = 0
        while at < len(data):
            at = self._decoder.feed(data, at, len(data))
            if self._decoder.length:
                message = self._message()
                if message is None:
                    self.unknown += 1
                else:
                    yield message

    def _message(self) -> Message | None:
        decoder = self._decoder
        packing = BY_ID.get(decoder.message_id)
        if packing is None:
            return None
        message = packing.message
        size = decoder.length - HEADER
        if not message.stride:
            size = min(size, message.fixed_size)  # fields that newer firmware has appended
        count = message.count(size)
        if count < 0:
            return None
        fields, columns = packing.unpack(decoder.frame, Decoder.PAYLOAD_AT, count)
        return Message(decoder.message_id, decoder.sequence, fields, columns)


_WORDS = ("flags", "ramp (ms)", "time or timeout (ms)", "tolerance (µm)")


def _bad_step(error: Message) -> str:
    field = error["field"]
    word = _WORDS[field] if field < steps.HEAD else f"target (µm) of bubble {field - steps.HEAD}"
    return (
        f"the {word} of record {error['element']} in this message is {error['asked']}; "
        f"{error['low']} to {error['high']} is allowed."
    )


def _not_ready(error: Message) -> str:
    state = {number: name for number, name, _ in sequences.STATES}.get(error["asked"], "unknown")
    return (
        f"its sequence is {state}, with {error['low']} of {error['high']} records, or is another one. "
        "Upload the sequence and arm it first."
    )


_OF_SEQUENCES: dict[int, Callable[[Message], str]] = {
    errors.WRONG_BOARD: lambda error: "the sequence is for other hardware. Make one for this board.",
    errors.BAD_STEP: _bad_step,
    errors.BAD_LOOP: lambda error: (
        f"repeats and their ends do not fit at record {error['element']}: depth {error['asked']}, "
        f"0 to {error['high']} is allowed, and none is empty."
    ),
    errors.OUT_OF_ORDER: lambda error: f"record {error['asked']} came where {error['low']} was expected. Upload again.",
    errors.NO_ROOM: lambda error: (
        f"{error['asked']} records, with room for {error['high']}. Send what there is room for."
    ),
    errors.NOT_READY: _not_ready,
    errors.TOO_LATE: lambda error: (
        f"tick {error['asked']}, at which to start, has passed; the next is {error['low']}. Start later, or at once."
    ),
}


def describe_refusal(error: Message) -> str:
    """A sentence for an ERROR message, from the schema: what was refused, which field, what is allowed."""
    request = codec.BY_ID.get(error["request"])
    name = request.name if request else f"message 0x{error['request']:02x}"
    code = error["error"]
    asked, low, high = error["asked"], error["low"], error["high"]
    fields = request.fixed + request.repeated if request else ()
    if request and code == errors.OUT_OF_RANGE and error["field"] < len(fields):
        field = fields[error["field"]]
        unit = f" {field[2]}" if field[2] else ""
        where = f" (entry {error['element']})" if error["field"] >= len(request.fixed) else ""
        return f"The wristband refused {name}: {field[0]}{where} is {asked}{unit}; {low} to {high}{unit} is allowed."
    if code == errors.WRONG_COUNT:
        return f"The wristband refused {name}: {asked} entries for its {high} bubbles; send one per bubble."
    if code == errors.WRONG_LENGTH:
        return f"The wristband refused {name}: a payload of {asked} bytes; {low} to {high} are allowed. Update SDK or firmware."
    if code == errors.BAD_TABLE:
        return (
            f"The wristband refused the table of bubble {error['element']} at knot {asked}: heights must rise to the board's "
            f"greatest height and pressures stay within {high} Pa."
        )
    if code == errors.BAD_CRC:
        return f"The wristband refused {name}: what it received is not what was sent. Upload the tables again."
    if code == errors.FAULTED:
        return f"The wristband failed at {name} and vents. `bubbleskin info` counts its exceptions."
    if code == errors.BOARD_FAULT:
        faults = [sentence for bit, _, sentence in BOARD_FAULTS if asked & bit & VENTING]
        return f"The wristband refused {name}: {'; '.join(faults)}. Mend the cause, then `clear_faults()`."
    if code == errors.OVERTAKEN:
        return f"The wristband refused {name}: a later STOP or VENT has overtaken it. It was not applied."
    if code == errors.NOT_VENTED:
        modes = {number: mode for number, mode, _ in MODES}
        return (
            f"The wristband refused {name} because it is {modes.get(asked, 'busy')}, not vented. Call `vent()` first."
        )
    if code == errors.STORE_FOREIGN:
        return (
            f"The wristband refused {name}: its store holds what newer firmware or another board has saved. "
            "Update the firmware, or give that up with `factory_reset()`."
        )
    if code == errors.STORE_FAILED:
        return f"The wristband refused {name}: its flash does not hold what was written, or it has none for a store."
    if code in _OF_SEQUENCES:
        return f"The wristband refused {name}: {_OF_SEQUENCES[code](error)}"
    if code == errors.NO_SETTING:
        return f"The wristband refused {name}: it has no setting {asked}; they are numbered {low} to {high}. Update its firmware."
    if code == errors.UNKNOWN_MESSAGE:
        return f"The wristband does not know {name}: its firmware is older than this SDK. Update the firmware."
    return f"The wristband refused {name} with error {code}."


def _signed(value: int) -> int:
    """A number as a signed 32-bit word."""
    return ((int(value) & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
