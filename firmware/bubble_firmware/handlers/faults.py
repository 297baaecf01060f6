"""Requests about what has gone wrong: FAULTS_READ, FAULTS_ACK, CLEAR."""

from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.commands import Commands
    from bubble_firmware.link.reply import Reply

# [constants] bubble_protocol.schema.messages: CLEAR FAULTS_ACK FAULTS_READ
# [constants] bubble_protocol.schema.system: SAFETY
# [constants] bubble_firmware.safety.fault_log: FIELDS SIZE
# [constants] message FAULTS_READ as ASKED: AFTER
# [constants] message FAULTS_READ_REPLY as READ: *
# [constants] message FAULTS_ACK as ACK: UP_TO
# [constants] message FAULTS_ACK_REPLY as DONE: *
_CLEAR = const(13)
_FAULTS_ACK = const(19)
_FAULTS_READ = const(18)
_SAFETY = const(2)
_FIELDS = const(5)
_SIZE = const(16)
_ASKED_AFTER = const(0)
_READ_TICKS = const(0)
_READ_NEWEST = const(1)
_READ_ACKNOWLEDGED = const(2)
_READ_ID = const(3)
_READ_AT = const(4)
_READ_WHAT = const(5)
_READ_BUBBLE = const(6)
_READ_VALUE = const(7)
_READ_STRIDE = const(5)
_ACK_UP_TO = const(0)
_DONE_TICKS = const(0)
_DONE_ISOLATED_MS = const(1)
# [end of constants]

_ENTRIES_PER_MESSAGE = const(8)


class FaultHandlers(Handlers):
    """The fault log of a board."""

    capabilities = _SAFETY

    def __init__(self, reply: "Reply", board: "ModuleType", state: "BoardState", commands: "Commands"):
        self._reply = reply
        self._tick_us = board.TICK_US
        self._clock = state.clock
        self._faults = state.faults
        self._commands = commands

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_FAULTS_READ: self._read, _FAULTS_ACK: self._acknowledge, _CLEAR: self._clear}

    def _read(self, count: int) -> None:
        log = self._faults.log
        values = self._reply.values
        number = log.oldest_after(values[_ASKED_AFTER])
        values[_READ_TICKS] = self._clock.ticks
        values[_READ_NEWEST] = log.newest
        values[_READ_ACKNOWLEDGED] = log.acknowledged
        found = 0
        at = _READ_ID
        while number <= log.newest and found < _ENTRIES_PER_MESSAGE:
            entry = number % _SIZE * _FIELDS
            for field in range(_FIELDS):
                values[at + field] = log.entries[entry + field]
            at += _READ_STRIDE
            number += 1
            found += 1
        self._reply.reply(found)

    def _acknowledge(self, count: int) -> None:
        self._acknowledge_up_to(self._reply.values[_ACK_UP_TO])

    def _clear(self, count: int) -> None:
        self._acknowledge_up_to(self._faults.log.newest)

    def _acknowledge_up_to(self, entry: int) -> None:
        self._commands.acknowledge(entry)
        values = self._reply.values
        values[_DONE_TICKS] = self._clock.ticks
        values[_DONE_ISOLATED_MS] = -(-self._faults.waiting * self._tick_us // 1000)
        self._reply.reply(0)
