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

    def first_invalid(self, values: "array[int]", at: int = 0, count: int = -1) -> int:
        """Where in the whole trims of `count` bubbles in `values[at:]`, or of all, a number stands that the board does not allow.

        -1 where there is none.
        """
        for index in range(COUNT * (self._bubbles.count if count < 0 else count)):
            value = values[at + index]
            if value < self.low[index % COUNT] or value > self.high[index % COUNT]:
                return index
        return -1

    def use(self, values: "array[int]", at: int = 0, first: int = 0, count: int = -1) -> None:
        """Take up the whole trims of `count` bubbles from number `first` on, or of all, in `values[at:]`."""
        for index in range(COUNT * (self._bubbles.count if count < 0 else count)):
            self._bubbles.set_trim(first + index // COUNT, index % COUNT, values[at + index])

    def use_nominal(self) -> None:
        """Take up the board's."""
        for at in range(COUNT * self._bubbles.count):
            self._bubbles.set_trim(at // COUNT, at % COUNT, self.nominal[at % COUNT])

    def widen(self, values: "array[int]") -> None:
        """Make trims of both valves, `SHORT` numbers a bubble in `values`, whole ones: both alike, as sure as the board's."""
        for bubble in range(self._bubbles.count - 1, -1, -1):
            at = bubble * SHORT
            to = bubble * COUNT
            zero, opens, closes, gain = values[at], values[at + 1], values[at + 2], values[at + 3]
            for number in range(COUNT):
                values[to + number] = self.nominal[number]
            values[to] = zero
            values[to + 1] = values[to + 4] = opens
            values[to + 2] = values[to + 5] = closes
            values[to + 3] = values[to + 6] = gain

    def read_short(self, values: "array[int]") -> None:
        """Put the first `SHORT` numbers of all bubbles in `values`: those of the fill valves."""
        for at in range(SHORT * self._bubbles.count):
            values[at] = self._bubbles.trim(at // SHORT, at % SHORT)

    def read(self, values: "array[int]", at: int = 0, first: int = 0, count: int = -1) -> None:
        """Put the whole trims of `count` bubbles from number `first` on, or of all, in `values[at:]`."""
        for index in range(COUNT * (self._bubbles.count if count < 0 else count)):
            values[at + index] = self._bubbles.trim(first + index // COUNT, index % COUNT)
