"""The request for the layout: where the bubbles of this board are, as its file says."""

from bubble_protocol.mpy_compat import const
from bubble_protocol.schema import messages, system

# [constants] message LAYOUT_REPLY as LAYOUT: *
_LAYOUT_TICKS = const(0)
_LAYOUT_PITCH_UM = const(1)
_LAYOUT_X_UM = const(2)
_LAYOUT_Y_UM = const(3)
_LAYOUT_STRIDE = const(2)
# [end of constants]


class LayoutRequests:
    """The handler of LAYOUT, registered with `session`."""

    def __init__(self, app, session):
        self._app = app
        self._session = session
        self._values = session._values
        session.capabilities |= system.CAN_TELL_LAYOUT
        session.serve({messages.LAYOUT: self._layout})

    def _layout(self, count):
        board = self._app.board
        values = self._values
        values[_LAYOUT_TICKS] = self._app.ticks
        values[_LAYOUT_PITCH_UM] = board.PITCH_UM
        at = 0
        for x_um, y_um in board.LAYOUT:
            values[at + _LAYOUT_X_UM] = x_um
            values[at + _LAYOUT_Y_UM] = y_um
            at += _LAYOUT_STRIDE
        self._session._reply(board.BUBBLES)
