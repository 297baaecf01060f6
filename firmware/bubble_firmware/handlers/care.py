"""Requests about safety: the fault log and the settings. Registered with the `Session`, whose rules hold here too."""

from bubble_firmware.safety.fault_log import FIELDS, SIZE
from bubble_protocol.mpy_compat import const
from bubble_protocol.schema import errors, messages
from bubble_protocol.schema.settings import DEADMAN_HOLD, DEADMAN_VENT

_ENTRIES_PER_MESSAGE = const(8)
_NO_ELEMENT = const(255)


class Care:
    """Handlers of FAULTS_READ, FAULTS_ACK, SETTING_READ and SETTING_WRITE, for one `App`."""

    def __init__(self, app, session):
        self._app = app
        self._session = session
        self._values = session._values

    def handlers(self):
        """What to add to the session's table."""
        return {
            messages.FAULTS_READ: self._faults_read,
            messages.FAULTS_ACK: self._faults_ack,
            messages.SETTING_READ: self._setting_read,
            messages.SETTING_WRITE: self._setting_write,
        }

    def _faults_read(self, count):
        log = self._app.log
        values = self._values
        number = log.oldest_after(values[0])
        values[0] = self._app.ticks
        values[1] = log.newest
        values[2] = log.acknowledged
        found = 0
        at = 3
        while number <= log.newest and found < _ENTRIES_PER_MESSAGE:
            entry = number % SIZE * FIELDS
            for field in range(FIELDS):
                values[at + field] = log.entries[entry + field]
            at += FIELDS
            number += 1
            found += 1
        self._session._reply(found)

    def _faults_ack(self, count):
        self._app.acknowledge(self._values[0])
        self._session._acknowledge()

    def _setting_read(self, count):
        settings = self._app.settings
        values = self._values
        values[0] = self._app.ticks
        values[1] = settings.version
        at = 2
        for number in range(settings.count):
            values[at] = number
            values[at + 1] = settings.values[number]
            values[at + 2] = settings.lows[number]
            values[at + 3] = settings.highs[number]
            at += 4
        self._session._reply(settings.count)

    def _setting_write(self, count):
        settings = self._app.settings
        values = self._values
        index = settings.flaw(values, 0, count)
        if index < 0:
            settings.use()
            self._app.use_settings()
            self._session._acknowledge()
        elif index == count:
            hold, vent = DEADMAN_HOLD, DEADMAN_VENT
            low = settings.wanted[hold]
            self._session._refuse(errors.OUT_OF_RANGE, 1, _NO_ELEMENT, settings.wanted[vent], low, settings.highs[vent])
        else:
            number = values[2 * index]
            if number >= settings.count:
                self._session._refuse(errors.NO_SETTING, 0, index, number, 0, settings.count - 1)
            else:
                low, high = settings.lows[number], settings.highs[number]
                self._session._refuse(errors.OUT_OF_RANGE, 1, index, values[2 * index + 1], low, high)
