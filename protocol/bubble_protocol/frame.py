# mypy: disable-error-code="valid-type,index,operator,arg-type,no-redef"
"""Frames on the wire: COBS around (id, sequence number, payload, CRC-32), one 0x00 after each.

    | 1      | 1  | 2        | 0..247  | 4      | 1    |
    | COBS   | id | sequence | payload | CRC-32 | 0x00 |

The CRC is XORed with a key that both ends know, so that frames of another session are no frames here; those
about HELLO are not, because they are how the key is agreed on.

Nine bytes around a payload. The content (id to CRC) is at most 254 bytes, so a COBS block is never split
and both directions work in place and touch only the zeros (Cheshire and Baker, 1999).

Nothing here allocates once made, reads a clock or does I/O. `crc32_into(buffer, start, end, out, at)` is
the caller's, such as that of `bubble_protocol.crc`.
"""

from bubble_protocol.buffers import copy
from bubble_protocol.mpy_compat import COMPILED, TYPE_CHECKING, const, micropython, ptr8

if TYPE_CHECKING:
    from collections.abc import Callable

    from bubble_protocol.mpy_compat import Buffer

    Crc = Callable[[bytearray, int, int, bytearray, int], None]

HEADER = 3  # id, sequence number
CRC = 4
CONTENT_MAX = 254
PAYLOAD_MAX = CONTENT_MAX - HEADER - CRC
FRAME_MAX = CONTENT_MAX + 2  # with the COBS byte and the delimiter
OVERHEAD = FRAME_MAX - PAYLOAD_MAX

NO_KEY = bytes(CRC)

_ZERO = b"\x00"
# [constants] bubble_protocol.schema.messages: HELLO ERROR REPLY
_HELLO = const(1)
_ERROR = const(127)
_REPLY = const(128)
# [end of constants]
_SHORTEST = 1 + HEADER + CRC  # without the delimiter


@micropython.viper
def _apply_key(frame: ptr8, end: int, key: ptr8):  # type: ignore[no-untyped-def]
    """XOR the key into the CRC before `end`, unless the frame is about HELLO; put a zero at `end`."""
    message_id = frame[1]
    if not (message_id == _HELLO or message_id == (_HELLO | _REPLY) or (message_id == _ERROR and frame[4] == _HELLO)):
        frame[end - 4] ^= key[0]
        frame[end - 3] ^= key[1]
        frame[end - 2] ^= key[2]
        frame[end - 1] ^= key[3]
    frame[end] = 0


@micropython.viper
def _cobs_encode(frame: ptr8, end: int):  # type: ignore[no-untyped-def]
    """Put the distance to the next zero in place of every zero of `frame[0:end]`; one stands at `end`."""
    at = 0
    i = 1
    while i <= end:
        if frame[i] == 0:
            frame[at] = i - at
            at = i
        i += 1


@micropython.viper
def _cobs_decode(frame: ptr8, used: int) -> int:
    """Walk from zero to zero and put them back; whether the walk ends where the frame does."""
    at = 0
    while at < used:
        step = frame[at]
        frame[at] = 0
        at += step
    return 1 if at == used else 0


@micropython.viper
def _has_crc(frame: ptr8, at: int, crc: ptr8, key: ptr8) -> int:
    """Whether `crc` stands at `frame[at:]`, XORed with the key unless the frame is about HELLO."""
    message_id = frame[1]
    if message_id == _HELLO or message_id == (_HELLO | _REPLY) or (message_id == _ERROR and frame[4] == _HELLO):
        i = 0
        while i < 4:
            if frame[at + i] != crc[i]:
                return 0
            i += 1
        return 1
    i = 0
    while i < 4:
        if frame[at + i] != crc[i] ^ key[i]:
            return 0
        i += 1
    return 1


if not COMPILED:  # CPython loops over bytes slowly, but splits and joins in C
    _DISTANCES = [bytes((distance,)) for distance in range(1, 256)]

    def _cobs_encode(frame: bytearray, end: int) -> None:
        frame[:end] = b"".join([_DISTANCES[len(run)] + run for run in frame[1:end].split(_ZERO)])


def finish_frame(frame: bytearray, length: int, crc32_into: "Crc", key: "Buffer" = NO_KEY) -> int:
    """Finish the frame whose id, sequence number and payload stand at `frame[1:1 + length]`.

    `frame` is a bytearray of FRAME_MAX bytes. Returns the length of the finished frame, delimiter included.
    """
    end = 1 + length + CRC
    crc32_into(frame, 1, 1 + length, frame, 1 + length)
    _apply_key(frame, end, key)
    _cobs_encode(frame, end)
    return end + 1


def put_header(frame: bytearray, message_id: int, sequence: int) -> None:
    """Write id and sequence number where `finish_frame` expects them."""
    frame[1] = message_id
    frame[2] = sequence & 255
    frame[3] = sequence >> 8 & 255


class Decoder:
    """Finds frames in a byte stream; survives any bytes.

    Call `feed` until it has taken all bytes. After each call `length` says whether a frame has just been
    completed: then its id stands in `message_id`, its sequence number in `sequence`, and `length` counts
    the bytes of id, sequence number and payload; the payload is `frame[PAYLOAD_AT:1 + length]`, valid until
    the next `feed`. Otherwise `length` is 0. `good` and `bad` count frames. `key` may be changed at any time.
    """

    PAYLOAD_AT = 1 + HEADER

    def __init__(self, crc32_into: "Crc", key: "Buffer" = NO_KEY):
        self.key = key
        self.frame = bytearray(FRAME_MAX)
        self.length = 0
        self.good = 0
        self.bad = 0
        self._used = 0  # bytes of the frame so far; more than fit means too long
        self._crc = bytearray(CRC)
        self._crc32_into = crc32_into

    @property
    def message_id(self) -> int:
        """The id of the frame just completed."""
        return self.frame[1]

    @property
    def sequence(self) -> int:
        """The sequence number of the frame just completed."""
        return self.frame[2] | self.frame[3] << 8

    def reset(self) -> None:
        """Forget a frame begun, as after a reconnect."""
        self.length = self._used = 0

    def feed(self, data: "bytes | bytearray", start: int, end: int) -> int:
        """Take bytes of `data[start:end]` (bytes or bytearray) up to the end of one frame; returns the index after them."""
        self.length = 0
        stop = data.find(_ZERO, start, end)
        last = end if stop < 0 else stop
        used = self._used
        if used + last - start > FRAME_MAX - 1:
            used = FRAME_MAX
        else:
            copy(data, start, last, self.frame, used)
            used += last - start
        if stop < 0:
            self._used = used
            return end
        self._used = 0
        if used:  # a delimiter alone is a way to say: start afresh
            if self._is_good(used):
                self.good += 1
                self.length = used - 1 - CRC
            else:
                self.bad += 1
        return stop + 1

    def _is_good(self, used: int) -> bool:
        if used < _SHORTEST or used >= FRAME_MAX:
            return False
        frame = self.frame
        if not _cobs_decode(frame, used):
            return False
        crc = self._crc
        crc_at = used - CRC
        self._crc32_into(frame, 1, crc_at, crc, 0)
        return bool(_has_crc(frame, crc_at, crc, self.key))
