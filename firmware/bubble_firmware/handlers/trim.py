"""Requests about the trim of every bubble: CALIBRATION_WRITE and _READ, and TRIM_WRITE and _READ, which know one valve."""

from bubble_firmware.control import trim as trims
from bubble_firmware.handlers.vented import is_vented
from bubble_firmware.link.reply import Handlers
from bubble_protocol import frame, packing
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.control.trim import Trim
    from bubble_firmware.link.reply import Reply
    from bubble_firmware.safety.state import SafetyState

# [constants] bubble_protocol.schema.messages: CALIBRATION_READ CALIBRATION_WRITE TRIM_READ TRIM_WRITE
# [constants] message CALIBRATION_READ_REPLY as CALIBRATION: FIRST ZERO
# [constants] bubble_protocol.schema.errors: NO_ELEMENT OUT_OF_RANGE WRONG_COUNT
_CALIBRATION_READ = const(30)
_CALIBRATION_WRITE = const(29)
_TRIM_READ = const(26)
_TRIM_WRITE = const(25)
_CALIBRATION_FIRST = const(0)
_CALIBRATION_ZERO = const(1)
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
        message = packing.BY_ID[_CALIBRATION_WRITE]
        self._most = (frame.PAYLOAD_MAX - message.fixed_size) // message.stride  # trims for which a frame has room

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {
            _CALIBRATION_WRITE: self._write,
            _CALIBRATION_READ: self._read,
            _TRIM_WRITE: self._write_short,
            _TRIM_READ: self._read_short,
        }

    def _write_short(self, count: int) -> None:
        reply = self._reply
        if count != self._bubbles:
            reply.refuse(_WRONG_COUNT, 0, _NO_ELEMENT, count, self._bubbles, self._bubbles)
            return
        for bubble in range(count - 1, -1, -1):
            self._trim.widen(reply.values, bubble * trims.SHORT, bubble * trims.COUNT)
        self._use(0, 0, count)

    def _read_short(self, count: int) -> None:
        values = self._reply.values
        for bubble in range(self._bubbles):
            for number in range(trims.SHORT):
                values[bubble * trims.SHORT + number] = self._trim.number(bubble, number)
        self._reply.reply(self._bubbles)

    def _write(self, count: int) -> None:
        reply = self._reply
        first = reply.values[_CALIBRATION_FIRST]
        if count == 0 or first + count > self._bubbles:
            reply.refuse(_WRONG_COUNT, _CALIBRATION_ZERO, _NO_ELEMENT, count, 1, max(0, self._bubbles - first))
            return
        self._use(_CALIBRATION_ZERO, first, count)

    def _use(self, at: int, first: int, count: int) -> None:
        if not is_vented(self._reply, self._safety):
            return
        for index in range(count):
            if self._refuses(at, index):
                return
        for index in range(count):
            self._trim.use(self._reply.values, at + index * trims.COUNT, first + index)
        self._reply.acknowledge()

    def _refuses(self, at: int, index: int) -> bool:
        """Refuse the trims at `values[at:]` where number `index` of them is not allowed."""
        values = self._reply.values
        trim = self._trim
        place = at + index * trims.COUNT
        number = trim.invalid(values, place)
        if number < 0:
            return False
        field = at + number if at else min(number, trims.SHORT - 1)
        self._reply.refuse(_OUT_OF_RANGE, field, index, values[place + number], trim.low[number], trim.high[number])
        return True

    def _read(self, count: int) -> None:
        reply = self._reply
        first = reply.values[_CALIBRATION_FIRST]
        if first >= self._bubbles:
            reply.refuse(_OUT_OF_RANGE, _CALIBRATION_FIRST, _NO_ELEMENT, first, 0, self._bubbles - 1)
            return
        count = min(self._bubbles - first, self._most)
        for index in range(count):
            self._trim.read(reply.values, _CALIBRATION_ZERO + index * trims.COUNT, first + index)
        reply.reply(count)
