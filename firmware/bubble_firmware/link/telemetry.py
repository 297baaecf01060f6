"""What is sent unasked: when it is due, which columns, and what found no room."""

from array import array

from bubble_firmware.control import state_layout as layout
from bubble_protocol import codec, frame
from bubble_protocol.schema import messages

_COLUMNS = (  # where each column stands in a bubble's row, and by how many bits it is shifted
    (layout.HEIGHT, 4),
    (layout.PRESSURE, 2),
    (layout.TARGET, 0),
    (layout.STATUS, 0),
    (layout.FAULTS, 0),
    (layout.SETPOINT, 4),
    (layout.FILL_US, 0),
    (layout.VENT_US, 0),
)


class Telemetry:
    """One subscription. `is_due` once per tick; then `fill` and send, or `drop` where there is no room."""

    def __init__(self, app):
        message = codec.BY_NAME["TELEMETRY_FIELDS"]
        self._app = app
        self._plan = array("i", bytearray(4 * 16))
        self._columns = 0  # chosen; 0: TELEMETRY, with what it always has
        self._fields = 0
        self._fixed = message.fixed_values
        self._period = 0  # ticks; 0: none
        self._wait = 0
        self._dropped = 0
        self.most = (frame.PAYLOAD_MAX - message.fixed_size) // (message.stride * app.board.BUBBLES)
        self.dropped = 0  # since boot
        self.sequence = 0
        self.message_id = messages.TELEMETRY

    def subscribe(self, period, fields):
        """Send every `period` ticks: the columns `fields`, 0 for TELEMETRY's. False where a frame has no room for them."""
        columns = 0
        for index in range(len(_COLUMNS)):
            if fields >> index & 1:
                columns += 1
        if columns > self.most:
            return False
        self._columns = self._fields = 0
        for index in range(len(_COLUMNS)):
            if fields >> index & 1:
                self._plan[self._columns] = _COLUMNS[index][0]
                self._plan[self._columns + 8] = _COLUMNS[index][1]
                self._columns += 1
        self._fields = fields
        self._period = self._wait = period
        self._dropped = 0
        self.sequence = 0
        self.message_id = messages.TELEMETRY_FIELDS if fields else messages.TELEMETRY
        return True

    def is_due(self):
        """Count one tick; whether telemetry is due in it."""
        if not self._period:
            return False
        self._wait -= 1
        if self._wait > 0:
            return False
        self._wait = self._period
        self.sequence = (self.sequence + 1) & 0xFFFF
        return True

    def drop(self):
        """What was due found no room."""
        self.dropped += 1
        self._dropped = (self._dropped + 1) & 0xFFFF

    def fill(self, values):
        """The fields of TELEMETRY or TELEMETRY_FIELDS; returns the repetitions."""
        app = self._app
        values[0] = app.ticks
        values[1] = app.mode
        if not self._fields:
            app.bubbles.pack_state(values, 2)
            return app.bubbles.count
        values[2] = app.faults
        values[3] = app.supply.pressure_pa
        values[4] = self._dropped
        values[5] = self._fields
        return app.bubbles.pack_fields(values, self._plan, self._fixed, self._columns)
