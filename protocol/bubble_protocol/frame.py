# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""Frames on the wire: COBS around (id, sequence number, payload, CRC-32), one 0x00 after each.

    | 1      | 1  | 2        | 0..247  | 4      | 1    |
    | COBS   | id | sequence | payload | CRC-32 | 0x00 |

The CRC is XORed with a key that both ends know, so that frames of another session are no frames here; those
about HELLO are not, because they are how the key is agreed on.

Nine bytes around a payload. The content (id to CRC) is at most 254 bytes, so a COBS block is never split
and both directions work in place and touch only the zeros (Cheshire and Baker, 1999).

Nothing here allocates once made, reads a clock or does I/O. `crc32_into(buffer, start, end, out, at)` is
the caller's: crcmod on the host, `bubble_protocol.crc` on the device.
"""

from bubble_protocol.mpy_compat import COMPILED, const, micropython, ptr8

HEADER = 3  # id, sequence number
CRC = 4
CONTENT_MAX = 254
PAYLOAD_MAX = CONTENT_MAX - HEADER - CRC
FRAME_MAX = CONTENT_MAX + 2  # with the COBS byte and the delimiter
OVERHEAD = FRAME_MAX - PAYLOAD_MAX

NO_KEY = bytes(CRC)

_ZERO = b"\x00"
_HELLO = const(0x01)
_HELLO_REPLY = const(0x81)
_ERROR = const(0x7F)
_SHORTEST = 1 + HEADER + CRC  # without the delimiter


@micropython.viper
def _mix(frame: ptr8, end: int, key: ptr8):
    """Mix the key into the CRC before `end`, where the frame has one; a zero at `end`."""
    what = frame[1]
    if not (what == _HELLO or what == _HELLO_REPLY or (what == _ERROR and frame[4] == _HELLO)):
        frame[end - 4] ^= key[0]
        frame[end - 3] ^= key[1]
        frame[end - 2] ^= key[2]
        frame[end - 1] ^= key[3]
    frame[end] = 0


@micropython.viper
def _stuff(frame: ptr8, end: int):
    """Put the distance to the next zero in place of every zero of `frame[0:end]`; one stands at `end`."""
    at = 0
    i = 1
    while i <= end:
        if frame[i] == 0:
            frame[at] = i - at
            at = i
        i += 1


@micropython.viper
def _unstuff(frame: ptr8, used: int) -> int:
    """Walk from zero to zero and put them back; whether the walk ends where the frame does."""
    at = 0
    while at < used:
        step = frame[at]
        frame[at] = 0
        at += step
    return 1 if at == used else 0


@micropython.viper
def _matches(frame: ptr8, at: int, crc: ptr8, key: ptr8) -> int:
    """Whether `crc`, with the key where there is one, stands at `frame[at:]`."""
    what = frame[1]
    if what == _HELLO or what == _HELLO_REPLY or (what == _ERROR and frame[4] == _HELLO):
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


@micropython.viper
def copy(source: ptr8, start: int, end: int, target: ptr8, at: int):
    """`target[at:] = source[start:end]`, without slices."""
    while start < end:
        target[at] = source[start]
        at += 1
        start += 1


if not COMPILED:  # CPython loops over bytes slowly, but splits, joins and slices in C
    _DISTANCES = [bytes((distance,)) for distance in range(1, 256)]

    def _stuff(frame, end):
        frame[:end] = b"".join([_DISTANCES[len(run)] + run for run in frame[1:end].split(_ZERO)])

    def copy(source, start, end, target, at):
        """As above."""
        target[at : at + end - start] = source[start:end]


def finish_frame(frame, length, crc32_into, key=NO_KEY):
    """Finish the frame whose id, sequence number and payload stand at `frame[1:1 + length]`.

    `frame` is a bytearray of FRAME_MAX bytes. Returns the length of the finished frame, delimiter included.
    """
    end = 1 + length + CRC
    crc32_into(frame, 1, 1 + length, frame, 1 + length)
    _mix(frame, end, key)
    _stuff(frame, end)
    return end + 1


def put_header(frame, message_id, sequence):
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

    def __init__(self, crc32_into, key=NO_KEY):
        self.key = key
        self.frame = bytearray(FRAME_MAX)
        self.length = 0
        self.good = 0
        self.bad = 0
        self._used = 0  # bytes of the frame so far; more than fit means too long
        self._crc = bytearray(CRC)
        self._crc32_into = crc32_into

    @property
    def message_id(self):
        """The id of the frame just completed."""
        return self.frame[1]

    @property
    def sequence(self):
        """The sequence number of the frame just completed."""
        return self.frame[2] | self.frame[3] << 8

    def reset(self):
        """Forget a frame begun, as after a reconnect."""
        self.length = self._used = 0

    def feed(self, data, start, end):
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

    def _is_good(self, used):
        if used < _SHORTEST or used >= FRAME_MAX:
            return False
        frame = self.frame
        if not _unstuff(frame, used):
            return False
        crc = self._crc
        crc_at = used - CRC
        self._crc32_into(frame, 1, crc_at, crc, 0)
        return _matches(frame, crc_at, crc, self.key)
