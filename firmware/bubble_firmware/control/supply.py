# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""The reservoir: its pressure, how hard the pump works to keep it, and whether both can be believed.

The supply is *lost* where it does not help or its sensor does not tell the truth. What the sensor says is not believed where it

1. stands at an end of its range, or has leapt further than air moves in a tick, for a few readings in a row,
2. always says the same, as no sensor with noise does,
3. does not rise while the pump works and little air is taken, or does not fall while more is taken than the pump can bring:
   *effort* and *debt* add up until they show.

Until that is found, the reservoir may *hide* pressure: what pump and valves should have made of it in the meantime, less what
the reading has made of it, where that says that there is enough. Air is metered with the reading and what is hidden, so that a
sensor that lies lets too little air in rather than too much.

It is lost, too, where it stays below what is needed, and where the pump works at its utmost for longer than it may.
"""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr16, ptr32

if TYPE_CHECKING:
    from types import ModuleType

PATIENCE_US = 5000000  # at boot: an empty reservoir is full in two seconds
DIP_US = 2000000  # later: nineteen bubbles that rise at once take it below what is needed for 0.8 s
PUMP_MAX_US = 60000000  # at full duty, without a rest

_DUTY_PER_PA = const(32)  # full duty of 65535 at 2 kPa below the setpoint
_HEADROOM_PA = const(500)  # the proportional droop at rest, so that the reservoir stands at its nominal pressure
_LEAP_PA = const(6000)  # nineteen open fill valves take 2.3 kPa in 10 ms, the dump valve 3
_WRONG_MAX = const(4)  # readings
_SHOWS_PA = const(1000)  # a change that is more than noise, which is 50
# Effort and debt are in 1/256 of the pump's full work times 1.024 ms. An open fill valve takes 23 % of that work at 60 kPa, and
# 9 % where the reservoir has 45 and the bubble 34 kPa.
_EFFORT_MAX = const(100000)  # 0.4 s of full work: 20 kPa
_EFFORT_LOST = const(64)  # a quarter of it may leak away: what the droop at rest asks for
_EFFORT_TAKEN = const(90)  # more than a fill valve takes
_EFFORT_PER_PA = const(5)  # at 60 kPa
_HIDDEN_LOST = const(32)  # an eighth of the pump's work may not come: pumps differ by ± 10 %
_HIDDEN_TAKEN = const(54)  # what a fill valve takes of it from a full reservoir, on its way up
_HIDDEN_FREE_PA = const(600)  # what true readings of seven bubbles seem to hide: noise, gas that warms and cools
_DEBT_MAX = const(25000)
_DEBT_TAKEN = const(18)  # less than a fill valve takes from a reservoir that has what is needed

# The state.
_PRESSURE = const(0)
_PUMP = const(1)
_DUMP = const(2)
_BEGUN = const(3)  # whether there has been a reading
_LOW = const(4)  # ticks in a row without the pressure that is needed
_FULL = const(5)  # whether there has been as much as is needed
_COUNT = const(6)  # last reading
_FROZEN = const(7)  # ticks for which it has been the same
_STEADY = const(8)  # last reading that is no leap
_WRONG = const(9)  # readings in a row that are one, or at an end of the range
_EFFORT = const(10)  # the pump's work that has not shown
_BASE = const(11)  # least pressure since that began, Pa
_DEBT = const(12)  # air that has been taken and does not show
_TOP = const(13)  # greatest pressure since that began, Pa
_WORKING = const(14)  # ticks in a row at full duty
_NOW = const(15)  # last reading that is no leap, Pa
_HIDDEN = const(16)  # what the reservoir may have more than that, as effort
_UNSEEN = const(17)  # what the next reading should have more, and some, as effort
_METERING = const(18)  # what to meter air with, Pa
# The board's numbers.
_TICK_US = const(19)
_COUNT_LOW = const(20)
_COUNT_HIGH = const(21)
_ZERO = const(22)
_PA_PER_COUNT = const(23)
_NOMINAL = const(24)
_MAX = const(25)
_NEEDED = const(26)
_FROZEN_MAX = const(27)  # ticks
_WORKING_MAX = const(28)
_PATIENCE = const(29)
_DIP = const(30)


@micropython.viper
def _read(s: ptr32, count: int) -> int:
    """Take up a reading, where it can be believed; whether the sensor cannot be."""
    lost = 0

    # A sensor has noise.
    s[_FROZEN] = s[_FROZEN] + 1 if count == s[_COUNT] else 0
    s[_COUNT] = count
    if s[_FROZEN] >= s[_FROZEN_MAX]:
        lost = 1

    # It has a range, and what it says does not leap, but where the dump valve is open.
    if s[_BEGUN] == 0 or s[_DUMP]:
        s[_STEADY] = count
    leap = (count - s[_STEADY]) * s[_PA_PER_COUNT]
    if (count - s[_COUNT_LOW] - 1 | s[_COUNT_HIGH] - 1 - count | _LEAP_PA - leap | _LEAP_PA + leap) >> 31:
        s[_WRONG] = s[_WRONG] + 1
        if s[_WRONG] >= _WRONG_MAX:
            lost = 1
            s[_STEADY] = count
    else:
        s[_WRONG] = 0
        s[_STEADY] = count
        pressure = (count - s[_ZERO]) * s[_PA_PER_COUNT]
        if s[_BEGUN] == 0:
            s[_BEGUN] = 1
            s[_PRESSURE] = pressure
            s[_NOW] = pressure
        s[_PRESSURE] = s[_PRESSURE] + (pressure - s[_PRESSURE] >> 2)  # four readings average the noise away
        s[_HIDDEN] = s[_HIDDEN] - _EFFORT_PER_PA * (pressure - s[_NOW])
        s[_NOW] = pressure
    return lost


@micropython.viper
def _balance(s: ptr32, pulses: ptr16, end: int) -> int:
    """Whether the pump's work of a period in which `pulses` were played, or what they took, should have shown and has not."""
    lost = 0
    taken = 0
    i = 0
    while i < end:
        taken += pulses[i]
        i += 2
    pressure = s[_PRESSURE]
    work = (s[_PUMP] >> 8) * s[_TICK_US]
    effort = s[_EFFORT] + (work - _EFFORT_LOST * s[_TICK_US] - taken * _EFFORT_TAKEN >> 10)
    if effort <= 0 or pressure > s[_BASE] + _SHOWS_PA or s[_DUMP]:
        effort = 0
    if effort == 0 or pressure < s[_BASE]:
        s[_BASE] = pressure
    if effort > _EFFORT_MAX:
        effort = 0  # after a CLEAR it begins anew
        lost = 1
    s[_EFFORT] = effort
    hidden = s[_HIDDEN] + s[_UNSEEN]
    s[_UNSEEN] = work - _HIDDEN_LOST * s[_TICK_US] - taken * _HIDDEN_TAKEN >> 10
    if hidden < 0 or pressure < s[_NEEDED] or s[_DUMP]:
        hidden = 0
    s[_HIDDEN] = hidden
    hidden = hidden // _EFFORT_PER_PA - _HIDDEN_FREE_PA
    s[_METERING] = s[_NOW] + (hidden if hidden > 0 else 0)
    debt = s[_DEBT] + (taken * _DEBT_TAKEN - work >> 10)
    if debt <= 0 or pressure < s[_TOP] - _SHOWS_PA or pressure < s[_NEEDED] or s[_DUMP]:
        debt = 0
    if debt == 0 or pressure > s[_TOP]:
        s[_TOP] = pressure
    if debt > _DEBT_MAX:
        debt = 0
        lost = 1
    s[_DEBT] = debt
    return lost


@micropython.viper
def _decide(s: ptr32, lost: int, shut: int) -> int:
    """What pump and dump valve do in the next period; whether the supply is lost. `shut`: nothing more in."""
    pressure = s[_PRESSURE]
    duty = (s[_NOMINAL] + _HEADROOM_PA - pressure) * _DUTY_PER_PA
    if duty < 0 or shut | lost | s[_WRONG]:
        duty = 0
    if duty > 65535:
        duty = 65535
    s[_PUMP] = duty
    s[_DUMP] = 1 if shut | lost or pressure > s[_MAX] else 0
    s[_WORKING] = s[_WORKING] + 1 if duty == 65535 else 0
    if s[_WORKING] > s[_WORKING_MAX]:
        lost = 1
    if pressure < s[_NEEDED] or s[_WRONG]:
        s[_LOW] = s[_LOW] + 1
    else:
        s[_LOW] = 0
        s[_FULL] = 1
    if shut:  # it has to fill again, as after boot
        s[_LOW] = 0
        s[_FULL] = 0
    if s[_LOW] > (s[_DIP] if s[_FULL] else s[_PATIENCE]):
        lost = 1
    return lost


class Supply:
    """`pressure_pa` is measured, `pump` (0 to 65535) and `dump` are what to do about it; `lost`: it does not help.

    `metering_pa` is what air is metered with, the reading and what may be hidden. It has noise and no lag: nineteen bubbles that
    rise take 2 kPa in a tick, which flow and so metered air would miss.
    """

    def __init__(self, board: "ModuleType"):
        self.pressure_pa = 0
        self.metering_pa = 0
        self.pump = 0
        self.dump = 0
        self.lost = 0
        self._state = state = array("i", bytearray(4 * _TICK_US))
        for number in (
            board.TICK_US,
            board.COUNT_LOW,
            board.COUNT_HIGH,
            board.SUPPLY_ZERO,
            board.SUPPLY_PA_PER_COUNT,
            board.SUPPLY_PA,
            board.SUPPLY_MAX_PA,
            board.SUPPLY_LOW_PA,
            board.FROZEN_US // board.TICK_US,
            PUMP_MAX_US // board.TICK_US,
            PATIENCE_US // board.TICK_US,
            DIP_US // board.TICK_US,
        ):
            state.append(number)

    def sense(self, count: int, pulses: "array[int]", shut: int) -> None:
        """Take one reading of the supply sensor; `pulses` are those of the period that is over.

        `shut`: pump off and dump valve open, whatever the pressure. So it is, too, while the supply is lost.
        """
        state = self._state
        lost = _read(state, count) | _balance(state, pulses, len(pulses))
        self.lost = _decide(state, lost, shut)
        self.pressure_pa = state[_PRESSURE]
        self.metering_pa = state[_METERING]
        self.pump = state[_PUMP]
        self.dump = state[_DUMP]
