"""Requests about the sequence in memory, SEQUENCE_BEGIN to SEQUENCE_STATE: what is refused and why; and its events."""

from array import array

from bubble_firmware.device_clock import ticks_add, ticks_diff
from bubble_firmware.link.reply import Handlers
from bubble_protocol import steps
from bubble_protocol.crc import crc32_word
from bubble_protocol.frame import PAYLOAD_MAX
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.commands import Commands
    from bubble_firmware.link.reply import Reply
    from bubble_firmware.link.sender import Sender
    from bubble_firmware.sequence.player import Player

# [constants] bubble_protocol.schema.messages: SEQUENCE_BEGIN SEQUENCE_WRITE SEQUENCE_ARM SEQUENCE_START
# [constants] bubble_protocol.schema.messages: SEQUENCE_CONTROL SEQUENCE_STATE SEQUENCE_EVENT
# [constants] bubble_protocol.schema.errors: BAD_CRC BAD_LOOP BAD_STEP BOARD_FAULT NO_ELEMENT NO_ROOM NOT_READY OUT_OF_ORDER
# [constants] bubble_protocol.schema.errors: TOO_LATE WRONG_BOARD WRONG_COUNT WRONG_LENGTH
# [constants] bubble_protocol.schema.faults: VENTING as VENTING_FAULTS
# [constants] bubble_protocol.schema.sequences: EMPTY LOADING ARMED PLAYING PAUSED ENDED
# [constants] bubble_protocol.schema.sequences: PAUSE as ACTION_PAUSE END as ACTION_END
# [constants] bubble_protocol.schema.system: CAN_SEQUENCES
# [constants] bubble_protocol.steps: ASKED LOW HIGH LOOP
# [constants] message SEQUENCE_BEGIN as BEGIN: *
# [constants] message SEQUENCE_BEGIN_REPLY as BEGUN: *
# [constants] message SEQUENCE_WRITE as WRITE: *
# [constants] message SEQUENCE_WRITE_REPLY as WRITTEN: *
# [constants] message SEQUENCE_START as START: *
# [constants] message SEQUENCE_START_REPLY as STARTED: *
# [constants] message SEQUENCE_CONTROL as CONTROL: ACTION
# [constants] message SEQUENCE_STATE_REPLY as STATE: *
_SEQUENCE_BEGIN = const(32)
_SEQUENCE_WRITE = const(33)
_SEQUENCE_ARM = const(34)
_SEQUENCE_START = const(35)
_SEQUENCE_CONTROL = const(36)
_SEQUENCE_STATE = const(37)
_SEQUENCE_EVENT = const(38)
_BAD_CRC = const(6)
_BAD_LOOP = const(20)
_BAD_STEP = const(19)
_BOARD_FAULT = const(9)
_NO_ELEMENT = const(255)
_NO_ROOM = const(22)
_NOT_READY = const(23)
_OUT_OF_ORDER = const(21)
_TOO_LATE = const(24)
_WRONG_BOARD = const(18)
_WRONG_COUNT = const(4)
_WRONG_LENGTH = const(2)
_VENTING_FAULTS = const(135)
_EMPTY = const(0)
_LOADING = const(1)
_ARMED = const(2)
_PLAYING = const(4)
_PAUSED = const(5)
_ENDED = const(6)
_ACTION_PAUSE = const(0)
_ACTION_END = const(2)
_CAN_SEQUENCES = const(8)
_ASKED = const(8)
_LOW = const(9)
_HIGH = const(10)
_LOOP = const(255)
_BEGIN_SEQUENCE = const(0)
_BEGIN_BUBBLES = const(1)
_BEGIN_BOARD_CRC = const(2)
_BEGIN_RECORDS = const(3)
_BEGIN_CRC = const(4)
_BEGUN_TICKS = const(0)
_BEGUN_FREE = const(1)
_BEGUN_CAPACITY = const(2)
_WRITE_SEQUENCE = const(0)
_WRITE_FIRST = const(1)
_WRITE_WORD = const(2)
_WRITE_STRIDE = const(1)
_WRITTEN_TICKS = const(0)
_WRITTEN_FREE = const(1)
_WRITTEN_RECEIVED = const(2)
_START_SEQUENCE = const(0)
_START_START_TICKS = const(1)
_STARTED_TICKS = const(0)
_STARTED_START_TICKS = const(1)
_CONTROL_ACTION = const(1)
_STATE_TICKS = const(0)
_STATE_SEQUENCE = const(1)
_STATE_STATE = const(2)
_STATE_REASON = const(3)
_STATE_RECORD = const(4)
_STATE_BEGUN_TICKS = const(5)
_STATE_UNSETTLED = const(6)
_STATE_TIMEOUTS = const(7)
_STATE_RECEIVED = const(8)
_STATE_FREE = const(9)
_STATE_CAPACITY = const(10)
# [end of constants]

_SEQUENCE = const(_BEGIN_SEQUENCE)  # the host's number of the sequence comes first in every request
_WRITE_HEAD = const(4)  # bytes of SEQUENCE_WRITE before the words
_WORDS_MAX = (PAYLOAD_MAX - _WRITE_HEAD) // 2  # in one SEQUENCE_WRITE


class SequenceHandlers(Handlers):
    """The sequence in the memory of `player`. Call `send_events` while the player has some."""

    capabilities = _CAN_SEQUENCES

    def __init__(
        self,
        sender: "Sender",
        reply: "Reply",
        board: "ModuleType",
        state: "BoardState",
        player: "Player",
        commands: "Commands",
    ):
        self._sender = sender
        self._reply = reply
        self._bubbles = board.BUBBLES
        self._clock = state.clock
        self._faults = state.faults
        self._player = player
        self._commands = commands
        name = board.NAME.encode()
        self._boards = array("i", (crc32_word(name, 0, len(name)), 0))  # whose sequences are taken: ours, anyone's
        self._crc = array("i", (0,))  # that the sequence is to have

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {
            _SEQUENCE_BEGIN: self._begin,
            _SEQUENCE_WRITE: self._write,
            _SEQUENCE_ARM: self._arm,
            _SEQUENCE_START: self._start,
            _SEQUENCE_CONTROL: self._control,
            _SEQUENCE_STATE: self._tell_state,
        }

    def send_events(self) -> None:
        """Send the events that wait, while there is room."""
        player = self._player
        sender = self._sender
        while player.events_waiting:
            player.read_event(sender.values)
            if not sender.send_unasked(_SEQUENCE_EVENT, player.event_number, 0):
                return
            player.drop_event()

    def _refuse(self, error: int, field: int, asked: int, low: int, high: int) -> None:
        self._reply.refuse(error, field, _NO_ELEMENT, asked, low, high)

    def _is_ours(self) -> bool:
        """Whether the request is about the sequence in memory; refuses where it is not."""
        if self._player.state != _EMPTY and self._reply.values[_SEQUENCE] == self._player.id:
            return True
        self._refuse_for_now()
        return False

    def _refuse_for_now(self) -> None:
        sequence = self._player.sequence
        self._refuse(_NOT_READY, 0, self._player.state, sequence.received, sequence.total)

    def _begin(self, count: int) -> None:
        values = self._reply.values
        bubbles = self._bubbles
        if values[_BEGIN_BUBBLES] != bubbles:
            self._refuse(_WRONG_COUNT, _BEGIN_BUBBLES, values[_BEGIN_BUBBLES], bubbles, bubbles)
            return
        is_same = steps.same_word
        if not is_same(values, _BEGIN_BOARD_CRC, self._boards, 0) and not is_same(
            values, _BEGIN_BOARD_CRC, self._boards, 1
        ):
            self._refuse(_WRONG_BOARD, _BEGIN_BOARD_CRC, 0, 0, 0)
            return
        player = self._player
        player.begin(values[_SEQUENCE], steps.small_word(values, _BEGIN_RECORDS))
        steps.copy_word(values, _BEGIN_CRC, self._crc, 0)
        values[_BEGUN_TICKS] = self._clock.ticks
        values[_BEGUN_FREE] = player.sequence.free
        values[_BEGUN_CAPACITY] = player.sequence.capacity
        self._reply.reply(0)

    def _write(self, count: int) -> None:
        if not self._is_ours():
            return
        player = self._player
        sequence = player.sequence
        if not (player.state == _LOADING or (sequence.streams and (player.running or player.state == _ARMED))):
            self._refuse_for_now()
            return
        words = sequence.words
        records = count // words
        if records == 0 or records * words != count:
            most = _WORDS_MAX // words * words
            size = _WRITE_HEAD + 2 * count
            self._refuse(_WRONG_LENGTH, 0, size, _WRITE_HEAD + 2 * words, _WRITE_HEAD + 2 * most)
            return
        if self._take(records):
            values = self._reply.values
            values[_WRITTEN_TICKS] = self._clock.ticks
            values[_WRITTEN_FREE] = sequence.free
            values[_WRITTEN_RECEIVED] = sequence.received
            self._reply.reply(0)

    def _take(self, records: int) -> bool:
        """Take so many records, once, if they are the next ones and sound; refuses where they are not."""
        sequence = self._player.sequence
        values = self._reply.values
        first = values[_WRITE_FIRST]
        expected = sequence.received & 0xFFFF
        if first != expected:
            if first + records & 0xFFFF == expected:  # they have been taken already
                return True
            self._refuse(_OUT_OF_ORDER, _WRITE_FIRST, first, expected, expected)
            return False
        if records > sequence.free:
            self._refuse(_NO_ROOM, _WRITE_WORD, records, 0, sequence.free)
            return False
        invalid = sequence.write(values, _WRITE_WORD, records)
        if invalid < 0:
            return True
        check = sequence.check
        word = invalid & 255
        error = _BAD_LOOP if word == _LOOP else _BAD_STEP
        self._reply.refuse(error, word, invalid >> 8, check[_ASKED], check[_LOW], check[_HIGH])
        return False

    def _arm(self, count: int) -> None:
        if not self._is_ours():
            return
        player = self._player
        sequence = player.sequence
        again = player.state == _ENDED and not sequence.streams
        if not (player.state == _LOADING or player.state == _ARMED or again) or not sequence.complete:
            self._refuse_for_now()
        elif not sequence.streams and not steps.has_crc(sequence.check, self._crc, 0):
            self._refuse(_BAD_CRC, 0, 0, 0, 0)
        else:
            player.arm()
            self._reply.acknowledge()

    def _start(self, count: int) -> None:
        if not self._is_ours():
            return
        player = self._player
        faults = self._faults.board
        if player.state != _ARMED:
            if player.running:  # asked again, because the reply was lost
                self._tell_start()
            else:
                self._refuse_for_now()
            return
        if faults & _VENTING_FAULTS:
            self._refuse(_BOARD_FAULT, 0, faults, 0, 0)
            return
        tick = steps.small_word(self._reply.values, _START_START_TICKS)
        soonest = ticks_add(self._clock.ticks, 1)
        if tick == 0:
            tick = soonest
        if ticks_diff(tick, soonest) < 0:
            self._refuse(_TOO_LATE, _START_START_TICKS, tick, soonest, 0)
            return
        player.start_at(tick)
        self._tell_start()

    def _tell_start(self) -> None:
        values = self._reply.values
        values[_STARTED_TICKS] = self._clock.ticks
        values[_STARTED_START_TICKS] = self._player.start
        self._reply.reply(0)

    def _control(self, count: int) -> None:
        if not self._is_ours():
            return
        player = self._player
        action = self._reply.values[_CONTROL_ACTION]
        if action == _ACTION_END:
            if player.running:
                self._commands.stop()
        elif player.state != _PLAYING and player.state != _PAUSED:
            self._refuse_for_now()
            return
        elif action == _ACTION_PAUSE:
            player.pause()
        else:
            player.resume()
        self._reply.acknowledge()

    def _tell_state(self, count: int) -> None:
        values = self._reply.values
        player = self._player
        sequence = player.sequence
        values[_STATE_TICKS] = self._clock.ticks
        values[_STATE_SEQUENCE] = player.id
        values[_STATE_STATE] = player.state
        values[_STATE_REASON] = player.reason
        values[_STATE_RECORD] = player.record
        values[_STATE_BEGUN_TICKS] = player.begun
        values[_STATE_UNSETTLED] = player.unsettled
        values[_STATE_TIMEOUTS] = player.timeouts
        values[_STATE_RECEIVED] = sequence.received
        values[_STATE_FREE] = sequence.free
        values[_STATE_CAPACITY] = sequence.capacity
        self._reply.reply(0)
