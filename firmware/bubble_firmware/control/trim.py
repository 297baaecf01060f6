"""Trim: what sets one bubble apart besides its table: its sensor's zero, its valves' dead times and flows, and how sure that is.

Ten numbers a bubble, the first of its row, see `state_layout`. Without better knowledge they are the board's. What is taken up
is within limits around the board's own: a zero that is off moves the pressure limit by as much.
"""

from array import array

from bubble_firmware.control.flow import flow_gain
from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles

COUNT = 10  # zero in counts; opens_us, closes_us, gain of the fill and of the vent valve; flow_sd, curve_sd, leak
SHORT = 4  # of a trim that is of both valves: the first of these
ZERO_PA = 1500  # as far as a good sensor's zero may be off
SD_MAX = 16384  # a quarter
LEAK_MAX = 8192  # µJ/s per kPa, *16: a tenth of a full bubble's air in a second


class Trim:
    """The trim of `bubbles`; values stand in arrays of integers, `COUNT` for every bubble."""

    def __init__(self, board: "ModuleType", bubbles: "Bubbles"):
        self._bubbles = bubbles
        off = ZERO_PA // board.SENSOR_PA_PER_COUNT
        dead_us = board.TICK_US // 2
        gain = flow_gain(board)
        opens, closes = board.VALVE_OPENS_US, board.VALVE_CLOSES_US
        known = board.FLOW_SD, board.CURVE_SD, 0
        self.nominal = array("i", (board.SENSOR_ZERO, opens, closes, gain, opens, closes, gain) + known)
        low = 0, 0, gain * 3 // 4
        self.low = array("i", (max(board.SENSOR_ZERO - off, board.COUNT_LOW + 1),) + low + low + (0, 0, 0))
        high = dead_us, dead_us, min(gain * 4 // 3, 65535)
        self.high = array("i", (board.SENSOR_ZERO + off,) + high + high + (SD_MAX, SD_MAX, LEAK_MAX))

    # A function with more than eleven locals and values at a time would allocate: one bubble at a time, then.

    def invalid(self, values: "array[int]", at: int) -> int:
        """Which number of the whole trim at `values[at:]` the board does not allow, -1 where it allows all."""
        for number in range(COUNT):
            value = values[at + number]
            if value < self.low[number] or value > self.high[number]:
                return number
        return -1

    def use(self, values: "array[int]", at: int, bubble: int) -> None:
        """Take up the whole trim at `values[at:]` for one bubble."""
        for number in range(COUNT):
            self._bubbles.set_trim(bubble, number, values[at + number])

    def read(self, values: "array[int]", at: int, bubble: int) -> None:
        """Put the whole trim of one bubble at `values[at:]`."""
        for number in range(COUNT):
            values[at + number] = self._bubbles.trim(bubble, number)

    def widen(self, values: "array[int]", at: int, to: int) -> None:
        """Make the `SHORT` numbers at `values[at:]` a whole trim at `values[to:]`: both valves alike, as sure as the board's.

        `to` is not below `at`.
        """
        values[to + 3] = values[to + 6] = values[at + 3]
        values[to + 2] = values[to + 5] = values[at + 2]
        values[to + 1] = values[to + 4] = values[at + 1]
        values[to] = values[at]
        for number in range(2 * SHORT - 1, COUNT):
            values[to + number] = self.nominal[number]

    def use_nominal(self) -> None:
        """Take up the board's."""
        for bubble in range(self._bubbles.count):
            self.use(self.nominal, 0, bubble)

    def number(self, bubble: int, number: int) -> int:
        """One number of one bubble's trim."""
        return self._bubbles.trim(bubble, number)
