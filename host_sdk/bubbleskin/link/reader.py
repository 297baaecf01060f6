"""From the bytes that come over a link to messages. No I/O, no clock."""

from collections.abc import Iterator

from bubble_protocol.frame import CRC, HEADER, NO_KEY
from bubbleskin.link.framing import FrameFinder
from bubbleskin.link.message import Message
from bubbleskin.link.struct_codec import BY_ID

_BESIDE = HEADER + CRC


class Reader:
    """Bytes in, messages out. What is not a message of this protocol, or of the session of `key`, is dropped and counted."""

    def __init__(self, key: bytes = NO_KEY) -> None:
        self._frames = FrameFinder(key)
        self.unknown = 0
        """Frames dropped because this side does not know their message."""
        self.frame_size = 0
        """Bytes of the frame just completed, as they came over the link."""

    def use(self, key: bytes) -> None:
        """Understand the frames of the session of `key` from now on."""
        self._frames.key = key

    def reset(self) -> None:
        """Forget a frame begun, as after a reconnect."""
        self._frames.reset()

    @property
    def bad(self) -> int:
        """Frames dropped: CRC, COBS, length, or a message that this side does not know."""
        return self._frames.bad + self.unknown

    @property
    def said(self) -> str:
        """The last text that came instead of a frame; empty where there was none, or it is no text."""
        text = self._frames.noise.decode("ascii", "replace").strip()
        return text if text.isprintable() and "\ufffd" not in text else ""

    def feed(self, data: bytes) -> Iterator[Message]:
        """The messages completed by `data`."""
        for content in self._frames.feed(data):
            self.frame_size = len(content) + 2  # with COBS byte and delimiter
            struct_codec = BY_ID.get(content[0])
            values = struct_codec and struct_codec.unpack(content, len(content) - _BESIDE)
            if values:
                yield Message(content[0], content[1] | content[2] << 8, *values)
            else:
                self.unknown += 1
