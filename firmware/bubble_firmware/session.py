"""The device's end of the link: understands requests, checks them, answers each once, sends telemetry.

It trusts nobody: lengths, limits and counts are checked here whatever the host has checked. It holds no
buffer that grows and allocates nothing in steady state.
"""

from array import array

from bubble_firmware import control
from bubble_firmware.care import Care
from bubble_firmware.table import KNOTS_MAX
from bubble_firmware.ticks import BINS
from bubble_protocol import codec, framing, messages
from bubble_protocol.crc import crc32_into, crc32_word
from bubble_protocol.messages import IDLE
from bubble_protocol.portable import heap_free
from bubble_protocol.version import FIRMWARE, PROTOCOL_MAX, PROTOCOL_MIN

_CHUNK = 256  # bytes taken from the link in one tick
_KNOTS_PER_MESSAGE = 48
_NO_ELEMENT = 255


class Session:
    """Requests in, replies and telemetry out, for one `App`."""

    def __init__(self, app):
        self._app = app
        self._decoder = framing.Decoder(crc32_into)
        self._chunk = bytearray(_CHUNK)
        self._frame = bytearray(framing.FRAME_MAX)
        self._values = array("i", bytearray(4 * framing.PAYLOAD_MAX))
        self._handling = 0  # id of the request being handled
        self._period = 0  # telemetry, ticks; 0: none
        self._wait = 0
        self._telemetry_sequence = 0
        self._owed = 0  # length of a reply in `_frame` that found no room
        self.telemetry_dropped = 0
        self._heap_free = heap_free()
        schema = codec.schema_bytes()
        self._schema_crc = crc32_word(schema, 0, len(schema))
        self._name = (app.board.NAME.encode() + bytes(16))[:16]  # bytes: a letter of a string can be an allocation
        boot_id = app.hands.boot_id & 0xFFFFFFFF
        self._boot_id = boot_id - (boot_id >> 31 << 32)  # the same 32 bits as a signed word
        self._requests = {
            messages.HELLO: self._hello,
            messages.PING: self._ping,
            messages.INFO: self._info,
            messages.SHOW: self._show,
            messages.STATE: self._state,
            messages.SUBSCRIBE: self._subscribe,
            messages.TABLE_WRITE: self._table_write,
            messages.TABLE_COMMIT: self._table_commit,
            messages.TABLE_READ: self._table_read,
            messages.STOP: self._stop,
            messages.VENT: self._vent,
            messages.CLEAR: self._clear,
            messages.TICKS: self._ticks,
            messages.RESTART: self._restart,
        }
        self._requests.update(Care(app, self).handlers())

    def poll(self):
        """Handle what has come since the last tick; send telemetry when it is due."""
        if self._owed and self._app.hands.send(self._frame, self._owed):
            self._owed = 0
        chunk = self._chunk
        decoder = self._decoder
        end = self._app.hands.receive(chunk)
        at = 0
        while at < end:
            at = decoder.feed(chunk, at, end)
            if decoder.length:
                self._handle(decoder.message_id, decoder.length - framing.HEADER)
        if self._period:
            self._wait -= 1
            if self._wait <= 0:
                self._wait = self._period
                self._telemetry()

    def fail(self):
        """Tell the host whose request was being handled that the device failed at it: once, if the link still works."""
        if self._handling:
            try:
                self._refuse(messages.FAULTED, 0, _NO_ELEMENT, 0, 0, 0)
            except Exception:
                pass
            self._handling = 0

    def _handle(self, message_id, size):
        self._handling = message_id
        self._app.heard()
        handler = self._requests.get(message_id)
        if handler is None:
            self._refuse(messages.UNKNOWN_MESSAGE, 0, _NO_ELEMENT, message_id, 0, 0)
        else:
            message = codec.BY_ID[message_id]
            count = message.unpack(self._decoder.frame, framing.Decoder.PAYLOAD_AT, size, self._values)
            if count < 0:
                most = framing.PAYLOAD_MAX if message.stride else message.fixed_size
                self._refuse(messages.WRONG_LENGTH, 0, _NO_ELEMENT, size, message.fixed_size, most)
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
        element = _NO_ELEMENT
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

    # Requests. Each handler answers once; `self._values` holds the request's fields, then the reply's.

    def _hello(self, count):
        values = self._values
        board = self._app.board
        if values[0] > PROTOCOL_MAX or values[1] < PROTOCOL_MIN:
            self._refuse(messages.NO_COMMON_PROTOCOL, 1, _NO_ELEMENT, values[1], PROTOCOL_MIN, PROTOCOL_MAX)
            return
        self._period = 0  # a new host has not subscribed
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
        values[28] = 1  # one request at a time
        values[29] = 2  # safety
        values[30] = self._app.tables.crc
        self._reply(0)

    def _ping(self, count):
        self._values[1] = self._app.ticks
        self._values[2] = self._app.hands.phase_us()
        self._reply(0)

    def _info(self, count):
        app = self._app
        values = self._values
        values[0] = app.ticks
        values[1] = app.hands.late_ticks
        values[2] = app.tick_worst_us
        values[3] = app.exceptions
        values[4] = self._decoder.good
        values[5] = self._decoder.bad
        values[6] = self.telemetry_dropped
        if app.mode == IDLE:  # counting takes longer than a tick
            app.hands.slack()
            self._heap_free = heap_free()
        values[7] = self._heap_free
        values[8] = app.supply.pressure_pa
        values[9] = app.tables.crc
        values[10] = app.mode
        values[11] = app.faults
        test = app.self_test
        values[12] = test.outcome
        values[13] = test.untrue_zero
        values[14] = test.unfilled
        values[15] = test.unvented
        self._reply(0)

    def _show(self, count):
        values = self._values
        board = self._app.board
        if count != board.BUBBLES:
            self._refuse(messages.WRONG_COUNT, 1, _NO_ELEMENT, count, board.BUBBLES, board.BUBBLES)
            return
        if self._app.faults & messages.VENTING:
            self._refuse(messages.BOARD_FAULT, 0, _NO_ELEMENT, self._app.faults, 0, 0)
            return
        high = control.first_above(values, 1, 1 + count, board.HEIGHT_MAX_UM)
        if high >= 0:
            self._refuse(messages.OUT_OF_RANGE, 1, high - 1, values[high], 0, board.HEIGHT_MAX_UM)
            return
        self._app.show(values, 1, values[0])
        self._acknowledge()

    def _state(self, count):
        self._reply(self._fill_state())

    def _subscribe(self, count):
        self._period = self._wait = self._values[0]
        self._telemetry_sequence = 0
        self._acknowledge()

    def _table_write(self, count):
        values = self._values
        bubble = values[0]
        first = values[1]
        total = values[2]
        if not self._is_bubble(bubble):
            return
        if first + count > total:
            self._refuse(messages.OUT_OF_RANGE, 1, _NO_ELEMENT, first, 0, total - count if total > count else 0)
            return
        tables = self._app.tables
        tables.write_size(bubble, total)
        for index in range(count):
            tables.write_knot(bubble, first + index, values[3 + 2 * index], values[4 + 2 * index])
        self._acknowledge()

    def _table_commit(self, count):
        app = self._app
        tables = app.tables
        crc = self._values[0]
        flaw = tables.first_flaw(app.board.HEIGHT_MAX_UM, app.board.PRESSURE_MAX_PA)
        if flaw >= 0:
            self._refuse(messages.BAD_TABLE, 0, flaw // KNOTS_MAX, flaw % KNOTS_MAX, 0, app.board.PRESSURE_MAX_PA)
        elif crc != tables.received_crc():
            self._refuse(messages.BAD_CRC, 0, _NO_ELEMENT, 0, 0, 0)
        else:
            tables.swap()
            app.bubbles.use_tables()
            self._values[0] = tables.crc
            self._reply(0)

    def _table_read(self, count):
        values = self._values
        bubble = values[0]
        first = values[1]
        if not self._is_bubble(bubble):
            return
        tables = self._app.tables
        total = tables.sizes[bubble]
        if first >= total:
            self._refuse(messages.OUT_OF_RANGE, 1, _NO_ELEMENT, first, 0, total - 1)
            return
        count = total - first
        if count > _KNOTS_PER_MESSAGE:
            count = _KNOTS_PER_MESSAGE
        values[2] = total
        for index in range(count):
            tables.read_knot(bubble, first + index, values, 3 + 2 * index)
        self._reply(count)

    def _stop(self, count):
        self._app.stop()
        self._acknowledge()

    def _vent(self, count):
        self._app.vent()
        self._acknowledge()

    def _clear(self, count):
        self._app.clear()
        self._acknowledge()

    def _ticks(self, count):
        app = self._app
        values = self._values
        values[0] = app.work_us
        values[1] = app.delay_us
        for index in range(BINS):
            values[2 + 2 * index] = app.worked[index]
            values[3 + 2 * index] = app.delayed[index]
        self._reply(BINS)

    def _restart(self, count):
        into = self._values[0]
        self._acknowledge()
        self._app.restart(into)

    # Sending.

    def _is_bubble(self, bubble):
        if bubble < self._app.board.BUBBLES:
            return True
        self._refuse(messages.OUT_OF_RANGE, 0, _NO_ELEMENT, bubble, 0, self._app.board.BUBBLES - 1)
        return False

    def _fill_state(self):
        self._values[0] = self._app.ticks
        self._values[1] = self._app.mode
        self._app.bubbles.report(self._values, 2)
        return self._app.board.BUBBLES

    def _acknowledge(self):
        self._values[0] = self._app.ticks
        self._reply(0)

    def _reply(self, count):
        self._send(self._handling | messages.REPLY, self._decoder.sequence, count)

    def _refuse(self, error, field, element, asked, low, high):
        values = self._values
        values[0] = self._handling
        values[1] = error
        values[2] = field
        values[3] = element
        values[4] = asked
        values[5] = low
        values[6] = high
        self._send(messages.ERROR, self._decoder.sequence, 0)

    def _telemetry(self):
        self._telemetry_sequence = (self._telemetry_sequence + 1) & 0xFFFF
        if self._owed:  # a reply comes first, and stands in the frame
            self.telemetry_dropped += 1
            return
        length = self._pack(messages.TELEMETRY, self._telemetry_sequence, self._fill_state())
        if not self._app.hands.send(self._frame, length):
            self.telemetry_dropped += 1

    def _send(self, message_id, sequence, count):
        length = self._pack(message_id, sequence, count)
        self._owed = 0 if self._app.hands.send(self._frame, length) else length

    def _pack(self, message_id, sequence, count):
        frame = self._frame
        end = codec.BY_ID[message_id].pack(self._values, count, frame, framing.Decoder.PAYLOAD_AT)
        framing.put_header(frame, message_id, sequence)
        return framing.seal(frame, end - 1, crc32_into)
