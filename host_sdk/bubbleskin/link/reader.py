"""From the bytes that come over a link to messages. No I/O, no clock."""

from collections.abc import Iterator

from bubble_protocol.frame import HEADER, NO_KEY, OVERHEAD, Decoder
from bubbleskin.link.message import Message, crc32_into
from bubbleskin.link.struct_codec import BY_ID


class Reader:
    """Bytes in, messages out. What is not a message of this protocol, or of the session of `key`, is dropped and counted."""

    def __init__(self, key: bytes = NO_KEY) -> None:
        self._decoder = Decoder(crc32_into, key)
        self.unknown = 0
        """Frames dropped because this side does not know their message."""

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

    @property
    def frame_size(self) -> int:
        """Bytes of the frame just completed, as they came over the link."""
        return self._decoder.length - HEADER + OVERHEAD

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
        struct_codec = BY_ID.get(decoder.message_id)
        if struct_codec is None:
            return None
        message = struct_codec.message
        size = decoder.length - HEADER
        if not message.stride:
            size = min(size, message.fixed_size)  # fields that newer firmware has appended
        count = message.count(size)
        if count < 0:
            return None
        fields, columns = struct_codec.unpack(decoder.frame, Decoder.PAYLOAD_AT, count)
        return Message(decoder.message_id, decoder.sequence, fields, columns)
