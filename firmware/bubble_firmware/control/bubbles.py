"""All bubbles of a board: their state, and what the rest of the firmware asks of them.

The state is one array of integers, a row per bubble, laid out in `control`, which computes on it.
"""

from array import array

from bubble_firmware.control import curve
from bubble_firmware.control import step as control
from bubble_firmware.control.table import KNOTS_MAX
from bubble_protocol.mpy_compat import const

_ONE = const(32768)  # a whole way, in the shares of `advance`


class Bubbles:
    """The bubbles of `board`. `pulses` are fill and vent µs of every bubble in the next period.

    `step(counts, supply_pa, mode)` is the work of one tick: sensor counts in, estimates and `pulses` out.
    """

    def __init__(self, board, tables):
        n = board.BUBBLES
        self.count = n
        self.pulses = array("H", bytearray(4 * n))
        curves = control.ROWS + control.ROW * n
        # Made of a range, an array comes into being once; of a bytearray, twice, and there is no room for that.
        state = array("i", range(curves + control.KNOT * curve.KNOTS_MAX * n))
        for index in range(curves):
            state[index] = 0
        view = memoryview(state)
        self._board = state
        self._rows = view[control.ROWS : curves]
        self._curves = view[curves:]
        self._tables = tables
        self._dead = 64 * board.DEAD_VOLUME_MM3
        self.rows, self.board = self._rows, self._board  # the guard looks at them
        k = state
        k[control.N] = n
        k[control.TICK_US] = board.TICK_US
        k[control.PA_PER_COUNT] = board.SENSOR_PA_PER_COUNT
        k[control.COUNT_LOW] = board.COUNT_LOW
        k[control.COUNT_HIGH] = board.COUNT_HIGH
        k[control.REST_UM] = board.HEIGHT_REST_UM
        k[control.PRESSURE_MAX] = board.PRESSURE_MAX_PA
        k[control.FILL_MAX_US] = board.FILL_MAX_US
        k[control.PULSE_MIN_US] = board.PULSE_MIN_US
        k[control.QUIET_US] = board.QUIET_US
        k[control.TUBE] = board.TUBE_PA_PER_FLOW
        k[control.GAIN_P] = board.GAIN_P
        k[control.GAIN_I] = board.GAIN_I
        k[control.GAIN_D] = board.GAIN_D
        k[control.DEADBAND_UM] = board.DEADBAND_UM
        k[control.SETTLED_UM] = board.SETTLED_UM
        k[control.RAMP_DONE] = k[control.RAMP_TICKS] = 1
        k[control.RAMP_SHARE] = 4096
        for index, root in enumerate(curve.roots(board.CRITICAL_RATIO)):
            k[control.ROOTS + index] = root
        row = self._rows
        for at in range(0, n * control.ROW, control.ROW):
            row[at + control.ZERO] = board.SENSOR_ZERO
            row[at + control.OPENS_US] = board.VALVE_OPENS_US
            row[at + control.CLOSES_US] = board.VALVE_CLOSES_US
            row[at + control.FLOW_GAIN] = control.flow_gain(board)
            row[at + control.TARGET] = row[at + control.START] = board.HEIGHT_REST_UM
            row[at + control.HEIGHT] = row[at + control.SETPOINT] = board.HEIGHT_REST_UM << 4
            row[at + control.WAIT] = -1
        self.use_tables()
        for at in range(0, n * control.ROW, control.ROW):
            row[at + control.AIR] = self._curves[row[at + control.FIRST] // 4 + control.A]

        # A default is a local: an attribute costs the chip 2.5 µs. More than 11 locals and values, and a call allocates.
        def step(counts, supply_pa, mode, work=(control.step, row, state, self.pulses)):
            work[0](work[1], work[2], counts, work[3], supply_pa, mode)

        self.step = step

    def use_tables(self):
        """Take up the tables in use, after a commit. The air stays; what height it means is found anew."""
        row = self._rows
        stride = control.KNOT * curve.KNOTS_MAX
        for i in range(self.count):
            at = i * control.ROW
            first = i * stride
            size = curve.build(
                self._curves, self._tables.knots, first, i * KNOTS_MAX, self._tables.sizes[i], self._dead
            )
            row[at + control.FIRST] = 4 * first
            row[at + control.LAST] = 4 * (first + control.KNOT * (size - 2))
            row[at + control.LOWEST], row[at + control.HIGHEST] = self._tables.pressures(i)
            row[at + control.HEIGHT + control.SEGMENT] = row[at + control.SETPOINT + control.SEGMENT] = 4 * first
            row[at + control.CALM] = row[at + control.COAST] = 0
            row[at + control.RAMPING] = 1  # the setpoint's air is to be found again

    def show(self, values, first, ticks):
        """Ramp every bubble from where it is to the height (µm) in `values[first:]` within `ticks` ticks."""
        control.aim(self._rows, values, first, self.count)
        self._ramp(ticks)

    def begin(self, words, at, from_height):
        """Begin a step of a sequence, whose targets (µm) are `words[at:]`; `advance` moves it on."""
        control.aim_on(self._rows, words, at, self.count, from_height, self._board[control.REST_UM])
        self._ramp(_ONE)

    def advance(self, share):
        """Let the setpoints be `share`/32768 of their way at the end of this period. `step` adds the last one."""
        self._board[control.RAMP_DONE] = share - 1

    def unsettled(self, tolerance):
        """The bubbles, as bits, that are further than `tolerance` µm from their targets."""
        return control.unsettled(self._rows, self.count, tolerance, self._board[control.REST_UM])

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

    def figure(self, bubble, number):
        """One of the figures of a bubble, see `figures`."""
        return self._rows[bubble * control.ROW + number]

    def set_figure(self, bubble, number, value):
        """Take up one of the figures of a bubble."""
        self._rows[bubble * control.ROW + number] = value

    def pressure_pa(self, bubble):
        """Gauge pressure of one bubble."""
        return self._rows[bubble * control.ROW + control.PRESSURE]

    def faults(self, bubble):
        """Fault bits of one bubble."""
        return self._rows[bubble * control.ROW + control.FAULTS]

    def report(self, values, at):
        """Put the repeated fields of STATE at `values[at:]`."""
        control.gather(self._rows, values, at, self.count)

    def pick(self, values, plan, at, columns):
        """Put chosen words of every bubble's row at `values[at:]`, see `control.pick`; returns how many."""
        control.pick(self._rows, values, plan, at, columns, self.count)
        return columns * self.count
