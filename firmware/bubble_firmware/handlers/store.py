"""Requests that keep things: STORE_SAVE, STORE_INFO, STORE_RESET, TRIM_WRITE, TRIM_READ.

Flash is written only while the bubbles are vented: an erase stops everything, interrupts too, for 45 ms, 400 ms at worst.
"""

from bubble_firmware.control.trim import COUNT
from bubble_protocol.schema import errors, messages, system
from bubble_protocol.schema.modes import IDLE

_NO_ELEMENT = 255


class StoreRequests:
    """The handlers of `session` for the store and the figures of `app`."""

    def __init__(self, app, session):
        self._app = app
        self._session = session
        session.capabilities |= system.STORE
        session.serve(
            {
                messages.STORE_SAVE: self._save,
                messages.STORE_INFO: self._info,
                messages.STORE_RESET: self._reset,
                messages.TRIM_WRITE: self._figures_write,
                messages.TRIM_READ: self._figures_read,
            }
        )

    def _save(self, count):
        if self._vented():
            self._answer(self._pause() and self._app.store.save())

    def _reset(self, count):
        if self._vented():
            self._answer(self._pause() and self._app.store.reset())

    def _info(self, count):
        self._answer(True)

    def _figures_write(self, count):
        app = self._app
        session = self._session
        values = session._values
        if count != app.board.BUBBLES:
            session._refuse(errors.WRONG_COUNT, 0, _NO_ELEMENT, count, app.board.BUBBLES, app.board.BUBBLES)
            return
        if not self._vented():
            return
        flaw = app.figures.first_flaw(values)
        if flaw >= 0:
            number = flaw % COUNT
            low = app.figures.low[number]
            session._refuse(errors.OUT_OF_RANGE, number, flaw // COUNT, values[flaw], low, app.figures.high[number])
            return
        app.figures.use(values)
        session._acknowledge()

    def _figures_read(self, count):
        self._app.figures.read(self._session._values)
        self._session._reply(self._app.board.BUBBLES)

    def _vented(self):
        """Whether all bubbles are vented; refuses where they are not."""
        safety = self._app.safety
        if safety.control_mode == IDLE:
            return True
        self._session._refuse(errors.NOT_VENTED, 0, _NO_ELEMENT, safety.mode, IDLE, IDLE)
        return False

    def _pause(self):
        """Bring all outputs to where they may stay for as long as flash takes; False where there is no flash."""
        app = self._app
        if not app.store.capacity:
            return False
        app.self_test.skip()
        app.hands.vent()  # the pump, too
        app.hands.slack()
        return True

    def _answer(self, done):
        store = self._app.store
        session = self._session
        if not done:
            session._refuse(store.error, 0, _NO_ELEMENT, store.states[0] | store.states[1] << 8, 0, 0)
            return
        values = session._values
        values[0] = store.source
        values[1] = store.generation
        values[2] = store.schema
        values[3] = store.states[0]
        values[4] = store.states[1]
        values[5] = store.wear[0]
        values[6] = store.wear[1]
        values[7] = store.length
        values[8] = store.capacity
        values[9] = store.tables_crc
        values[10] = store.error
        session._reply(0)
