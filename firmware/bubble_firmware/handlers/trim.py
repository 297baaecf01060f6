"""Requests about the trim of every bubble: TRIM_WRITE, TRIM_READ."""

from bubble_firmware.control import trim as trims
from bubble_firmware.handlers.vented import is_vented
from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.control.trim import Trim
    from bubble_firmware.link.reply import Reply
    from bubble_firmware.safety.state import SafetyState

# [constants] bubble_protocol.schema.messages: TRIM_READ TRIM_WRITE
# [constants] bubble_protocol.schema.errors: NO_ELEMENT OUT_OF_RANGE WRONG_COUNT
_TRIM_READ = const(26)
_TRIM_WRITE = const(25)
_NO_ELEMENT = const(255)
_OUT_OF_RANGE = const(3)
_WRONG_COUNT = const(4)
# [end of constants]


class TrimHandlers(Handlers):
    """The trim of all bubbles."""

    def __init__(self, reply: "Reply", board: "ModuleType", safety: "SafetyState", trim: "Trim"):
        self._reply = reply
        self._bubbles = board.BUBBLES
        self._safety = safety
        self._trim = trim

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_TRIM_WRITE: self._write, _TRIM_READ: self._read}

    def _write(self, count: int) -> None:
        reply = self._reply
        values = reply.values
        trim = self._trim
        if count != self._bubbles:
            reply.refuse(_WRONG_COUNT, 0, _NO_ELEMENT, count, self._bubbles, self._bubbles)
            return
        if not is_vented(reply, self._safety):
            return
        invalid = trim.first_invalid(values)
        if invalid >= 0:
            field = invalid % trims.COUNT
            bubble = invalid // trims.COUNT
            reply.refuse(_OUT_OF_RANGE, field, bubble, values[invalid], trim.low[field], trim.high[field])
            return
        trim.use(values)
        reply.acknowledge()

    def _read(self, count: int) -> None:
        self._trim.read(self._reply.values)
        self._reply.reply(self._bubbles)
