"""The request for the layout: where the bubbles of this board are, as its file says."""

from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.device_clock import DeviceClock
    from bubble_firmware.link.reply import Reply

# [constants] bubble_protocol.schema.messages: LAYOUT
# [constants] bubble_protocol.schema.system: CAN_TELL_LAYOUT
# [constants] message LAYOUT_REPLY as LAYOUT: *
_LAYOUT = const(16)
_CAN_TELL_LAYOUT = const(32)
_LAYOUT_TICKS = const(0)
_LAYOUT_PITCH_UM = const(1)
_LAYOUT_X_UM = const(2)
_LAYOUT_Y_UM = const(3)
_LAYOUT_STRIDE = const(2)
# [end of constants]


class LayoutHandlers(Handlers):
    """The layout of `board`."""

    capabilities = _CAN_TELL_LAYOUT

    def __init__(self, reply: "Reply", board: "ModuleType", clock: "DeviceClock"):
        self._reply = reply
        self._board = board
        self._clock = clock

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_LAYOUT: self._tell_layout}

    def _tell_layout(self, count: int) -> None:
        board = self._board
        values = self._reply.values
        values[_LAYOUT_TICKS] = self._clock.ticks
        values[_LAYOUT_PITCH_UM] = board.PITCH_UM
        at = 0
        for x_um, y_um in board.LAYOUT:
            values[at + _LAYOUT_X_UM] = x_um
            values[at + _LAYOUT_Y_UM] = y_um
            at += _LAYOUT_STRIDE
        self._reply.reply(board.BUBBLES)
