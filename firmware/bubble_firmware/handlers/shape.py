"""Requests about the shape as a whole: SHOW, STATE, ESTIMATE, STOP, VENT."""

from bubble_firmware.control.trajectory import first_above
from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.commands import Commands
    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.link.reply import Reply

# [constants] bubble_protocol.schema.messages: ESTIMATE SHOW STATE STOP VENT
# [constants] bubble_protocol.schema.system: CAN_ESTIMATE
# [constants] bubble_protocol.schema.errors: BOARD_FAULT NO_ELEMENT OUT_OF_RANGE WRONG_COUNT
# [constants] bubble_protocol.schema.faults: VENTING as VENTING_FAULTS
# [constants] message SHOW as SHOW: *
# [constants] message STATE_REPLY as STATE: TICKS MODE HEIGHT_UM
_ESTIMATE = const(17)
_SHOW = const(4)
_STATE = const(5)
_STOP = const(11)
_VENT = const(12)
_CAN_ESTIMATE = const(64)
_BOARD_FAULT = const(9)
_NO_ELEMENT = const(255)
_OUT_OF_RANGE = const(3)
_WRONG_COUNT = const(4)
_VENTING_FAULTS = const(135)
_SHOW_OVER_MS = const(0)
_SHOW_HEIGHT_UM = const(1)
_SHOW_STRIDE = const(1)
_STATE_TICKS = const(0)
_STATE_MODE = const(1)
_STATE_HEIGHT_UM = const(2)
# [end of constants]


class ShapeHandlers(Handlers):
    """The shape of `bubbles`."""

    capabilities = _CAN_ESTIMATE

    def __init__(
        self, reply: "Reply", board: "ModuleType", state: "BoardState", bubbles: "Bubbles", commands: "Commands"
    ):
        self._reply = reply
        self._board = board
        self._state = state
        self._bubbles = bubbles
        self._commands = commands

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {
            _SHOW: self._show,
            _STATE: self._tell_state,
            _ESTIMATE: self._tell_estimate,
            _STOP: self._stop,
            _VENT: self._vent,
        }

    def _show(self, count: int) -> None:
        values = self._reply.values
        board = self._board
        faults = self._state.faults.board
        if count != board.BUBBLES:
            self._reply.refuse(_WRONG_COUNT, _SHOW_HEIGHT_UM, _NO_ELEMENT, count, board.BUBBLES, board.BUBBLES)
            return
        if faults & _VENTING_FAULTS:
            self._reply.refuse(_BOARD_FAULT, 0, _NO_ELEMENT, faults, 0, 0)
            return
        most = board.HEIGHT_MAX_UM
        high = first_above(values, _SHOW_HEIGHT_UM, _SHOW_HEIGHT_UM + count, most)
        if high >= 0:
            self._reply.refuse(_OUT_OF_RANGE, _SHOW_HEIGHT_UM, high - _SHOW_HEIGHT_UM, values[high], 0, most)
            return
        self._commands.show(values, _SHOW_HEIGHT_UM, values[_SHOW_OVER_MS])
        self._reply.acknowledge()

    def _tell_state(self, count: int) -> None:
        values = self._reply.values
        values[_STATE_TICKS] = self._state.clock.ticks
        values[_STATE_MODE] = self._state.safety.mode
        self._bubbles.pack_state(values, _STATE_HEIGHT_UM)
        self._reply.reply(self._bubbles.count)

    def _tell_estimate(self, count: int) -> None:
        values = self._reply.values
        values[_STATE_TICKS] = self._state.clock.ticks
        values[_STATE_MODE] = self._state.safety.mode
        self._bubbles.pack_estimate(values, _STATE_HEIGHT_UM)
        self._reply.reply(self._bubbles.count)

    def _stop(self, count: int) -> None:
        self._commands.stop()
        self._reply.acknowledge()

    def _vent(self, count: int) -> None:
        self._commands.vent()
        self._reply.acknowledge()
