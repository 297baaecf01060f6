# mypy: disable-error-code="method-assign"
"""Hardware of which parts fail because a host has asked for it, around the hardware that is there."""

from array import array

from bubble_firmware.hal.base import Hal
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

# [constants] bubble_protocol.schema.injection: FILL_SHUT PUMP_OFF SENSOR_HIGH SENSOR_MISSING SENSOR_STUCK SUPPLY_EMPTY
# [constants] bubble_protocol.schema.injection: SUPPLY_MISSING VENT_OPEN
# [constants] bubble_firmware.hal.base: ABSENT
_FILL_SHUT = const(4)
_PUMP_OFF = const(8)
_SENSOR_HIGH = const(3)
_SENSOR_MISSING = const(1)
_SENSOR_STUCK = const(2)
_SUPPLY_EMPTY = const(7)
_SUPPLY_MISSING = const(6)
_VENT_OPEN = const(5)
_ABSENT = const(65535)
# [end of constants]

_HIGH_PA = const(3000)
_COUNT_MAX = const(4095)


class FailingHal(Hal):
    """What a tick senses and does on `hal`, and what fails of it; all else goes by `hal` itself.

    It makes things worse in safe ways only: no fill valve gets a longer pulse than was decided, no vent valve a shorter one.
    """

    def __init__(self, board: "ModuleType", hal: "Hal"):
        super().__init__(board)
        self.active_faults = 0
        self._hal = hal
        self.wait = hal.wait
        self.phase_us = hal.phase_us
        self.feed_watchdog = hal.feed_watchdog
        self.idle = hal.idle
        self._high = _HIGH_PA // board.SENSOR_PA_PER_COUNT
        self._tick_us: int = board.TICK_US
        self._failing = array("i", bytearray(4 * (_PUMP_OFF + 1)))  # bubbles that fail so, as bits
        self._stuck = array("H", bytearray(2 * board.BUBBLES))  # what they say, ABSENT until the next tick has read it
        self._pulses = array("H", bytearray(4 * board.BUBBLES))  # a copy: the firmware goes on from what it has decided

    def fail(self, failure: int, bubble: int, on: int) -> None:
        """From the next tick on this failure, of the schema's injections, is there; with `on` 0 it is not."""
        failing = self._failing
        failing[failure] &= ~(1 << bubble)
        if on:
            failing[failure] |= 1 << bubble
            self._stuck[bubble] = _ABSENT

    def mend(self) -> None:
        """Nothing fails any more."""
        for failure in range(len(self._failing)):
            self._failing[failure] = 0

    def read_sensors(self, counts: "array[int]") -> None:
        """What there is, but for what fails."""
        self._hal.read_sensors(counts)
        self.active_faults = self._hal.active_faults
        failing = self._failing
        stuck = self._stuck
        for bubble in range(self.board.BUBBLES):
            bit = 1 << bubble
            if failing[_SENSOR_STUCK] & bit:
                if stuck[bubble] == _ABSENT:
                    stuck[bubble] = counts[bubble]
                counts[bubble] = stuck[bubble]
            if failing[_SENSOR_HIGH] & bit and counts[bubble] != _ABSENT:
                counts[bubble] = min(counts[bubble] + self._high, _COUNT_MAX)
            if failing[_SENSOR_MISSING] & bit:
                counts[bubble] = 0
        if failing[_SUPPLY_MISSING]:
            counts[self.board.BUBBLES] = 0

    def write_outputs(self, pulses: "array[int]", pump: int, dump: int) -> None:
        """What was decided, but for what fails."""
        failing = self._failing
        done = self._pulses
        for bubble in range(self.board.BUBBLES):
            bit = 1 << bubble
            done[2 * bubble] = 0 if failing[_FILL_SHUT] & bit else pulses[2 * bubble]
            done[2 * bubble + 1] = self._tick_us if failing[_VENT_OPEN] & bit else pulses[2 * bubble + 1]
        if failing[_PUMP_OFF] or failing[_SUPPLY_EMPTY]:
            pump = 0
        if failing[_SUPPLY_EMPTY]:
            dump = 1
        self._hal.write_outputs(done, pump, dump)
