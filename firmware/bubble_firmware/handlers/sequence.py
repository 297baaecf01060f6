"""Requests about sequences: what is refused and why, and events as they happen. `sequence.Player` does the rest."""

from array import array

from bubble_protocol import steps
from bubble_protocol.crc import crc32_word
from bubble_protocol.schema import errors, faults, messages, sequences, system
from bubble_protocol.schema.sequences import ARMED, EMPTY, ENDED, LOADING, PAUSED, PLAYING

_NO_ELEMENT = 255
_WRITE_HEAD = 4  # bytes of SEQUENCE_WRITE before the words
_WORDS_MAX = 121  # in one SEQUENCE_WRITE


class SequenceRequests:
    """Handlers for `session`, which checks the schema's limits first; each answers once."""

    def __init__(self, app, session):
        self._app = app
        self._player = app.player
        self._session = session
        self._values = session._values
        name = app.board.NAME.encode()
        self._names = array("i", (crc32_word(name, 0, len(name)), 0))
        self._crc = array("i", (0,))
        session.capabilities |= system.CAN_SEQUENCES
        session.serve(
            {
                messages.SEQUENCE_BEGIN: self._begin,
                messages.SEQUENCE_WRITE: self._write,
                messages.SEQUENCE_ARM: self._arm,
                messages.SEQUENCE_START: self._start,
                messages.SEQUENCE_CONTROL: self._control,
                messages.SEQUENCE_STATE: self._state,
            }
        )

    def tell(self):
        """Send the events that wait, while there is room."""
        player = self._player
        while player.waiting_news:
            player.read_news(self._values)
            if not self._session.send_unasked(messages.SEQUENCE_EVENT, player.number, 0):
                return
            player.forget_news()

    def _refuse(self, error, field, asked, low, high):
        self._session._refuse(error, field, _NO_ELEMENT, asked, low, high)

    def _is_ours(self):
        """Whether the request is about the sequence in memory; refuses where it is not."""
        if self._player.state != EMPTY and self._values[0] == self._player.id:
            return True
        self._not_ready()
        return False

    def _not_ready(self):
        sequence = self._player.sequence
        self._refuse(errors.NOT_READY, 0, self._player.state, sequence.received, sequence.total)

    def _begin(self, count):
        values = self._values
        bubbles = self._app.board.BUBBLES
        if values[1] != bubbles:
            self._refuse(errors.WRONG_COUNT, 1, values[1], bubbles, bubbles)
            return
        if not steps.same(values, 2, self._names, 0) and not steps.same(values, 2, self._names, 1):
            self._refuse(errors.WRONG_BOARD, 2, 0, 0, 0)
            return
        player = self._player
        player.begin(values[0], steps.small(values, 3))
        steps.keep(values, 4, self._crc, 0)
        values[0] = self._app.ticks
        values[1] = player.sequence.free
        values[2] = player.sequence.capacity
        self._session._reply(0)

    def _write(self, count):
        if not self._is_ours():
            return
        values = self._values
        player = self._player
        sequence = player.sequence
        words = sequence.words
        if not (player.state == LOADING or (sequence.streams and (player.running or player.state == ARMED))):
            self._not_ready()
            return
        records = count // words
        if records == 0 or records * words != count:
            most = _WORDS_MAX // words * words
            self._refuse(
                errors.WRONG_LENGTH, 0, _WRITE_HEAD + 2 * count, _WRITE_HEAD + 2 * words, _WRITE_HEAD + 2 * most
            )
            return
        expected = sequence.received & 0xFFFF
        if values[1] != expected:
            if values[1] + records & 0xFFFF != expected:
                self._refuse(errors.OUT_OF_ORDER, 1, values[1], expected, expected)
                return
        elif records > sequence.free:
            self._refuse(errors.NO_ROOM, 2, records, 0, sequence.free)
            return
        else:
            flaw = sequence.write(values, 2, records)
            if flaw >= 0:
                check = sequence.check
                word = flaw & 255
                self._session._refuse(
                    errors.BAD_LOOP if word == steps.LOOP else errors.BAD_STEP,
                    word,
                    flaw >> 8,
                    check[steps.ASKED],
                    check[steps.LOW],
                    check[steps.HIGH],
                )
                return
        values[0] = self._app.ticks
        values[1] = sequence.free
        values[2] = sequence.received
        self._session._reply(0)

    def _arm(self, count):
        if not self._is_ours():
            return
        player = self._player
        sequence = player.sequence
        again = player.state == ENDED and not sequence.streams
        if not (player.state == LOADING or player.state == ARMED or again) or not sequence.whole:
            self._not_ready()
        elif not sequence.streams and not steps.has_crc(sequence.check, self._crc, 0):
            self._refuse(errors.BAD_CRC, 0, 0, 0, 0)
        else:
            player.arm()
            self._session._acknowledge()

    def _start(self, count):
        if not self._is_ours():
            return
        app = self._app
        player = self._player
        if player.state != ARMED:
            if player.running:  # asked again, because the reply was lost
                self._started()
            else:
                self._not_ready()
            return
        if app.faults & faults.VENTING:
            self._refuse(errors.BOARD_FAULT, 0, app.faults, 0, 0)
            return
        tick = steps.small(self._values, 1)
        soonest = app.ticks + 1
        if tick == 0:
            tick = soonest
        if tick < soonest:
            self._refuse(errors.TOO_LATE, 1, tick, soonest, 0)
            return
        player.start_at(tick)
        self._started()

    def _started(self):
        self._values[0] = self._app.ticks
        self._values[1] = self._player.start
        self._session._reply(0)

    def _control(self, count):
        if not self._is_ours():
            return
        player = self._player
        action = self._values[1]
        if action == sequences.END:
            if player.running:
                self._app.stop()
        elif player.state != PLAYING and player.state != PAUSED:
            self._not_ready()
            return
        elif action == sequences.PAUSE:
            player.pause()
        else:
            player.resume()
        self._session._acknowledge()

    def _state(self, count):
        values = self._values
        player = self._player
        sequence = player.sequence
        values[0] = self._app.ticks
        values[1] = player.id
        values[2] = player.state
        values[3] = player.reason
        values[4] = player.record
        values[5] = player.begun
        values[6] = player.unsettled
        values[7] = player.timeouts
        values[8] = sequence.received
        values[9] = sequence.free
        values[10] = sequence.capacity
        self._session._reply(0)
