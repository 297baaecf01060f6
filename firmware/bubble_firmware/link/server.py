"""The device's end of the link: finds requests in bytes, sees to their order, checks them and calls their handlers.

It trusts nobody: lengths, limits and counts are checked here whatever the host has checked. It holds no
buffer that grows and allocates nothing in steady state.
"""

from bubble_firmware.link.receive_window import ReceiveWindow
from bubble_firmware.link.reply import Reply
from bubble_firmware.link.sender import Sender
from bubble_firmware.link.telemetry import Telemetry
from bubble_protocol import packing
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import HEADER, PAYLOAD_MAX, Decoder
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.hal.base import Hal
    from bubble_firmware.link.reply import Handlers

# [constants] bubble_protocol.schema.messages: HELLO PING STOP VENT
# [constants] bubble_protocol.schema.errors: FAULTED NO_ELEMENT OUT_OF_RANGE OVERTAKEN UNKNOWN_MESSAGE WRONG_LENGTH
# [constants] bubble_protocol.schema.system: REPLIES_KEPT
# [constants] bubble_firmware.link.receive_window: OPENED SAME WINDOW
_HELLO = const(1)
_PING = const(2)
_STOP = const(11)
_VENT = const(12)
_FAULTED = const(8)
_NO_ELEMENT = const(255)
_OUT_OF_RANGE = const(3)
_OVERTAKEN = const(10)
_UNKNOWN_MESSAGE = const(1)
_WRONG_LENGTH = const(2)
_REPLIES_KEPT = const(16)
_OPENED = const(2)
_SAME = const(0)
_WINDOW = const(8)
# [end of constants]

_CHUNK = const(256)  # bytes taken from the link in one tick
_PAYLOAD_AT = Decoder.PAYLOAD_AT
_BUDGET = const(2)  # requests handled in one tick, of nearly 1 ms each on the chip; one that is slow is worth as many


class Server:
    """Requests in, replies and telemetry out. `register` handlers; call `poll` in every tick.

    `capabilities`: what the handlers registered can do, bits of the schema. `reply` is what handlers answer with, `sender`
    what sends other messages. `decoder` counts frames, `window` knows whose turn it is.
    """

    def __init__(self, board: "ModuleType", hal: "Hal", state: "BoardState", bubbles: "Bubbles"):
        self._hal = hal
        self._deadman = state.deadman
        self.window = ReceiveWindow(hal.boot_id & 0xFFFFFFFF)
        self.decoder = Decoder(crc32_into, self.window.key)
        self.sender = Sender(hal, self.window)
        self.reply = Reply(self.sender, state.clock)
        self.telemetry = Telemetry(board, state, bubbles, self.sender)
        self.capabilities = 0
        self._chunk = bytearray(_CHUNK)
        self._budget = 0
        self._has_session = False
        self._handlers: "dict[int, Callable[[int], None]]" = {}
        self._slow: "set[int]" = set()

    def register(self, handlers: "Handlers") -> None:
        """Let these handle their requests."""
        self._handlers.update(handlers.requests())
        self.capabilities |= handlers.capabilities
        self._slow.update(handlers.slow)

    def poll(self) -> None:
        """Once a tick: handle what has come; send telemetry when it is due."""
        self.listen()
        self.telemetry.tick()

    def listen(self) -> None:
        """Handle what has come."""
        if self.sender.unsent:
            self.sender.flush()
        chunk = self._chunk
        decoder = self.decoder
        window = self.window
        self._budget = _BUDGET
        end = self._hal.receive(chunk)
        at = 0
        while at < end:
            at = decoder.feed(chunk, at, end)
            if decoder.length:
                self.take(decoder.message_id, decoder.sequence)
        while window.early and self._budget > 0:
            length = window.waiting()
            if not length:
                break
            self._handle_next(window.slot(), length)

    def open(self, at: int) -> int:
        """Open the session whose number stands at byte `at` of the frame in the decoder; see `ReceiveWindow.open`."""
        opened = self.window.open(self.decoder.frame, at)
        if opened == _OPENED:
            self._has_session = True
            self.sender.unsent = 0
            self.telemetry.subscribe(0, 0)  # a new host has not subscribed
        if opened == _OPENED or opened == _SAME:
            self._hear()
        return opened

    def fail(self) -> None:
        """Tell the host whose request was being handled that the device failed at it: once, if the link still works."""
        if self.reply.request:
            try:
                self.reply.refuse(_FAULTED, 0, _NO_ELEMENT, 0, 0, 0)
            except Exception:
                pass
            self.reply.request = 0

    # Whose turn it is.

    def _hear(self) -> None:
        """A host that has a session is alive. One that greets in vain, or knows of none, is not: it controls nothing."""
        if self._has_session:
            self._deadman.host_activity()

    def take(self, message_id: int, number: int) -> None:
        """A frame stands in the decoder. HELLO and PING know no order, STOP and VENT overtake it."""
        decoder = self.decoder
        window = self.window
        if message_id == _HELLO or message_id == _PING:
            if message_id == _PING:
                self._hear()
            self.reply.begin(message_id, number, False)
            self._handle(message_id, decoder.frame, decoder.length - HEADER)
            return
        ahead = (number - window.expected) & 0xFFFF
        if ahead >= 0x10000 - _REPLIES_KEPT:
            self._answer_again(message_id, number)
        elif ahead < _REPLIES_KEPT and (message_id == _STOP or message_id == _VENT):
            self._overtake(ahead)
            self._handle_next(decoder.frame, decoder.length)
        elif ahead == 0 and self._budget > 0:
            self._handle_next(decoder.frame, decoder.length)
        elif ahead < _WINDOW:
            window.keep(number, decoder.frame, decoder.length)

    def _overtake(self, requests: int) -> None:
        """So many requests will never be handled, nor answered unless they come again."""
        if self.sender.unsent:
            self.sender.unsent += requests
        while requests:
            self.window.advance()
            requests -= 1

    def _handle_next(self, frame: bytearray, length: int) -> None:
        """Handle the request whose turn it is."""
        message_id = frame[1]
        self._budget -= _BUDGET if message_id in self._slow else 1
        self._hear()
        self.reply.begin(message_id, self.window.expected, True)
        self.window.advance()
        self._handle(message_id, frame, length - HEADER)

    def _answer_again(self, message_id: int, number: int) -> None:
        """A request that has had its turn: its reply once more, or that it was overtaken."""
        if not self.sender.repeat(number):
            self.reply.begin(message_id, number, False)
            self.reply.refuse(_OVERTAKEN, 0, _NO_ELEMENT, 0, 0, 0)

    # Whether it can be meant.

    def _handle(self, message_id: int, frame: bytearray, size: int) -> None:
        reply = self.reply
        handler = self._handlers.get(message_id)
        if handler is None:
            reply.refuse(_UNKNOWN_MESSAGE, 0, _NO_ELEMENT, message_id, 0, 0)
            return
        message = packing.BY_ID[message_id]
        count = message.unpack(frame, _PAYLOAD_AT, size, reply.values)
        if count < 0:
            reply.refuse(_WRONG_LENGTH, 0, _NO_ELEMENT, size, message.size_min, PAYLOAD_MAX)
        elif self._within_limits(message, count):
            handler(count)
        reply.request = 0

    def _within_limits(self, message: "packing.Packer", count: int) -> bool:
        """Whether all values are within the schema's limits; refuses where one is not."""
        values = self.reply.values
        at = message.first_out_of_range(values, count)
        if at < 0:
            return True
        fixed = message.fixed_values
        number = at
        element = _NO_ELEMENT
        if at >= fixed:
            number = fixed + (at - fixed) % message.stride_values
            element = (at - fixed) // message.stride_values
        lows, highs = message.limits or ((), ())
        low = lows[number]
        high = highs[number]
        self.reply.refuse_value(_OUT_OF_RANGE, number, element, at, low or 0, 65535 if high is None else high)
        return False
