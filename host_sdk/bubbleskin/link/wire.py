"""Messages as Python values: names and numbers to frames, bytes to received messages. No I/O, no clock."""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import crcmod.predefined
import numpy as np
from numpy.typing import NDArray

from bubble_protocol import codec, framing, messages

_crc32 = crcmod.predefined.mkPredefinedCrcFun("crc-32")


def crc32(data: bytes | bytearray | memoryview) -> int:
    """CRC-32 as in zlib, by crcmod."""
    return _crc32(data)


def _crc32_into(buffer: bytearray, start: int, end: int, out: bytearray, at: int) -> None:
    out[at : at + 4] = _crc32(memoryview(buffer)[start:end]).to_bytes(4, "little")


SCHEMA_CRC = crc32(codec.schema_bytes())


@dataclass(frozen=True)
class Received:
    """One message: its fixed fields by name, its repeated fields as columns by name."""

    id: int
    sequence: int
    fields: dict[str, int | str]
    columns: dict[str, NDArray[np.int64]]

    def __getitem__(self, name: str) -> int:
        value = self.fields[name]
        assert isinstance(value, int)
        return value


def encode(name: str, sequence: int, fixed: Sequence[int] = (), repeated: Sequence[Sequence[int]] = ()) -> bytes:
    """The frame of one message: `fixed` fields in the schema's order, `repeated` rows likewise."""
    message = codec.BY_NAME[name]
    values = array("i", (_signed(value) for value in fixed))
    for row in repeated:
        values.extend(map(_signed, row))
    frame = bytearray(framing.FRAME_MAX)
    end = message.pack(values, len(repeated), frame, framing.Decoder.PAYLOAD_AT)
    framing.put_header(frame, message.id, sequence)
    return bytes(frame[: framing.seal(frame, end - 1, _crc32_into)])


class Reader:
    """Bytes in, messages out. What is not a message of this protocol is dropped and counted."""

    def __init__(self) -> None:
        self._decoder = framing.Decoder(_crc32_into)
        self._values = array("i", bytes(4 * framing.PAYLOAD_MAX))
        self.unknown = 0

    @property
    def bad(self) -> int:
        """Frames dropped: CRC, COBS, length, or a message that this side does not know."""
        return self._decoder.bad + self.unknown

    def feed(self, data: bytes) -> Iterator[Received]:
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

    def _message(self) -> Received | None:
        decoder = self._decoder
        message = codec.BY_ID.get(decoder.message_id)
        if message is None:
            return None
        size = decoder.length - framing.HEADER
        if not message.stride:
            size = min(size, message.fixed_size)  # fields that newer firmware has appended
        count = message.unpack(decoder.frame, framing.Decoder.PAYLOAD_AT, size, self._values)
        if count < 0:
            return None
        fields: dict[str, int | str] = {}
        at = 0
        for name, kind, *_ in message.fixed:
            if kind == messages.TEXT:
                text = bytes(self._values[at : at + 16].tolist()).rstrip(b"\0")
                fields[name] = text.decode("ascii", "replace")
                at += 16
            else:
                value = self._values[at]
                fields[name] = value & 0xFFFFFFFF if kind == messages.U32 else value
                at += 1
        stride = message.stride_values
        rows = np.array(self._values[at : at + count * stride], dtype=np.int64).reshape(count, stride)
        columns = {field[0]: rows[:, index] for index, field in enumerate(message.repeated)}
        for name, kind, *_ in message.repeated:
            if kind == messages.U32:
                columns[name] &= 0xFFFFFFFF
        return Received(decoder.message_id, decoder.sequence, fields, columns)


def explain(error: Received) -> str:
    """A sentence for an ERROR message, from the schema: what was refused, which field, what is allowed."""
    request = codec.BY_ID.get(error["request"])
    name = request.name if request else f"message 0x{error['request']:02x}"
    code = error["error"]
    asked, low, high = error["asked"], error["low"], error["high"]
    fields = request.fixed + request.repeated if request else ()
    if request and code == messages.OUT_OF_RANGE and error["field"] < len(fields):
        field = fields[error["field"]]
        unit = f" {field[2]}" if field[2] else ""
        where = f" (entry {error['element']})" if error["field"] >= len(request.fixed) else ""
        return f"The wristband refused {name}: {field[0]}{where} is {asked}{unit}; {low} to {high}{unit} is allowed."
    if code == messages.WRONG_COUNT:
        return f"The wristband refused {name}: {asked} entries for its {high} bubbles; send one per bubble."
    if code == messages.WRONG_LENGTH:
        return f"The wristband refused {name}: a payload of {asked} bytes; {low} to {high} are allowed. Update SDK or firmware."
    if code == messages.BAD_TABLE:
        return (
            f"The wristband refused the table of bubble {error['element']} at knot {asked}: heights must rise to the board's "
            f"greatest height and pressures stay within {high} Pa."
        )
    if code == messages.BAD_CRC:
        return f"The wristband refused {name}: what it received is not what was sent. Upload the tables again."
    if code == messages.FAULTED:
        return f"The wristband failed at {name} and vents. `bubbleskin info` counts its exceptions."
    if code == messages.BOARD_FAULT:
        faults = [sentence for bit, _, sentence in messages.BOARD_FAULTS if asked & bit & messages.VENTING]
        return f"The wristband refused {name}: {'; '.join(faults)}. Mend the cause, then `clear_faults()`."
    if code == messages.NO_SETTING:
        return f"The wristband refused {name}: it has no setting {asked}; they are numbered {low} to {high}. Update its firmware."
    if code == messages.UNKNOWN_MESSAGE:
        return f"The wristband does not know {name}: its firmware is older than this SDK. Update the firmware."
    return f"The wristband refused {name} with error {code}."


def _signed(value: int) -> int:
    """A number as a signed 32-bit word."""
    value = int(value)
    return value - (1 << 32) if value > 0x7FFFFFFF else value
