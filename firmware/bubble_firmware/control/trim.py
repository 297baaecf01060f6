"""Trim: what sets one bubble apart besides its table: its sensor's zero, its valves' dead times, its restrictor's flow.

Four numbers a bubble, the first of its row, see `state_layout`. Without better knowledge they are the board's. What is taken up
is within limits around the board's own: a zero that is off moves the pressure limit by as much.
"""

from array import array

from bubble_firmware.control.flow import flow_gain
from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles

COUNT = 4  # zero in counts, opens_us, closes_us, flow_gain
ZERO_PA = 1500  # as far as a good sensor's zero may be off


class Trim:
    """The trim of `bubbles`; values stand in arrays of integers, `COUNT` for every bubble."""

    def __init__(self, board: "ModuleType", bubbles: "Bubbles"):
        self._bubbles = bubbles
        off = ZERO_PA // board.SENSOR_PA_PER_COUNT
        dead_us = board.TICK_US // 2
        gain = flow_gain(board)
        self.nominal = array("i", (board.SENSOR_ZERO, board.VALVE_OPENS_US, board.VALVE_CLOSES_US, gain))
        self.low = array("i", (max(board.SENSOR_ZERO - off, board.COUNT_LOW + 1), 0, 0, gain * 3 // 4))
        self.high = array("i", (board.SENSOR_ZERO + off, dead_us, dead_us, min(gain * 4 // 3, 65535)))

    def first_invalid(self, values: "array[int]") -> int:
        """Where in `values` the first number stands that the board does not allow, -1 where there is none."""
        for at in range(COUNT * self._bubbles.count):
            if values[at] < self.low[at % COUNT] or values[at] > self.high[at % COUNT]:
                return at
        return -1

    def use(self, values: "array[int]") -> None:
        """Take up the trim of all bubbles."""
        for at in range(COUNT * self._bubbles.count):
            self._bubbles.set_trim(at // COUNT, at % COUNT, values[at])

    def use_nominal(self) -> None:
        """Take up the board's."""
        for at in range(COUNT * self._bubbles.count):
            self._bubbles.set_trim(at // COUNT, at % COUNT, self.nominal[at % COUNT])

    def read(self, values: "array[int]") -> None:
        """Put the trim of all bubbles in `values`."""
        for at in range(COUNT * self._bubbles.count):
            values[at] = self._bubbles.trim(at // COUNT, at % COUNT)
