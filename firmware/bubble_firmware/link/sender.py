"""What goes out: messages into frames, and the replies that are kept until there has been room for them."""

from array import array

from bubble_protocol import packing
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, PAYLOAD_MAX, Decoder, finish_frame, put_header
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from bubble_firmware.hal.base import Hal
    from bubble_firmware.link.receive_window import ReceiveWindow

# [constants] bubble_protocol.schema.system: REPLIES_KEPT
_REPLIES_KEPT = const(16)
# [end of constants]

_PAYLOAD_AT = Decoder.PAYLOAD_AT


class Sender:
    """Sends the message whose fields stand in `values`. `unsent`: how many of the last replies have found no room yet."""

    def __init__(self, hal: "Hal", window: "ReceiveWindow"):
        self.values = array("i", bytearray(4 * PAYLOAD_MAX))
        self.unsent = 0
        self._hal = hal
        self._window = window
        self._frame = bytearray(FRAME_MAX)  # what is sent and not kept

    def send(self, message_id: int, number: int, count: int) -> bool:
        """Send a message with `count` repetitions. False where there was no room for it: it is lost."""
        frame = self._frame
        return self._hal.send(frame, self._pack(frame, message_id, number, count))

    def send_unasked(self, message_id: int, number: int, count: int) -> bool:
        """The same, but replies come first: False where some are unsent."""
        return not self.unsent and self.send(message_id, number, count)

    def answer(self, message_id: int, number: int, count: int) -> None:
        """Reply to the request that has just had its turn: the reply is kept, and sent as soon as there is room."""
        window = self._window
        place = number % _REPLIES_KEPT
        window.lengths[place] = self._pack(window.replies[place], message_id, number, count)
        self.unsent += 1
        self.flush()

    def repeat(self, number: int) -> bool:
        """Send the reply to a request once more. False where it never had one."""
        window = self._window
        place = number % _REPLIES_KEPT
        if not window.lengths[place]:
            return False
        self._hal.send(window.replies[place], window.lengths[place])
        return True

    def flush(self) -> None:
        """Send the replies that are unsent, in order, as far as there is room."""
        window = self._window
        if self.unsent > _REPLIES_KEPT:
            self.unsent = _REPLIES_KEPT
        while self.unsent:
            place = (window.expected - self.unsent) % _REPLIES_KEPT
            if window.lengths[place] and not self._hal.send(window.replies[place], window.lengths[place]):
                return
            self.unsent -= 1

    def _pack(self, frame: bytearray, message_id: int, number: int, count: int) -> int:
        end = packing.BY_ID[message_id].pack(self.values, count, frame, _PAYLOAD_AT)
        put_header(frame, message_id, number)
        return finish_frame(frame, end - 1, crc32_into, self._window.key)
