# mypy: disable-error-code="attr-defined"
"""What the wristband does when it is asked: one handler for each request.

A handler finds the request's values in `self._values` and answers once, with `_reply`, `_acknowledge` or
`_refuse`; lengths and the schema's limits have been checked.
"""

from bubble_firmware.control.table import KNOTS_MAX
from bubble_firmware.control.trajectory import first_above
from bubble_firmware.tick_stats import BINS
from bubble_protocol.mpy_compat import heap_free
from bubble_protocol.schema import errors, faults, messages

_KNOTS_PER_MESSAGE = 48
NO_ELEMENT = 255


class Requests:
    """The handlers of `session.Session`, which has what they use."""

    def _handlers(self):
        """What handles which message."""
        return {
            messages.INFO: self._info,
            messages.PING: self._ping,
            messages.SHOW: self._show,
            messages.STATE: self._state,
            messages.TABLE_WRITE: self._table_write,
            messages.TABLE_COMMIT: self._table_commit,
            messages.TABLE_READ: self._table_read,
            messages.STOP: self._stop,
            messages.VENT: self._vent,
            messages.CLEAR: self._clear,
            messages.TICKS: self._ticks,
            messages.RESTART: self._restart,
        }

    def _ping(self, count):
        self._values[1] = self._app.ticks
        self._values[2] = self._app.hands.phase_us()
        self._reply(0)

    def _info(self, count):
        app = self._app
        values = self._values
        values[0] = app.ticks
        values[1] = app.hands.late_ticks
        values[2] = app.tick_worst_us
        values[3] = app.exceptions
        values[4] = self._decoder.good
        values[5] = self._decoder.bad
        values[6] = self._telemetry.dropped
        if not app.safety.control_mode:  # vented: counting takes longer than a tick
            app.hands.slack()
            self._heap_free = heap_free()
        values[7] = self._heap_free
        values[8] = app.supply.pressure_pa
        values[9] = app.tables.crc
        values[10] = app.mode
        values[11] = app.faults
        test = app.self_test
        values[12] = test.outcome
        values[13] = test.untrue_zero
        values[14] = test.unfilled
        values[15] = test.unvented
        values[16] = app.store.source
        self._reply(0)

    def _show(self, count):
        values = self._values
        board = self._app.board
        if count != board.BUBBLES:
            self._refuse(errors.WRONG_COUNT, 1, NO_ELEMENT, count, board.BUBBLES, board.BUBBLES)
            return
        if self._app.faults & faults.VENTING:
            self._refuse(errors.BOARD_FAULT, 0, NO_ELEMENT, self._app.faults, 0, 0)
            return
        high = first_above(values, 1, 1 + count, board.HEIGHT_MAX_UM)
        if high >= 0:
            self._refuse(errors.OUT_OF_RANGE, 1, high - 1, values[high], 0, board.HEIGHT_MAX_UM)
            return
        self._app.show(values, 1, values[0])
        self._acknowledge()

    def _state(self, count):
        self._reply(self._fill_state())

    def _table_write(self, count):
        values = self._values
        bubble = values[0]
        first = values[1]
        total = values[2]
        if not self._is_bubble(bubble):
            return
        if first + count > total:
            self._refuse(errors.OUT_OF_RANGE, 1, NO_ELEMENT, first, 0, total - count if total > count else 0)
            return
        tables = self._app.tables
        tables.write_size(bubble, total)
        for index in range(count):
            tables.write_knot(bubble, first + index, values[3 + 2 * index], values[4 + 2 * index])
        self._acknowledge()

    def _table_commit(self, count):
        app = self._app
        tables = app.tables
        crc = self._values[0]
        flaw = tables.first_flaw(app.board.HEIGHT_MAX_UM, app.board.PRESSURE_MAX_PA)
        if flaw >= 0:
            self._refuse(errors.BAD_TABLE, 0, flaw // KNOTS_MAX, flaw % KNOTS_MAX, 0, app.board.PRESSURE_MAX_PA)
        elif crc != tables.received_crc():
            self._refuse(errors.BAD_CRC, 0, NO_ELEMENT, 0, 0, 0)
        else:
            tables.swap()
            app.bubbles.use_tables()
            self._values[0] = tables.crc
            self._reply(0)

    def _table_read(self, count):
        values = self._values
        bubble = values[0]
        first = values[1]
        if not self._is_bubble(bubble):
            return
        tables = self._app.tables
        total = tables.sizes[bubble]
        if first >= total:
            self._refuse(errors.OUT_OF_RANGE, 1, NO_ELEMENT, first, 0, total - 1)
            return
        count = total - first
        if count > _KNOTS_PER_MESSAGE:
            count = _KNOTS_PER_MESSAGE
        values[2] = total
        for index in range(count):
            tables.read_knot(bubble, first + index, values, 3 + 2 * index)
        self._reply(count)

    def _stop(self, count):
        self._app.stop()
        self._acknowledge()

    def _vent(self, count):
        self._app.vent()
        self._acknowledge()

    def _clear(self, count):
        self._app.clear()
        self._acknowledge()

    def _ticks(self, count):
        app = self._app
        values = self._values
        values[0] = app.work_us
        values[1] = app.delay_us
        for index in range(BINS):
            values[2 + 2 * index] = app.worked[index]
            values[3 + 2 * index] = app.delayed[index]
        self._reply(BINS)

    def _restart(self, count):
        into = self._values[0]
        self._acknowledge()
        self._app.restart(into)

    def _is_bubble(self, bubble):
        if bubble < self._app.board.BUBBLES:
            return True
        self._refuse(errors.OUT_OF_RANGE, 0, NO_ELEMENT, bubble, 0, self._app.board.BUBBLES - 1)
        return False

    def _fill_state(self):
        self._values[0] = self._app.ticks
        self._values[1] = self._app.mode
        self._app.bubbles.pack_state(self._values, 2)
        return self._app.board.BUBBLES
