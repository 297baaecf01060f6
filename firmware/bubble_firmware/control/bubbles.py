# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""All bubbles of a board: their state, and what the rest of the firmware asks of them.

The state is one array of integers, laid out in `state_layout`. Three passes over all bubbles compute on it in every tick:
`estimate`, `trajectory` and `dose`.
"""

from array import array

from bubble_firmware.control import curve, flow, reference, trajectory
from bubble_firmware.control.dose import dose
from bubble_firmware.control.estimate import deviations, estimate, restart
from bubble_firmware.control.table import KNOTS_MAX
from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr32, uint

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType
    from typing import Any

    from bubble_firmware.control.table import Tables
    from bubble_protocol.mpy_compat import Words

# [constants] bubble_firmware.control.state_layout: used
_SENSOR_ZERO = const(0)
_FILL_OPENS_US = const(1)
_FILL_CLOSES_US = const(2)
_FILL_GAIN = const(3)
_VENT_OPENS_US = const(4)
_VENT_CLOSES_US = const(5)
_VENT_GAIN = const(6)
_FLOW_SD = const(7)
_CURVE_SD = const(8)
_PRESSURE = const(10)
_QUIESCENT = const(12)
_AIR = const(16)
_STATUS = const(25)
_HEIGHT = const(26)
_HEIGHT_SEGMENT = const(27)
_RAMPING = const(30)
_SETPOINT = const(33)
_FAULTS = const(36)
_TARGET = const(37)
_SETPOINT_SEGMENT = const(38)
_RAMP_START = const(42)
_FIRST_SEGMENT = const(44)
_LAST_SEGMENT = const(45)
_AIR_SD = const(49)
_CURVE_ERROR_SD = const(51)
_HEIGHT_SD = const(53)
_DWELL_SLOPE = const(56)
_ROW_WORDS = const(70)
_KNOT_VOLUME = const(1)
_KNOT_WORDS = const(6)
_BUBBLE_COUNT = const(0)
_TICK_US = const(1)
_PA_PER_COUNT = const(2)
_COUNT_LOW = const(3)
_COUNT_HIGH = const(4)
_PRESSURE_MAX = const(5)
_FILL_MAX_US = const(6)
_PULSE_MIN_US = const(7)
_QUIET_US = const(8)
_TUBE_PA = const(9)
_GAIN_P = const(10)
_GAIN_D = const(11)
_DEADBAND_UM = const(12)
_SETTLED_UM = const(13)
_REST_UM = const(14)
_RAMP_DONE = const(16)
_RAMP_TICKS = const(17)
_RAMP_SHARE = const(18)
_SECOND = const(22)
_ATMOSPHERE_PA = const(23)
_SURE_UM = const(24)
_REZERO_UM = const(25)
_LEAK_SHARE = const(26)
_ROOTS = const(27)
_ROOT_STEPS = const(64)
_ROWS = const(157)
_ATMOSPHERE = const(101325)
_RESTART = const(256)
# [end of constants]

_WHOLE_WAY = const(32768)  # in the shares of `advance`


@micropython.viper
def _pack(row: ptr32, values: ptr32, at: int, fields: int, n: int):  # type: ignore[no-untyped-def]
    """Copy what is said of every bubble to `values[at:]`: the five fields of STATE and TELEMETRY, or the six of ESTIMATE."""
    while n > 0:
        values[at] = row[_HEIGHT] >> 4
        values[at + 1] = row[_PRESSURE]
        values[at + 2] = row[_TARGET]
        values[at + 3] = row[_STATUS]
        values[at + 4] = row[_FAULTS]
        if fields > 5:
            values[at + 5] = row[_HEIGHT_SD]
        at += fields
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


@micropython.viper
def _pack_fields(row: ptr32, values: ptr32, plan: ptr32, at: int, columns: int, n: int):  # type: ignore[no-untyped-def]
    """Copy the words of every row that `plan` names, shifted right by what stands 9 words after each name."""
    while n > 0:
        i = 0
        while i < columns:
            values[at] = row[plan[i]] >> plan[i + 9]
            at += 1
            i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
        n -= 1


class Bubbles:
    """The bubbles of `board`. `pulses` are fill and vent µs of every bubble in the next period.

    `step(counts, supply_pa, control_mode)` is the work of one tick: sensor counts in, estimates and `pulses` out.
    `state` is everything, `rows` and `curves` are its parts, for whoever knows `state_layout`.
    """

    def __init__(self, board: "ModuleType", tables: "Tables"):
        n = board.BUBBLES
        self.count = n
        self.pulses = array("H", bytearray(4 * n))
        curves = _ROWS + _ROW_WORDS * n
        # Made of a range, an array comes into being once; of a bytearray, twice, and there is no room for that.
        state = array("i", range(curves + _KNOT_WORDS * curve.KNOTS_MAX * n))
        for index in range(curves):
            state[index] = 0
        view = memoryview(state)
        self.state = state
        self.rows = view[_ROWS:curves]
        self.curves = view[curves:]
        self._tables = tables
        self._dead_volume = 65536 * board.DEAD_VOLUME_MM3 // 1000
        self._take_up_board(board)
        self.use_tables()
        rows = self.rows
        for at in range(0, n * _ROW_WORDS, _ROW_WORDS):
            rows[at + _AIR] = (_ATMOSPHERE >> 4) * self.curves[rows[at + _FIRST_SEGMENT] // 4 + _KNOT_VOLUME] >> 12

        def refer(
            found: int,
            rows: memoryview = self.rows,
            state: "array[int]" = state,
            compare: "Callable[..., int]" = reference.compare,
        ) -> None:
            """What is seldom to be done between `estimate` and what follows it."""
            if found >= _RESTART:
                restart(rows, state)
                found -= _RESTART
            if found and compare(rows, state, found):
                reference.fade(rows, state, found)
                reference.correct(rows, state, found)

        # A default is a local: an attribute costs the chip 2.5 µs. More than 11 locals and values, and a call allocates.
        work = (self.state, estimate, trajectory.move_setpoints, dose, self.pulses)

        def step(
            counts: "array[int]",
            supply_pa: int,
            control_mode: int,
            rows: memoryview = self.rows,
            work: "tuple[Any, ...]" = work,
            refer: "Callable[[int], None]" = refer,
        ) -> None:
            found = work[1](rows, work[0], counts, supply_pa, control_mode)
            if found:
                refer(found)
            work[2](rows, work[0])
            work[3](rows, work[0], work[4], control_mode)

        self.step = step

    def _take_up_board(self, board: "ModuleType") -> None:
        state = self.state
        state[_BUBBLE_COUNT] = self.count
        state[_TICK_US] = board.TICK_US
        state[_PA_PER_COUNT] = board.SENSOR_PA_PER_COUNT
        state[_COUNT_LOW] = board.COUNT_LOW
        state[_COUNT_HIGH] = board.COUNT_HIGH
        state[_REST_UM] = board.HEIGHT_REST_UM
        state[_PRESSURE_MAX] = board.PRESSURE_MAX_PA
        state[_FILL_MAX_US] = board.FILL_MAX_US
        state[_PULSE_MIN_US] = board.PULSE_MIN_US
        state[_QUIET_US] = board.QUIET_US
        state[_TUBE_PA] = board.TUBE_PA_PER_FLOW
        state[_GAIN_P] = board.GAIN_P
        state[_GAIN_D] = board.GAIN_D
        state[_DEADBAND_UM] = board.DEADBAND_UM
        state[_SETTLED_UM] = board.SETTLED_UM
        state[_RAMP_DONE] = state[_RAMP_TICKS] = 1
        state[_RAMP_SHARE] = 4096
        state[_SECOND] = 1000000 // board.TICK_US
        state[_SURE_UM] = board.SURE_UM
        state[_LEAK_SHARE] = 1000000000 // board.TICK_US
        state[_ATMOSPHERE_PA] = _ATMOSPHERE
        self._critical = board.CRITICAL_RATIO
        flow.fill_roots(state, _ROOTS, self._critical)
        flow.vent_roots(state, _ROOTS + _ROOT_STEPS + 1, self._critical, _ATMOSPHERE)
        rows = self.rows
        for at in range(0, self.count * _ROW_WORDS, _ROW_WORDS):
            rows[at + _SENSOR_ZERO] = board.SENSOR_ZERO
            rows[at + _FILL_OPENS_US] = rows[at + _VENT_OPENS_US] = board.VALVE_OPENS_US
            rows[at + _FILL_CLOSES_US] = rows[at + _VENT_CLOSES_US] = board.VALVE_CLOSES_US
            rows[at + _FILL_GAIN] = rows[at + _VENT_GAIN] = flow.flow_gain(board)
            rows[at + _FLOW_SD] = board.FLOW_SD
            rows[at + _CURVE_SD] = rows[at + _CURVE_ERROR_SD] = board.CURVE_SD
            rows[at + _AIR_SD] = 200
            rows[at + _TARGET] = rows[at + _RAMP_START] = board.HEIGHT_REST_UM
            rows[at + _HEIGHT] = rows[at + _SETPOINT] = board.HEIGHT_REST_UM << 4

    def use_tables(self) -> None:
        """Take up the tables in use, after a commit. The air stays; what height it means is found anew."""
        rows = self.rows
        stride = _KNOT_WORDS * curve.KNOTS_MAX
        for i in range(self.count):
            at = i * _ROW_WORDS
            first = i * stride
            knots = curve.build(
                self.curves, self._tables.knots, first, i * KNOTS_MAX, self._tables.sizes[i], self._dead_volume
            )
            rows[at + _FIRST_SEGMENT] = 4 * first
            rows[at + _LAST_SEGMENT] = 4 * (first + _KNOT_WORDS * (knots - 2))
            rows[at + _HEIGHT_SEGMENT] = rows[at + _SETPOINT_SEGMENT] = 4 * first
            rows[at + _QUIESCENT] = rows[at + _DWELL_SLOPE] = 0
            rows[at + _RAMPING] = 1  # the setpoint's air is to be found again

    def set_atmosphere(self, pressure_pa: int, rezero_um: int) -> None:
        """Take up the pressure of the air around, and how well a height must be known for its bubble not to be emptied first."""
        state = self.state
        if state[_ATMOSPHERE_PA] != pressure_pa:
            state[_ATMOSPHERE_PA] = pressure_pa
            flow.vent_roots(state, _ROOTS + _ROOT_STEPS + 1, self._critical, pressure_pa)
        state[_REZERO_UM] = rezero_um

    def set_targets(self, heights: "Words", at: int, ticks: int) -> None:
        """Ramp every bubble from where it is to the height (µm) in `heights[at:]` within `ticks` ticks."""
        deviations(self.rows, self.state)
        trajectory.set_targets(self.rows, heights, at, self.count, self.state[_REZERO_UM] if ticks <= 1 else 0)
        self._ramp(ticks)

    def begin_step(self, words: bytearray, at: int, from_height: int) -> None:
        """Begin a step of a sequence, whose targets (µm) are `words[at:]`; `advance` moves it on."""
        trajectory.set_next_targets(self.rows, words, at, self.count, from_height, self.state[_REST_UM])
        self._ramp(_WHOLE_WAY)

    def advance(self, share: int) -> None:
        """Let the setpoints be `share`/32768 of their way at the end of this period. `step` adds the last one."""
        self.state[_RAMP_DONE] = share - 1

    def unsettled(self, tolerance: int) -> int:
        """The bubbles, as bits, that are further than `tolerance` µm from their targets."""
        return trajectory.unsettled(self.rows, self.count, tolerance, self.state[_REST_UM])

    def hold_position(self) -> None:
        """Where the bubbles are is where they are wanted."""
        trajectory.hold_position(self.rows, self.count)
        self._ramp(1)

    def retract(self) -> None:
        """No bubble is wanted higher than it is without pressure."""
        trajectory.retract(self.rows, self.state[_REST_UM], self.count)
        self._ramp(1)

    def _ramp(self, ticks: int) -> None:
        self.state[_RAMP_DONE] = 0
        self.state[_RAMP_TICKS] = ticks

    def clear_faults(self, bubble: int) -> None:
        """Forget the faults of one bubble; what still is wrong faults again.

        What leads to a fault goes on counting: a host that clears all the time does not disarm the limits.
        """
        self.rows[bubble * _ROW_WORDS + _FAULTS] = 0

    def trim(self, bubble: int, number: int) -> int:
        """One of the trim values of a bubble, see `trim`."""
        return self.rows[bubble * _ROW_WORDS + number]

    def set_trim(self, bubble: int, number: int, value: int) -> None:
        """Take up one of the trim values of a bubble."""
        self.rows[bubble * _ROW_WORDS + number] = value

    def pressure_pa(self, bubble: int) -> int:
        """Gauge pressure of one bubble."""
        return self.rows[bubble * _ROW_WORDS + _PRESSURE]

    def faults(self, bubble: int) -> int:
        """Fault bits of one bubble."""
        return self.rows[bubble * _ROW_WORDS + _FAULTS]

    def pack_state(self, values: "Words", at: int) -> None:
        """Put the repeated fields of STATE at `values[at:]`."""
        _pack(self.rows, values, at, 5, self.count)

    def pack_estimate(self, values: "Words", at: int) -> None:
        """Put the repeated fields of ESTIMATE at `values[at:]`."""
        deviations(self.rows, self.state)
        _pack(self.rows, values, at, 6, self.count)

    def pack_fields(self, values: "Words", plan: "Words", at: int, columns: int) -> int:
        """Put chosen words of every bubble's row at `values[at:]`; returns how many.

        `plan` names `columns` words of a row, and from its tenth place on by how many bits each is shifted right.
        """
        deviations(self.rows, self.state)
        _pack_fields(self.rows, values, plan, at, columns, self.count)
        return columns * self.count
