"""The device's end of the link: understands requests, checks them, answers each once, sends telemetry.

It trusts nobody: lengths, limits and counts are checked here whatever the host has checked. It holds no
buffer that grows and allocates nothing in steady state.
"""

from array import array

from bubble_firmware import delivery
from bubble_firmware.care import Care
from bubble_firmware.requests import NO_ELEMENT, Requests
from bubble_firmware.telemetry import Telemetry
from bubble_protocol import codec, framing, messages
from bubble_protocol.crc import crc32_into, crc32_on
from bubble_protocol.portable import const, heap_free
from bubble_protocol.version import FIRMWARE, PROTOCOL_MAX, PROTOCOL_MIN

_CHUNK = 256  # bytes taken from the link in one tick
_PAYLOAD_AT = framing.Decoder.PAYLOAD_AT
_BUDGET = 2  # requests handled in one tick, of nearly 1 ms each on the chip; one that takes long is worth as many
_HELLO = const(0x01)
_PING = const(0x02)
_STOP = const(0x0B)
_VENT = const(0x0C)


class Session(Requests):
    """Requests in, replies and telemetry out, for one `App`."""

    def __init__(self, app):
        self._app = app
        self._delivery = delivery.Delivery(app.hands.boot_id & 0xFFFFFFFF)
        self._decoder = framing.Decoder(crc32_into, self._delivery.key)
        self._chunk = bytearray(_CHUNK)
        self._frame = bytearray(framing.FRAME_MAX)  # what is sent and not kept
        self._values = array("i", bytearray(4 * framing.PAYLOAD_MAX))
        self._handling = 0  # id of the request being handled; 0 once it is answered
        self._sequence = 0  # its number
        self._ordered = False  # whether its reply is kept
        self._budget = 0
        self._owed = 0  # how many of the last replies have found no room yet
        self._telemetry = Telemetry(app)
        self.heard = 0  # frames of the open session since boot, modulo 65536: the host is alive
        self.capabilities = messages.DELIVERY | messages.SAFETY | messages.CAN_CHOOSE_TELEMETRY
        self._heap_free = heap_free()
        crc = array("i", (0,))
        for line in codec.schema_lines():
            crc32_on(line, 0, len(line), crc)
        self._schema_crc = crc[0]
        self._name = (app.board.NAME.encode() + bytes(16))[:16]  # bytes: a letter of a string can be an allocation
        boot_id = app.hands.boot_id & 0xFFFFFFFF
        self._boot_id = boot_id - (boot_id >> 31 << 32)  # the same 32 bits as a signed word
        self._requests = self._handlers()
        self._requests[messages.HELLO] = self._hello
        self._requests[messages.SUBSCRIBE] = self._subscribe
        self._requests[messages.SUBSCRIBE_FIELDS] = self._subscribe_fields
        self._slow = {messages.TABLE_WRITE, messages.TABLE_COMMIT, messages.TABLE_READ, messages.TICKS}
        self.serve(Care(app, self).handlers())

    def serve(self, handlers):
        """Let others handle requests: functions of the count of repetitions, by message id."""
        self._requests.update(handlers)

    def poll(self):
        """Once a tick: handle what has come; send telemetry when it is due."""
        self.listen()
        if self._telemetry.is_due():
            self._tell()

    def listen(self):
        """Handle what has come."""
        if self._owed:
            self._pay()
        chunk = self._chunk
        decoder = self._decoder
        kept = self._delivery
        self._budget = _BUDGET
        end = self._app.hands.receive(chunk)
        at = 0
        while at < end:
            at = decoder.feed(chunk, at, end)
            if decoder.length:
                self._arrive(decoder.message_id, decoder.sequence)
        while kept.early and self._budget > 0:
            length = kept.waiting()
            if not length:
                break
            self._apply(kept.slot(), length)

    def send_unasked(self, message_id, sequence, count):
        """Send the message whose fields stand in `_values`; whether there was room."""
        if self._owed:  # a reply comes first
            return False
        return self._app.hands.send(self._frame, self._pack(self._frame, message_id, sequence, count))

    def fail(self):
        """Tell the host whose request was being handled that the device failed at it: once, if the link still works."""
        if self._handling:
            try:
                self._refuse(messages.FAULTED, 0, NO_ELEMENT, 0, 0, 0)
            except Exception:
                pass
            self._handling = 0

    # Whose turn it is.

    def _arrive(self, message_id, sequence):
        """A frame stands in the decoder. HELLO and PING know no order, STOP and VENT overtake it."""
        decoder = self._decoder
        kept = self._delivery
        if message_id == _HELLO:
            self._answer_aside(message_id, sequence)
            return
        self.heard = (self.heard + 1) & 0xFFFF
        if message_id == _PING:
            self._answer_aside(message_id, sequence)
            return
        ahead = (sequence - kept.expected) & 0xFFFF
        if ahead >= 0x10000 - delivery.KEPT:
            self._answer_again(message_id, sequence)
        elif ahead < delivery.KEPT and (message_id == _STOP or message_id == _VENT):
            if self._owed:
                self._owed += ahead
            while ahead:
                kept.advance()
                ahead -= 1
            self._apply(decoder.frame, decoder.length)
        elif ahead == 0 and self._budget > 0:
            self._apply(decoder.frame, decoder.length)
        elif ahead < delivery.WINDOW:
            kept.keep(sequence, decoder.frame, decoder.length)

    def _apply(self, frame, length):
        """Handle the request whose turn it is."""
        message_id = frame[1]
        self._budget -= _BUDGET if message_id in self._slow else 1
        self._sequence = self._delivery.expected
        self._delivery.advance()
        self._ordered = True
        self._handle(message_id, frame, length - framing.HEADER)

    def _answer_aside(self, message_id, sequence):
        decoder = self._decoder
        self._sequence = sequence
        self._ordered = False
        self._handle(message_id, decoder.frame, decoder.length - framing.HEADER)

    def _answer_again(self, message_id, sequence):
        """A request that has had its turn: its reply once more, or that it was overtaken."""
        kept = self._delivery
        place = sequence % delivery.KEPT
        if kept.lengths[place]:
            self._app.hands.send(kept.replies[place], kept.lengths[place])
        else:
            self._handling = message_id
            self._sequence = sequence
            self._ordered = False
            self._refuse(messages.OVERTAKEN, 0, NO_ELEMENT, 0, 0, 0)

    # Whether it can be meant.

    def _handle(self, message_id, frame, size):
        self._handling = message_id
        self._app.heard()
        handler = self._requests.get(message_id)
        if handler is None:
            self._refuse(messages.UNKNOWN_MESSAGE, 0, NO_ELEMENT, message_id, 0, 0)
            return
        message = codec.BY_ID[message_id]
        count = message.unpack(frame, _PAYLOAD_AT, size, self._values)
        if count < 0:
            self._refuse(messages.WRONG_LENGTH, 0, NO_ELEMENT, size, message.least, framing.PAYLOAD_MAX)
        elif self._within_limits(message, count):
            handler(count)
        self._handling = 0

    def _within_limits(self, message, count):
        """Whether all values are within the schema's limits; refuses where one is not."""
        at = message.outside(self._values, count)
        if at < 0:
            return True
        fixed = len(message.fixed)
        number = at
        element = NO_ELEMENT
        if at >= fixed:
            number = fixed + (at - fixed) % message.stride_values
            element = (at - fixed) // message.stride_values
        field = (message.fixed + message.repeated)[number]
        low = field[3]
        high = field[4]
        self._refuse(
            messages.OUT_OF_RANGE, number, element, self._values[at], low or 0, 65535 if high is None else high
        )
        return False

    # The link's own requests; the others are in `requests`.

    def _hello(self, count):
        values = self._values
        board = self._app.board
        if values[0] > PROTOCOL_MAX or values[1] < PROTOCOL_MIN:
            self._refuse(messages.NO_COMMON_PROTOCOL, 1, NO_ELEMENT, values[1], PROTOCOL_MIN, PROTOCOL_MAX)
            return
        opened = self._delivery.open(self._decoder.frame, _PAYLOAD_AT + 2)
        if opened == delivery.NO_SESSION:
            self._refuse(messages.OUT_OF_RANGE, 2, NO_ELEMENT, 0, 1, 0x3FFFFFFF)
            return
        if opened == delivery.STALE:
            self._refuse(messages.OVERTAKEN, 2, NO_ELEMENT, 0, 0, 0)
            return
        if opened == delivery.OPENED:
            self._owed = 0
            self._telemetry.subscribe(0, 0)  # a new host has not subscribed
        self.heard = (self.heard + 1) & 0xFFFF
        values[0] = PROTOCOL_MIN
        values[1] = PROTOCOL_MAX
        values[2] = self._schema_crc
        values[3] = self._boot_id
        values[4], values[5], values[6] = FIRMWARE
        for index in range(16):
            values[7 + index] = self._name[index]
        values[23] = board.BUBBLES
        values[24] = board.TICK_US
        values[25] = board.HEIGHT_REST_UM
        values[26] = board.HEIGHT_MAX_UM
        values[27] = board.PRESSURE_MAX_PA
        values[28] = delivery.WINDOW
        values[29] = self.capabilities
        values[30] = self._app.tables.crc
        self._reply(0)

    def _subscribe(self, count):
        self._telemetry.subscribe(self._values[0], 0)
        self._acknowledge()

    def _subscribe_fields(self, count):
        telemetry = self._telemetry
        if telemetry.subscribe(self._values[0], self._values[1]):
            self._acknowledge()
        else:  # the limit is one of how many, not of which
            self._refuse(messages.OUT_OF_RANGE, 1, NO_ELEMENT, self._values[1], 1, (1 << telemetry.most) - 1)

    # Sending.

    def _acknowledge(self):
        self._values[0] = self._app.ticks
        self._reply(0)

    def _reply(self, count):
        self._send(self._handling | messages.REPLY, count)

    def _refuse(self, error, field, element, asked, low, high):
        values = self._values
        values[0] = self._handling
        values[1] = error
        values[2] = field
        values[3] = element
        values[4] = asked
        values[5] = low
        values[6] = high
        self._send(messages.ERROR, 0)

    def _send(self, message_id, count):
        """Answer the request being handled, and keep the answer of one that has a turn."""
        self._handling = 0
        if self._ordered:
            kept = self._delivery
            place = self._sequence % delivery.KEPT
            kept.lengths[place] = self._pack(kept.replies[place], message_id, self._sequence, count)
            self._owed += 1
            self._pay()
        else:
            self._app.hands.send(self._frame, self._pack(self._frame, message_id, self._sequence, count))

    def _pay(self):
        """Send the replies that are owed, in order, as far as there is room."""
        kept = self._delivery
        if self._owed > delivery.KEPT:
            self._owed = delivery.KEPT
        while self._owed:
            place = (kept.expected - self._owed) % delivery.KEPT
            if kept.lengths[place] and not self._app.hands.send(kept.replies[place], kept.lengths[place]):
                return
            self._owed -= 1

    def _tell(self):
        telemetry = self._telemetry
        if self._owed:  # a reply comes first
            telemetry.drop()
            return
        length = self._pack(self._frame, telemetry.message_id, telemetry.sequence, telemetry.fill(self._values))
        if not self._app.hands.send(self._frame, length):
            telemetry.drop()

    def _pack(self, frame, message_id, sequence, count):
        end = codec.BY_ID[message_id].pack(self._values, count, frame, _PAYLOAD_AT)
        framing.put_header(frame, message_id, sequence)
        return framing.seal(frame, end - 1, crc32_into, self._delivery.key)
