"""All bubbles of a board: their state, and what the rest of the firmware asks of them.

The state is one array of integers, a row per bubble, laid out in `control`, which computes on it.
"""

from array import array

from bubble_firmware import control
from bubble_firmware.table import KNOTS_MAX


class Bubbles:
    """The bubbles of `board`: `sense` and `decide` are the tick's two halves, `pulses` is what comes out of them."""

    def __init__(self, board, tables):
        n = board.BUBBLES
        self.count = n
        self.pulses = array("H", bytearray(4 * n))
        self._rows = array("i", bytearray(4 * control.ROW * n))
        self._board = array("i", bytearray(4 * control.BOARD))
        self._tables = tables
        self._knots = tables.knots
        self.rows, self.board = self._rows, self._board  # the guard looks at them
        k = self._board
        k[control.N] = n
        k[control.TICK_US] = board.TICK_US
        k[control.PA_PER_COUNT] = board.SENSOR_PA_PER_COUNT
        k[control.COUNT_LOW] = board.COUNT_LOW
        k[control.COUNT_HIGH] = board.COUNT_HIGH
        k[control.DEAD_VOLUME] = 64 * board.DEAD_VOLUME_MM3
        k[control.REST_UM] = board.HEIGHT_REST_UM
        k[control.PRESSURE_MAX] = board.PRESSURE_MAX_PA
        k[control.FILL_MAX_US] = board.FILL_MAX_US
        k[control.PULSE_MIN_US] = board.PULSE_MIN_US
        k[control.QUIET_US] = board.QUIET_US
        k[control.CRITICAL] = board.CRITICAL_RATIO
        k[control.TUBE] = board.TUBE_PA_PER_FLOW
        k[control.GAIN_P] = board.GAIN_P
        k[control.GAIN_I] = board.GAIN_I
        k[control.GAIN_D] = board.GAIN_D
        k[control.DEADBAND_UM] = board.DEADBAND_UM
        k[control.SETTLED_UM] = board.SETTLED_UM
        k[control.KNOT_STRIDE] = 2 * KNOTS_MAX
        k[control.RAMP_DONE] = k[control.RAMP_TICKS] = 1
        row = self._rows
        for at in range(0, n * control.ROW, control.ROW):
            row[at + control.ZERO] = board.SENSOR_ZERO
            row[at + control.OPENS_US] = board.VALVE_OPENS_US
            row[at + control.CLOSES_US] = board.VALVE_CLOSES_US
            # C (1e-6 dm³/(s bar)) 1e-14 SI, times 1e5 Pa (ANR) 8 Pa/(1 - b), W to µJ/ms, *65536
            row[at + control.FLOW_GAIN] = board.CONDUCTANCE * 1342 // (10 * (256 - board.CRITICAL_RATIO))
            row[at + control.TARGET] = row[at + control.START] = board.HEIGHT_REST_UM
            row[at + control.HEIGHT] = row[at + control.SETPOINT] = board.HEIGHT_REST_UM << 4
            row[at + control.ROOT] = 10000
        self.use_tables()
        for at in range(0, n * control.ROW, control.ROW):
            row[at + control.AIR] = row[at + control.HEIGHT + control.CONTENT]

    def use_tables(self):
        """Take up the tables in use, after a commit. The air stays; what height it means is found anew."""
        row = self._rows
        for i in range(self.count):
            at = i * control.ROW
            row[at + control.KNOTS] = self._tables.sizes[i]
            row[at + control.LOWEST], row[at + control.HIGHEST] = self._tables.pressures(i)
            for record in (at + control.HEIGHT, at + control.SETPOINT):
                row[record + control.SEGMENT] = 0
                row[record + control.WEIGHED] = -1
        control.weigh(self._rows, self._board, self._tables.knots)

    def sense(self, counts, supply_pa, mode):
        """The tick's first half: sensor counts in, heights and air estimated."""
        control.estimate(self._rows, self._board, self._knots, counts, supply_pa, mode)

    def decide(self):
        """The tick's second half: the setpoint moved on, `pulses` for the next period."""
        control.weigh(self._rows, self._board, self._knots)
        control.control(self._rows, self._board, self.pulses)

    def show(self, values, first, ticks):
        """Ramp every bubble from where it is to the height (µm) in `values[first:]` within `ticks` ticks."""
        control.aim(self._rows, values, first, self.count)
        self._ramp(ticks)

    def _ramp(self, ticks):
        self._board[control.RAMP_DONE] = 0
        self._board[control.RAMP_TICKS] = ticks

    def hold(self):
        """Where the bubbles are is where they are wanted."""
        control.hold(self._rows, self.count)
        self._ramp(1)

    def rest(self):
        """No bubble is wanted higher than it is without pressure."""
        control.rest(self._rows, self._board[control.REST_UM], self.count)
        self._ramp(1)

    def clear_faults(self):
        """Forget all faults; what still is wrong faults again.

        What leads to a fault goes on counting: a host that clears all the time does not disarm the guard.
        """
        control.forget(self._rows, self.count)

    def forget(self, bubble):
        """The same for one bubble."""
        self._rows[bubble * control.ROW + control.FAULTS] = 0

    def pressure_pa(self, bubble):
        """Gauge pressure of one bubble."""
        return self._rows[bubble * control.ROW + control.PRESSURE]

    def faults(self, bubble):
        """Fault bits of one bubble."""
        return self._rows[bubble * control.ROW + control.FAULTS]

    def report(self, values, at):
        """Put the repeated fields of STATE at `values[at:]`."""
        control.gather(self._rows, values, at, self.count)
