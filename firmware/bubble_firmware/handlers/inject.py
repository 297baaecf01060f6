"""The request to fail on purpose: INJECT."""

from bubble_firmware.hal.failing import FailingHal
from bubble_firmware.handlers.vented import is_vented
from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.hal.base import Hal
    from bubble_firmware.link.reply import Reply
    from bubble_firmware.safety.state import SafetyState

# [constants] bubble_protocol.schema.messages: INJECT
# [constants] bubble_protocol.schema.errors: NO_ELEMENT NOT_PERMITTED OUT_OF_RANGE
# [constants] bubble_protocol.schema.injection: INJECTION
# [constants] message INJECT as ASKED: *
_INJECT = const(31)
_NO_ELEMENT = const(255)
_NOT_PERMITTED = const(13)
_OUT_OF_RANGE = const(3)
_INJECTION = const(0)
_ASKED_FAILURE = const(0)
_ASKED_BUBBLE = const(1)
_ASKED_ON = const(2)
# [end of constants]


class InjectHandlers(Handlers):
    """Failures on request. `use`: lets the ticks that follow run on the hardware that it is given."""

    def __init__(
        self, reply: "Reply", board: "ModuleType", hal: "Hal", safety: "SafetyState", use: "Callable[[Hal], None]"
    ):
        self._reply = reply
        self._last: int = board.BUBBLES - 1
        self._hal = hal
        self._failing = FailingHal(board, hal)
        self._permitted = 0
        self._safety = safety
        self._use = use

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_INJECT: self._inject}

    def _inject(self, count: int) -> None:
        reply = self._reply
        failure = reply.values[_ASKED_FAILURE]
        bubble = reply.values[_ASKED_BUBBLE]
        on = reply.values[_ASKED_ON]
        if failure == _INJECTION:
            if on and not is_vented(reply, self._safety):
                return
            self._failing.mend()
            self._use(self._failing if on else self._hal)  # without permission nothing of this is in a tick's way
            self._permitted = on
        elif not self._permitted:
            reply.refuse(_NOT_PERMITTED, _ASKED_FAILURE, _NO_ELEMENT, failure, 0, 0)
            return
        elif bubble > self._last:
            reply.refuse(_OUT_OF_RANGE, _ASKED_BUBBLE, _NO_ELEMENT, bubble, 0, self._last)
            return
        else:
            self._failing.fail(failure, bubble, on)
        reply.acknowledge()
