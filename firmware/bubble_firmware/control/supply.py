# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""The reservoir: its pressure, how hard the pump works to keep it, and whether it is lost."""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr32

if TYPE_CHECKING:
    from types import ModuleType

_PATIENCE_US = 5000000  # at boot: an empty reservoir is full in two seconds
_DIP_US = 2000000  # later: nineteen bubbles that rise at once take it below what is needed for 0.8 s

_DUTY_PER_PA = const(32)  # full duty of 65535 at 2 kPa below the setpoint
_HEADROOM_PA = const(500)  # the proportional droop at rest, so that the reservoir stands at its nominal pressure

# The state.
_PRESSURE = const(0)
_PUMP = const(1)
_DUMP = const(2)
_BEGUN = const(3)  # whether there has been a reading
_LOW = const(4)  # ticks in a row without the pressure that is needed
# The board's numbers.
_COUNT_LOW = const(5)
_COUNT_HIGH = const(6)
_ZERO = const(7)
_PA_PER_COUNT = const(8)
_NOMINAL = const(9)
_MAX = const(10)
_NEEDED = const(11)
_FULL = const(12)  # whether there has been as much as is needed


@micropython.viper
def _sense(s: ptr32, count: int) -> int:
    if count <= s[_COUNT_LOW] or count >= s[_COUNT_HIGH]:
        s[_PUMP] = 0
        s[_LOW] = s[_LOW] + 1
        return s[_LOW]
    pressure = (count - s[_ZERO]) * s[_PA_PER_COUNT]
    if s[_BEGUN] == 0:
        s[_BEGUN] = 1
        s[_PRESSURE] = pressure
    s[_PRESSURE] = s[_PRESSURE] + (pressure - s[_PRESSURE] >> 2)  # four readings average the noise away
    duty = (s[_NOMINAL] + _HEADROOM_PA - s[_PRESSURE]) * _DUTY_PER_PA
    if duty < 0:
        duty = 0
    if duty > 65535:
        duty = 65535
    s[_PUMP] = duty
    s[_DUMP] = 1 if s[_PRESSURE] > s[_MAX] else 0
    if s[_PRESSURE] < s[_NEEDED]:
        s[_LOW] = s[_LOW] + 1
    else:
        s[_LOW] = 0
        s[_FULL] = 1
    return s[_LOW]


class Supply:
    """`pressure_pa` is measured, `pump` (0 to 65535) and `dump` are what to do about it; `lost`: it does not help."""

    def __init__(self, board: "ModuleType"):
        self.pressure_pa = 0
        self.pump = 0
        self.dump = 0
        self.lost = False
        self._patience = _PATIENCE_US // board.TICK_US
        self._dip = _DIP_US // board.TICK_US
        self._state = array("i", (0, 0, 0, 0, 0))
        for number in (
            board.COUNT_LOW,
            board.COUNT_HIGH,
            board.SUPPLY_ZERO,
            board.SUPPLY_PA_PER_COUNT,
            board.SUPPLY_PA,
            board.SUPPLY_MAX_PA,
            board.SUPPLY_LOW_PA,
            0,
        ):
            self._state.append(number)

    def sense(self, count: int) -> None:
        """Take one reading of the supply sensor. A sensor at the end of its range stops the pump."""
        state = self._state
        self.lost = _sense(state, count) > (self._dip if state[_FULL] else self._patience)
        self.pressure_pa = state[_PRESSURE]
        self.pump = state[_PUMP]
        self.dump = state[_DUMP]

    def clear(self) -> None:
        """Wait as after boot before the supply is called lost."""
        self._state[_LOW] = 0
        self._state[_FULL] = 0
