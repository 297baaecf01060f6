"""Frames made and found as whole byte strings, which CPython is fast at. No I/O, no clock.

`bubble_protocol.frame` is what the device runs: in place, byte by byte, without allocating. A test holds both against
each other, byte for byte.
"""

from collections.abc import Iterator

import crcmod.predefined

from bubble_protocol.frame import CONTENT_MAX, CRC, FRAME_MAX, HEADER
from bubble_protocol.schema import messages

_DELIMITER = b"\0"
_DISTANCES = bytes(range(1, 256)) + _DELIMITER
"""To the next zero, by the bytes in between."""
FRAME_CONTENT = CONTENT_MAX - CRC
"""Bytes of id, sequence number and payload in a frame at most."""
_SHORTEST = 1 + HEADER + CRC
_ABOUT_HELLO = (messages.HELLO, messages.HELLO | messages.REPLY)
_REQUEST_AT = HEADER  # in the content of an ERROR: the message that it refuses

_crc32 = crcmod.predefined.mkPredefinedCrcFun("crc-32")


def crc32(data: bytes | bytearray | memoryview) -> int:
    """CRC-32 as in zlib, by crcmod."""
    return _crc32(data)


def enclose(content: bytes, key: bytes) -> bytes:
    """The frame around id, sequence number and payload, with the CRC that belongs to the session of `key`."""
    if len(content) > FRAME_CONTENT:
        raise ValueError(f"{len(content) - HEADER} bytes of payload; a frame takes {FRAME_CONTENT - HEADER}")
    crc = _crc32(content)
    if not _is_about_hello(content):
        crc ^= int.from_bytes(key, "little")
    content += crc.to_bytes(CRC, "little")
    frame = bytearray(_DELIMITER + content + _DELIMITER)
    at = 0
    for distance in bytes(map(len, content.split(_DELIMITER))).translate(_DISTANCES):
        frame[at] = distance
        at += distance
    return bytes(frame)


def _is_about_hello(content: bytes | bytearray) -> bool:
    """Whether a frame is sealed without a key: HELLO is how the key is agreed on."""
    message_id = content[0]
    return message_id in _ABOUT_HELLO or (message_id == messages.ERROR and content[_REQUEST_AT] == messages.HELLO)


def uncover(piece: bytes) -> bytearray | None:
    """Id, sequence number, payload and CRC of a frame without its delimiter, whatever its CRC; None where it is none."""
    used = len(piece)
    if used < _SHORTEST or used >= FRAME_MAX:
        return None
    content = bytearray(piece)
    at = 0
    while at < used:
        step = piece[at]
        content[at] = 0
        at += step
    if at != used:
        return None
    del content[0]
    return content


class FrameFinder:
    """Finds the frames of one session in a byte stream; survives any bytes.

    `key` may be changed at any time, also between two frames of one `feed`. `bad` counts frames that were none.
    """

    def __init__(self, key: bytes):
        self.key = key
        self.bad = 0
        self.noise = b""
        """What stood between the last two delimiters that was no frame."""
        self._begun = b""  # of a frame; more than fit means too long

    @property
    def key(self) -> bytes:
        """Of the session whose frames are found."""
        return self._key

    @key.setter
    def key(self, key: bytes) -> None:
        self._key = key
        # The CRC over content and CRC is the same for all contents: that over the key, of an empty content.
        self._residue = _crc32(key)

    def reset(self) -> None:
        """Forget a frame begun, as after a reconnect."""
        self._begun = b""

    def feed(self, data: bytes) -> Iterator[bytearray]:
        """Id, sequence number, payload and CRC of each frame that `data` completes."""
        pieces = data.split(_DELIMITER)
        if self._begun:
            pieces[0] = self._begun + pieces[0]
        self._begun = pieces.pop()[:FRAME_MAX]
        for piece in pieces:
            if not piece:  # a delimiter alone is a way to say: start afresh
                continue
            content = self._open(piece)
            if content:
                yield content
            else:
                self.bad += 1
                self.noise = piece

    def _open(self, piece: bytes) -> bytearray | None:
        """What stands in a frame without its delimiter."""
        content = uncover(piece)
        if content is None:
            return None
        residue = _crc32(content)
        if residue == self._residue if not _is_about_hello(content) else residue == _UNKEYED:
            return content
        return None


_UNKEYED = _crc32(bytes(CRC))
