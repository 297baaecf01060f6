"""Requests about what can be set: SETTING_READ, SETTING_WRITE."""

from bubble_firmware.link.reply import Handlers
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable

    from bubble_firmware.device_clock import DeviceClock
    from bubble_firmware.link.reply import Reply
    from bubble_firmware.store.settings import Settings

# [constants] bubble_protocol.schema.messages: SETTING_READ SETTING_WRITE
# [constants] bubble_protocol.schema.errors: NO_ELEMENT NO_SETTING OUT_OF_RANGE
# [constants] bubble_protocol.schema.settings: DEADMAN_HOLD DEADMAN_VENT
# [constants] message SETTING_READ_REPLY as READ: *
# [constants] message SETTING_WRITE as WRITE: *
_SETTING_READ = const(20)
_SETTING_WRITE = const(21)
_NO_ELEMENT = const(255)
_NO_SETTING = const(12)
_OUT_OF_RANGE = const(3)
_DEADMAN_HOLD = const(0)
_DEADMAN_VENT = const(1)
_READ_TICKS = const(0)
_READ_VERSION = const(1)
_READ_SETTING = const(2)
_READ_VALUE = const(3)
_READ_LOW = const(4)
_READ_HIGH = const(5)
_READ_STRIDE = const(4)
_WRITE_SETTING = const(0)
_WRITE_VALUE = const(1)
_WRITE_STRIDE = const(2)
# [end of constants]


class SettingHandlers(Handlers):
    """The settings of a board."""

    def __init__(self, reply: "Reply", clock: "DeviceClock", settings: "Settings"):
        self._reply = reply
        self._clock = clock
        self._settings = settings

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {_SETTING_READ: self._read, _SETTING_WRITE: self._write}

    def _read(self, count: int) -> None:
        settings = self._settings
        values = self._reply.values
        values[_READ_TICKS] = self._clock.ticks
        values[_READ_VERSION] = settings.version
        at = 0
        for number in range(settings.count):
            values[at + _READ_SETTING] = number
            values[at + _READ_VALUE] = settings.values[number]
            values[at + _READ_LOW] = settings.lows[number]
            values[at + _READ_HIGH] = settings.highs[number]
            at += _READ_STRIDE
        self._reply.reply(settings.count)

    def _write(self, count: int) -> None:
        settings = self._settings
        reply = self._reply
        values = reply.values
        index = settings.first_invalid(values, 0, count)
        if index < 0:
            settings.use()
            reply.acknowledge()
            return
        if index == count:  # venting would come before holding
            low = settings.wanted[_DEADMAN_HOLD]
            high = settings.highs[_DEADMAN_VENT]
            reply.refuse(_OUT_OF_RANGE, _WRITE_VALUE, _NO_ELEMENT, settings.wanted[_DEADMAN_VENT], low, high)
            return
        number = values[_WRITE_STRIDE * index + _WRITE_SETTING]
        if number >= settings.count:
            reply.refuse(_NO_SETTING, _WRITE_SETTING, index, number, 0, settings.count - 1)
            return
        at = _WRITE_STRIDE * index + _WRITE_VALUE
        reply.refuse_value(_OUT_OF_RANGE, _WRITE_VALUE, index, at, settings.lows[number], settings.highs[number])
