"""Requests about the tables of heights and pressures: TABLE_WRITE, TABLE_COMMIT, TABLE_READ."""

from bubble_firmware.control.table import KNOTS_MAX, pressure_top
from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const
from bubble_protocol.steps import copy_word, same_word

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.control.table import Tables
    from bubble_firmware.link.reply import Reply

# [constants] bubble_protocol.schema.messages: KNOTS_PER_MESSAGE
# [constants] bubble_protocol.schema.messages: TABLE_WRITE TABLE_COMMIT TABLE_READ
# [constants] bubble_protocol.schema.errors: BAD_CRC BAD_TABLE NO_ELEMENT OUT_OF_RANGE
# [constants] message TABLE_WRITE as WRITE: *
# [constants] message TABLE_COMMIT as COMMIT: CRC
# [constants] message TABLE_COMMIT_REPLY as COMMITTED: TABLES_CRC
# [constants] message TABLE_READ_REPLY as READ: *
_KNOTS_PER_MESSAGE = const(48)
_TABLE_WRITE = const(8)
_TABLE_COMMIT = const(9)
_TABLE_READ = const(10)
_BAD_CRC = const(6)
_BAD_TABLE = const(5)
_NO_ELEMENT = const(255)
_OUT_OF_RANGE = const(3)
_WRITE_BUBBLE = const(0)
_WRITE_FIRST = const(1)
_WRITE_TOTAL = const(2)
_WRITE_KNOT_UM = const(3)
_WRITE_KNOT_PA = const(4)
_WRITE_STRIDE = const(2)
_COMMIT_CRC = const(0)
_COMMITTED_TABLES_CRC = const(0)
_READ_BUBBLE = const(0)
_READ_FIRST = const(1)
_READ_TOTAL = const(2)
_READ_KNOT_UM = const(3)
_READ_KNOT_PA = const(4)
_READ_STRIDE = const(2)
# [end of constants]


class TableHandlers(Handlers):
    """The tables of `bubbles`."""

    slow = (_TABLE_WRITE, _TABLE_COMMIT, _TABLE_READ)

    def __init__(self, reply: "Reply", board: "ModuleType", tables: "Tables", bubbles: "Bubbles"):
        self._reply = reply
        self._board = board
        self._tables = tables
        self._bubbles = bubbles

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_TABLE_WRITE: self._write, _TABLE_COMMIT: self._commit, _TABLE_READ: self._read}

    def _write(self, count: int) -> None:
        values = self._reply.values
        bubble = values[_WRITE_BUBBLE]
        first = values[_WRITE_FIRST]
        total = values[_WRITE_TOTAL]
        if not self._is_bubble(bubble):
            return
        if first + count > total:
            most = total - count if total > count else 0
            self._reply.refuse(_OUT_OF_RANGE, _WRITE_FIRST, _NO_ELEMENT, first, 0, most)
            return
        tables = self._tables
        tables.write_size(bubble, total)
        at = _WRITE_KNOT_UM
        for index in range(first, first + count):
            tables.write_knot(bubble, index, values[at], values[at + 1])
            at += _WRITE_STRIDE
        self._reply.acknowledge()

    def _commit(self, count: int) -> None:
        tables = self._tables
        board = self._board
        values = self._reply.values
        invalid = tables.first_flaw(board)
        if invalid >= 0:
            bubble, knot = invalid // KNOTS_MAX, invalid % KNOTS_MAX
            self._reply.refuse(_BAD_TABLE, 0, bubble, knot, pressure_top(board), board.PRESSURE_MAX_PA)
            return
        tables.check_received()
        if not same_word(values, _COMMIT_CRC, tables.received_crc, 0):
            self._reply.refuse(_BAD_CRC, _COMMIT_CRC, _NO_ELEMENT, 0, 0, 0)
        else:
            tables.swap()
            self._bubbles.use_tables()
            copy_word(tables.crc, 0, values, _COMMITTED_TABLES_CRC)
            self._reply.reply(0)

    def _read(self, count: int) -> None:
        values = self._reply.values
        tables = self._tables
        bubble = values[_READ_BUBBLE]
        first = values[_READ_FIRST]
        if not self._is_bubble(bubble):
            return
        total = tables.sizes[bubble]
        if first >= total:
            self._reply.refuse(_OUT_OF_RANGE, _READ_FIRST, _NO_ELEMENT, first, 0, total - 1)
            return
        count = total - first
        if count > _KNOTS_PER_MESSAGE:
            count = _KNOTS_PER_MESSAGE
        values[_READ_TOTAL] = total
        at = _READ_KNOT_UM
        for index in range(first, first + count):
            tables.read_knot(bubble, index, values, at)
            at += _READ_STRIDE
        self._reply.reply(count)

    def _is_bubble(self, bubble: int) -> bool:
        if bubble < self._board.BUBBLES:
            return True
        self._reply.refuse(_OUT_OF_RANGE, _WRITE_BUBBLE, _NO_ELEMENT, bubble, 0, self._board.BUBBLES - 1)
        return False
