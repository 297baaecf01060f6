"""What a firmware has decided against what was recorded: valve by valve, message by message, field by field."""

from collections.abc import Iterator
from itertools import zip_longest
from typing import Any, NamedTuple

from bubble_protocol.frame import CRC, HEADER
from bubble_protocol.schema import messages
from bubbleskin.link.framing import uncover
from bubbleskin.link.message import name_of
from bubbleskin.link.struct_codec import BY_ID
from bubbleskin.sim.trace_file import POWER_FAILED, Call

NOT_COMPARED = {
    (messages.INFO | messages.REPLY, "heap_free"),
    (messages.HELLO | messages.REPLY, "firmware_major"),
    (messages.HELLO | messages.REPLY, "firmware_minor"),
    (messages.HELLO | messages.REPLY, "firmware_patch"),
    (messages.HELLO | messages.REPLY, "schema_crc"),
}
"""Fields by which an interpreter or a version speaks of itself; with them goes the CRC of their frame."""


class Difference(NamedTuple):
    """The first value that differs."""

    tick: int
    """Ticks since power came, from 0 on."""
    time_s: float
    """The same in seconds."""
    what: str
    """Such as 'fill valve of bubble 3 (µs)' or 'STATE_REPLY.height_um[2]'."""
    recorded: Any
    replayed: Any

    def __str__(self) -> str:
        return (
            f"tick {self.tick} ({self.time_s:.3f} s): {self.what} was {self.recorded} in the recording, "
            f"and is {self.replayed} now"
        )


class Decided(NamedTuple):
    """What a call of a firmware has led to: as the last fields of `Call`."""

    pulses: tuple[int, ...]
    pump: int
    dump: bool
    sent: bytes


NOTHING = Decided((), 0, False, b"")
"""Of a call after which there are no decisions."""

Found = tuple[str, Any, Any]


def first_difference(call: Call, decided: Decided, tick_us: int) -> Found | None:
    """What differs, what was recorded and what is replayed; None where all is the same.

    A valve that is open for longer than a period is open throughout.
    """
    if call.kind == POWER_FAILED:
        both_seen = call.sent and decided.sent
        return (
            ("CRC-32 of flash", call.sent.hex(), decided.sent.hex())
            if both_seen and call.sent != decided.sent
            else None
        )
    if call[4:] == decided:
        return None
    for valve, (recorded, replayed) in enumerate(zip(call.pulses, decided.pulses, strict=True)):
        if min(recorded, tick_us) != min(replayed, tick_us):
            kind = "vent" if valve % 2 else "fill"
            return f"{kind} valve of bubble {valve // 2} (µs)", min(recorded, tick_us), min(replayed, tick_us)
    if call.pump != decided.pump:
        return "pump (of 65535)", call.pump, decided.pump
    if call.dump != decided.dump:
        return "dump valve", call.dump, decided.dump
    return _sent_difference(call.sent, decided.sent)


def _sent_difference(recorded: bytes, replayed: bytes) -> Found | None:
    if recorded == replayed:
        return None
    for ours, theirs in zip_longest(_pieces(recorded), _pieces(replayed)):
        if ours == theirs:
            continue
        found = _frame_difference(ours, theirs)
        if found:
            return found
    return None


def _pieces(sent: bytes) -> Iterator[bytes]:
    """The frames, without delimiters."""
    return (piece for piece in sent.split(b"\0") if piece)


def _frame_difference(recorded: bytes | None, replayed: bytes | None) -> Found | None:
    one, other = _message(recorded), _message(replayed)
    if one is None or other is None or one[:2] != other[:2]:
        return "message sent", _called(one, recorded), _called(other, replayed)
    name = name_of(one[0])
    left_out = False
    for field in one[2]:
        if one[2][field] != other[2].get(field):
            if (one[0], field) not in NOT_COMPARED:
                return f"{name}.{field}", one[2][field], other[2].get(field)
            left_out = True
    if one[2].keys() != other[2].keys():
        return f"{name}, repeated fields", len(one[2]), len(other[2])
    assert recorded is not None
    assert replayed is not None
    at = next((k for k, pair in enumerate(zip(recorded, replayed, strict=False)) if pair[0] != pair[1]), len(recorded))
    return None if left_out else (f"byte {at} of the frame of {name}", recorded.hex(), replayed.hex())


def _message(piece: bytes | None) -> tuple[int, int, dict[str, Any]] | None:
    """Id, sequence number and fields of a frame, repeated ones with their place; None for what is no message of ours."""
    content = uncover(piece) if piece else None
    codec = BY_ID.get(content[0]) if content else None
    if content is None or codec is None:
        return None
    values = codec.unpack(content, len(content) - HEADER - CRC)
    if values is None:
        return None
    fields: dict[str, Any] = dict(values[0])
    for name, column in values[1].items():
        fields |= {f"{name}[{place}]": value for place, value in enumerate(column.tolist())}
    return content[0], content[1] | content[2] << 8, fields


def _called(message: tuple[int, int, dict[str, Any]] | None, piece: bytes | None) -> str:
    if piece is None:
        return "none"
    return f"{name_of(message[0])} {message[1]}" if message else f"bytes {piece.hex()}"
