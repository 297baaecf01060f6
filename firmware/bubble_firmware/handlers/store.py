"""Requests that keep things: STORE_SAVE, STORE_INFO, STORE_RESET.

Flash is written only while the bubbles are vented: an erase stops everything, interrupts too, for 45 ms, 400 ms at worst.
"""

from bubble_firmware.handlers.vented import is_vented
from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const
from bubble_protocol.steps import copy_word

if TYPE_CHECKING:
    from collections.abc import Callable

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.hal.base import Hal
    from bubble_firmware.link.reply import Reply
    from bubble_firmware.store.slots import Store

# [constants] bubble_protocol.schema.messages: STORE_INFO STORE_RESET STORE_SAVE
# [constants] bubble_protocol.schema.errors: NO_ELEMENT
# [constants] bubble_protocol.schema.system: STORE as CAN_STORE
# [constants] message STORE_INFO_REPLY as STORE: *
_STORE_INFO = const(23)
_STORE_RESET = const(24)
_STORE_SAVE = const(22)
_NO_ELEMENT = const(255)
_CAN_STORE = const(4)
_STORE_SOURCE = const(0)
_STORE_GENERATION = const(1)
_STORE_SCHEMA = const(2)
_STORE_SLOT_A = const(3)
_STORE_SLOT_B = const(4)
_STORE_WEAR_A = const(5)
_STORE_WEAR_B = const(6)
_STORE_SIZE = const(7)
_STORE_CAPACITY = const(8)
_STORE_TABLES_CRC = const(9)
_STORE_ERROR = const(10)
# [end of constants]


class StoreHandlers(Handlers):
    """The store of a board."""

    capabilities = _CAN_STORE

    def __init__(self, reply: "Reply", hal: "Hal", state: "BoardState", store: "Store"):
        self._reply = reply
        self._hal = hal
        self._state = state
        self._store = store

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_STORE_SAVE: self._save, _STORE_INFO: self._info, _STORE_RESET: self._reset}

    def _save(self, count: int) -> None:
        if is_vented(self._reply, self._state.safety):
            self._answer(self._pause() and self._store.save())

    def _reset(self, count: int) -> None:
        if is_vented(self._reply, self._state.safety):
            self._answer(self._pause() and self._store.reset())

    def _info(self, count: int) -> None:
        self._answer(True)

    def _pause(self) -> bool:
        """Bring all outputs to where they may stay for as long as flash takes; False where there is no flash."""
        if not self._store.capacity:
            return False
        self._state.self_test.skip()
        self._hal.safe_outputs()  # the pump, too
        self._hal.allow_overrun()
        return True

    def _answer(self, done: bool) -> None:
        store = self._store
        if not done:
            states = store.states[0] | store.states[1] << 8
            self._reply.refuse(store.error, 0, _NO_ELEMENT, states, 0, 0)
            return
        values = self._reply.values
        values[_STORE_SOURCE] = store.source
        values[_STORE_GENERATION] = store.generation
        values[_STORE_SCHEMA] = store.schema
        values[_STORE_SLOT_A] = store.states[0]
        values[_STORE_SLOT_B] = store.states[1]
        values[_STORE_WEAR_A] = store.wear[0]
        values[_STORE_WEAR_B] = store.wear[1]
        values[_STORE_SIZE] = store.length
        values[_STORE_CAPACITY] = store.capacity
        copy_word(store.tables_crc, 0, values, _STORE_TABLES_CRC)
        values[_STORE_ERROR] = store.error
        self._reply.reply(0)
