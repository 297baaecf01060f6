"""Requests that open a session and keep it: HELLO, PING, SUBSCRIBE, SUBSCRIBE_FIELDS."""

from bubble_firmware.link.reply import Handlers
from bubble_protocol import packing
from bubble_protocol.frame import Decoder
from bubble_protocol.mpy_compat import TYPE_CHECKING, const
from bubble_protocol.steps import copy_word
from bubble_protocol.version import FIRMWARE, PROTOCOL_MAX, PROTOCOL_MIN

if TYPE_CHECKING:
    from array import array
    from collections.abc import Callable
    from types import ModuleType

    from bubble_firmware.control.table import Tables
    from bubble_firmware.device_clock import DeviceClock
    from bubble_firmware.hal.base import Hal
    from bubble_firmware.link.server import Server

# [constants] bubble_protocol.schema.packed: SCHEMA_CRC
# [constants] bubble_protocol.schema.messages: HELLO PING SUBSCRIBE SUBSCRIBE_FIELDS
# [constants] bubble_protocol.schema.errors: NO_COMMON_PROTOCOL NO_ELEMENT OUT_OF_RANGE OVERTAKEN
# [constants] bubble_protocol.schema.system: DELIVERY CAN_CHOOSE_TELEMETRY
# [constants] bubble_firmware.link.receive_window: NO_SESSION STALE WINDOW
# [constants] message HELLO as HOST: *
# [constants] message HELLO_REPLY as HELLO: *
# [constants] message PING_REPLY as PING: *
# [constants] message SUBSCRIBE as SUBSCRIBE: *
# [constants] message SUBSCRIBE_FIELDS as CHOSEN: *
_SCHEMA_CRC = const(-439127705)
_HELLO = const(1)
_PING = const(2)
_SUBSCRIBE = const(6)
_SUBSCRIBE_FIELDS = const(27)
_NO_COMMON_PROTOCOL = const(7)
_NO_ELEMENT = const(255)
_OUT_OF_RANGE = const(3)
_OVERTAKEN = const(10)
_DELIVERY = const(1)
_CAN_CHOOSE_TELEMETRY = const(16)
_NO_SESSION = const(3)
_STALE = const(1)
_WINDOW = const(8)
_HOST_PROTOCOL_MIN = const(0)
_HOST_PROTOCOL_MAX = const(1)
_HOST_SESSION = const(2)
_HELLO_PROTOCOL_MIN = const(0)
_HELLO_PROTOCOL_MAX = const(1)
_HELLO_SCHEMA_CRC = const(2)
_HELLO_BOOT_ID = const(3)
_HELLO_FIRMWARE_MAJOR = const(4)
_HELLO_FIRMWARE_MINOR = const(5)
_HELLO_FIRMWARE_PATCH = const(6)
_HELLO_BOARD = const(7)
_HELLO_BUBBLES = const(23)
_HELLO_TICK_US = const(24)
_HELLO_HEIGHT_REST_UM = const(25)
_HELLO_HEIGHT_MAX_UM = const(26)
_HELLO_PRESSURE_MAX_PA = const(27)
_HELLO_WINDOW = const(28)
_HELLO_CAPABILITIES = const(29)
_HELLO_TABLES_CRC = const(30)
_PING_TOKEN = const(0)
_PING_TICKS = const(1)
_PING_PHASE_US = const(2)
_SUBSCRIBE_PERIOD_TICKS = const(0)
_CHOSEN_PERIOD_TICKS = const(0)
_CHOSEN_FIELDS = const(1)
# [end of constants]

_SESSION_AT = Decoder.PAYLOAD_AT + 2  # in the frame of HELLO, bytes
_SESSION_MAX = const(0x3FFFFFFF)  # that a refusal can name


class SessionHandlers(Handlers):
    """The sessions of `server`."""

    capabilities = _DELIVERY | _CAN_CHOOSE_TELEMETRY

    def __init__(self, server: "Server", board: "ModuleType", hal: "Hal", clock: "DeviceClock", tables: "Tables"):
        self._server = server
        self._reply = server.reply
        self._board = board
        self._hal = hal
        self._clock = clock
        self._tables = tables
        self._name = (board.NAME.encode() + bytes(packing.TEXT_SIZE))[
            : packing.TEXT_SIZE
        ]  # a letter of a string can allocate
        boot_id = hal.boot_id & 0xFFFFFFFF
        self._boot_id = boot_id - (boot_id >> 31 << 32)  # the same 32 bits as a signed word

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """See `Handlers`."""
        return {
            _HELLO: self._hello,
            _PING: self._ping,
            _SUBSCRIBE: self._subscribe,
            _SUBSCRIBE_FIELDS: self._subscribe_fields,
        }

    def _hello(self, count: int) -> None:
        values = self._reply.values
        highest = values[_HOST_PROTOCOL_MAX]
        if values[_HOST_PROTOCOL_MIN] > PROTOCOL_MAX or highest < PROTOCOL_MIN:
            self._reply.refuse(
                _NO_COMMON_PROTOCOL, _HOST_PROTOCOL_MAX, _NO_ELEMENT, highest, PROTOCOL_MIN, PROTOCOL_MAX
            )
            return
        opened = self._server.open(_SESSION_AT)
        if opened == _NO_SESSION:
            self._reply.refuse(_OUT_OF_RANGE, _HOST_SESSION, _NO_ELEMENT, 0, 1, _SESSION_MAX)
        elif opened == _STALE:
            self._reply.refuse(_OVERTAKEN, _HOST_SESSION, _NO_ELEMENT, 0, 0, 0)
        else:
            self._introduce(values)

    def _introduce(self, values: "array[int]") -> None:
        board = self._board
        values[_HELLO_PROTOCOL_MIN] = PROTOCOL_MIN
        values[_HELLO_PROTOCOL_MAX] = PROTOCOL_MAX
        values[_HELLO_SCHEMA_CRC] = _SCHEMA_CRC
        values[_HELLO_BOOT_ID] = self._boot_id
        values[_HELLO_FIRMWARE_MAJOR], values[_HELLO_FIRMWARE_MINOR], values[_HELLO_FIRMWARE_PATCH] = FIRMWARE
        for index in range(packing.TEXT_SIZE):
            values[_HELLO_BOARD + index] = self._name[index]
        values[_HELLO_BUBBLES] = board.BUBBLES
        values[_HELLO_TICK_US] = board.TICK_US
        values[_HELLO_HEIGHT_REST_UM] = board.HEIGHT_REST_UM
        values[_HELLO_HEIGHT_MAX_UM] = board.HEIGHT_MAX_UM
        values[_HELLO_PRESSURE_MAX_PA] = board.PRESSURE_MAX_PA
        values[_HELLO_WINDOW] = _WINDOW
        values[_HELLO_CAPABILITIES] = self._server.capabilities
        copy_word(self._tables.crc, 0, values, _HELLO_TABLES_CRC)
        self._reply.reply(0)

    def _ping(self, count: int) -> None:
        values = self._reply.values
        values[_PING_TICKS] = self._clock.ticks
        values[_PING_PHASE_US] = self._hal.phase_us()
        self._reply.reply(0)

    def _subscribe(self, count: int) -> None:
        self._server.telemetry.subscribe(self._reply.values[_SUBSCRIBE_PERIOD_TICKS], 0)
        self._reply.acknowledge()

    def _subscribe_fields(self, count: int) -> None:
        values = self._reply.values
        telemetry = self._server.telemetry
        fields = values[_CHOSEN_FIELDS]
        if telemetry.subscribe(values[_CHOSEN_PERIOD_TICKS], fields):
            self._reply.acknowledge()
        else:  # the limit is one of how many, not of which
            most = (1 << telemetry.most) - 1
            self._reply.refuse(_OUT_OF_RANGE, _CHOSEN_FIELDS, _NO_ELEMENT, fields, 1, most)
