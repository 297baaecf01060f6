"""Telemetry: what is subscribed to, when it is due, and what found no room."""

from array import array

from bubble_protocol import frame, packing
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.link.sender import Sender

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.messages: TELEMETRY TELEMETRY_FIELDS
# [constants] message TELEMETRY as TELEMETRY: TICKS MODE HEIGHT_UM
# [constants] message TELEMETRY_FIELDS as FIELDS: *
_PRESSURE = const(10)
_FILL_US = const(20)
_VENT_US = const(21)
_STATUS = const(25)
_HEIGHT = const(26)
_SETPOINT = const(33)
_FAULTS = const(36)
_TARGET = const(37)
_HEIGHT_SD = const(53)
_TELEMETRY = const(7)
_TELEMETRY_FIELDS = const(28)
_TELEMETRY_TICKS = const(0)
_TELEMETRY_MODE = const(1)
_TELEMETRY_HEIGHT_UM = const(2)
_FIELDS_TICKS = const(0)
_FIELDS_MODE = const(1)
_FIELDS_BOARD_FAULTS = const(2)
_FIELDS_SUPPLY_PA = const(3)
_FIELDS_DROPPED = const(4)
_FIELDS_FIELDS = const(5)
_FIELDS_VALUE = const(6)
_FIELDS_STRIDE = const(1)
# [end of constants]

_COLUMNS = (  # where each field stands in a bubble's row, and by how many bits it is shifted
    (_HEIGHT, 4),
    (_PRESSURE, 2),
    (_TARGET, 0),
    (_STATUS, 0),
    (_FAULTS, 0),
    (_SETPOINT, 4),
    (_FILL_US, 0),
    (_VENT_US, 0),
    (_HEIGHT_SD, 0),
)
_SHIFTS = const(9)  # where in the plan the shifts begin


class Telemetry:
    """One subscription. `most`: how many fields a frame has room for. `dropped`: what has found no room since boot."""

    def __init__(self, board: "ModuleType", state: "BoardState", bubbles: "Bubbles", sender: "Sender"):
        message = packing.BY_ID[_TELEMETRY_FIELDS]
        self.most = (frame.PAYLOAD_MAX - message.fixed_size) // (message.stride * board.BUBBLES)
        self.dropped = 0
        self._clock = state.clock
        self._safety = state.safety
        self._faults = state.faults
        self._supply = state.supply
        self._bubbles = bubbles
        self._sender = sender
        self._plan = array("i", bytearray(4 * 2 * _SHIFTS))
        self._columns = 0  # how many fields are chosen
        self._fields = 0  # those chosen, bits; 0: TELEMETRY, with what it always has
        self._period = 0  # ticks; 0: none
        self._wait = 0
        self._dropped = 0  # since it was subscribed to
        self._number = 0

    def subscribe(self, period: int, fields: int) -> bool:
        """Send these `fields` every `period` ticks, TELEMETRY where they are 0. False where a frame has no room for them."""
        columns = 0
        for index in range(len(_COLUMNS)):
            if fields >> index & 1:
                columns += 1
        if columns > self.most:
            return False
        columns = 0
        for index in range(len(_COLUMNS)):
            if fields >> index & 1:
                self._plan[columns] = _COLUMNS[index][0]
                self._plan[columns + _SHIFTS] = _COLUMNS[index][1]
                columns += 1
        self._columns = columns
        self._fields = fields
        self._period = self._wait = period
        self._dropped = 0
        self._number = 0
        return True

    def tick(self) -> None:
        """One period: send what is due, or drop it where there is no room."""
        if not self._period:
            return
        self._wait -= 1
        if self._wait > 0:
            return
        self._wait = self._period
        self._number = (self._number + 1) & 0xFFFF
        if self._sender.unsent or not self._send():
            self.dropped += 1
            self._dropped = (self._dropped + 1) & 0xFFFF

    def _send(self) -> bool:
        values = self._sender.values
        bubbles = self._bubbles
        if not self._fields:
            values[_TELEMETRY_TICKS] = self._clock.ticks
            values[_TELEMETRY_MODE] = self._safety.mode
            bubbles.pack_state(values, _TELEMETRY_HEIGHT_UM)
            return self._sender.send(_TELEMETRY, self._number, bubbles.count)
        values[_FIELDS_TICKS] = self._clock.ticks
        values[_FIELDS_MODE] = self._safety.mode
        values[_FIELDS_BOARD_FAULTS] = self._faults.board
        values[_FIELDS_SUPPLY_PA] = self._supply.pressure_pa
        values[_FIELDS_DROPPED] = self._dropped
        values[_FIELDS_FIELDS] = self._fields
        count = bubbles.pack_fields(values, self._plan, _FIELDS_VALUE, self._columns)
        return self._sender.send(_TELEMETRY_FIELDS, self._number, count)
