"""What sets one bubble apart besides its table: its sensor's zero, its valves' dead times, its restrictor's flow.

Four numbers a bubble, the first of its row, see `state_layout`. Without better knowledge they are the board's. What is taken up
is within limits of the board's own figures: a zero that is off moves the pressure limit by as much.
"""

from array import array

from bubble_firmware.control.flow import flow_gain

COUNT = 4  # zero in counts, opens_us, closes_us, flow_gain
ZERO_PA = 1500  # as far as a good sensor's zero may be off


class Trim:
    """The figures of `bubbles`; values stand in arrays of integers, `COUNT` for every bubble."""

    def __init__(self, board, bubbles):
        self._bubbles = bubbles
        off = ZERO_PA // board.SENSOR_PA_PER_COUNT
        dead_us = board.TICK_US // 2
        gain = flow_gain(board)
        self.nominal = array("i", (board.SENSOR_ZERO, board.VALVE_OPENS_US, board.VALVE_CLOSES_US, gain))
        self.low = array("i", (max(board.SENSOR_ZERO - off, board.COUNT_LOW + 1), 0, 0, gain // 4))
        self.high = array("i", (board.SENSOR_ZERO + off, dead_us, dead_us, min(4 * gain, 65535)))

    def first_flaw(self, values):
        """Where in `values` the first figure stands that the board does not allow, -1 where there is none."""
        for at in range(COUNT * self._bubbles.count):
            if values[at] < self.low[at % COUNT] or values[at] > self.high[at % COUNT]:
                return at
        return -1

    def use(self, values):
        """Take up the figures of all bubbles."""
        for at in range(COUNT * self._bubbles.count):
            self._bubbles.set_trim(at // COUNT, at % COUNT, values[at])

    def use_nominal(self):
        """Take up the board's."""
        for at in range(COUNT * self._bubbles.count):
            self._bubbles.set_trim(at // COUNT, at % COUNT, self.nominal[at % COUNT])

    def read(self, values):
        """Put the figures of all bubbles in `values`."""
        for at in range(COUNT * self._bubbles.count):
            values[at] = self._bubbles.trim(at // COUNT, at % COUNT)
