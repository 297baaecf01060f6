"""Requests about the device itself: INFO, TICKS, RESTART."""

from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const, heap_free
from bubble_protocol.steps import copy_word

if TYPE_CHECKING:
    from collections.abc import Callable

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.commands import Commands
    from bubble_firmware.control.table import Tables
    from bubble_firmware.hal.base import Hal
    from bubble_firmware.link.server import Server
    from bubble_firmware.store.slots import Store
    from bubble_firmware.tick_stats import TickStats

# [constants] bubble_protocol.schema.messages: INFO RESTART TICKS
# [constants] bubble_firmware.tick_stats: BINS
# [constants] message INFO_REPLY as INFO: *
# [constants] message TICKS_REPLY as HISTOGRAM: *
# [constants] message RESTART as RESTART: INTO
_INFO = const(3)
_RESTART = const(15)
_TICKS = const(14)
_BINS = const(24)
_INFO_TICKS = const(0)
_INFO_LATE_TICKS = const(1)
_INFO_TICK_WORST_US = const(2)
_INFO_EXCEPTIONS = const(3)
_INFO_FRAMES_GOOD = const(4)
_INFO_FRAMES_BAD = const(5)
_INFO_TELEMETRY_DROPPED = const(6)
_INFO_HEAP_FREE = const(7)
_INFO_SUPPLY_PA = const(8)
_INFO_TABLES_CRC = const(9)
_INFO_MODE = const(10)
_INFO_BOARD_FAULTS = const(11)
_INFO_SELF_TEST = const(12)
_INFO_UNTRUE_ZERO = const(13)
_INFO_UNFILLED = const(14)
_INFO_UNVENTED = const(15)
_INFO_STORE = const(16)
_HISTOGRAM_WORK_US = const(0)
_HISTOGRAM_DELAY_US = const(1)
_HISTOGRAM_WORKED = const(2)
_HISTOGRAM_DELAYED = const(3)
_HISTOGRAM_STRIDE = const(2)
_RESTART_INTO = const(0)
# [end of constants]


class SystemHandlers(Handlers):
    """What a device tells of itself, `server` of the link."""

    slow = (_TICKS,)

    def __init__(
        self,
        server: "Server",
        hal: "Hal",
        state: "BoardState",
        stats: "TickStats",
        tables: "Tables",
        store: "Store",
        commands: "Commands",
    ):
        self._server = server
        self._reply = server.reply
        self._hal = hal
        self._state = state
        self._stats = stats
        self._tables = tables
        self._store = store
        self._commands = commands
        self._heap_free = heap_free()

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_INFO: self._info, _TICKS: self._histograms, _RESTART: self._restart}

    def _info(self, count: int) -> None:
        values = self._reply.values
        state = self._state
        stats = self._stats
        server = self._server
        test = state.self_test
        if not state.safety.control_mode:  # vented: counting takes longer than a tick
            self._hal.allow_overrun()
            self._heap_free = heap_free()
        values[_INFO_TICKS] = state.clock.ticks
        values[_INFO_LATE_TICKS] = self._hal.late_ticks
        values[_INFO_TICK_WORST_US] = stats.worst_us
        values[_INFO_EXCEPTIONS] = stats.exceptions
        values[_INFO_FRAMES_GOOD] = server.decoder.good
        values[_INFO_FRAMES_BAD] = server.decoder.bad
        values[_INFO_TELEMETRY_DROPPED] = server.telemetry.dropped
        values[_INFO_HEAP_FREE] = self._heap_free
        values[_INFO_SUPPLY_PA] = state.supply.pressure_pa
        copy_word(self._tables.crc, 0, values, _INFO_TABLES_CRC)
        values[_INFO_MODE] = state.safety.mode
        values[_INFO_BOARD_FAULTS] = state.faults.board
        values[_INFO_SELF_TEST] = test.outcome
        values[_INFO_UNTRUE_ZERO] = test.untrue_zero
        values[_INFO_UNFILLED] = test.unfilled
        values[_INFO_UNVENTED] = test.unvented
        values[_INFO_STORE] = self._store.source
        self._reply.reply(0)

    def _histograms(self, count: int) -> None:
        stats = self._stats
        values = self._reply.values
        values[_HISTOGRAM_WORK_US] = stats.work_us
        values[_HISTOGRAM_DELAY_US] = stats.delay_us
        at = 0
        for index in range(_BINS):
            values[at + _HISTOGRAM_WORKED] = stats.worked[index]
            values[at + _HISTOGRAM_DELAYED] = stats.delayed[index]
            at += _HISTOGRAM_STRIDE
        self._reply.reply(_BINS)

    def _restart(self, count: int) -> None:
        into = self._reply.values[_RESTART_INTO]
        self._reply.acknowledge()
        self._commands.restart(into)
