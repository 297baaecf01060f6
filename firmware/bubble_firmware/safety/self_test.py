"""The test at boot: does every sensor read zero without pressure, and does every valve do something?

All bubbles at once, in less than two seconds: look at the zeros, wait for the supply, close the vents and
give one short fill pulse, see the pressure rise, open the vents, see it fall. A pulse of 3 ms brings a
resting bubble to some 5 kPa, a quarter of what inflates it. What others decide comes first: any SHOW or STOP
and an emergency stop end the test.
"""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.control.supply import Supply

# [constants] bubble_firmware.control.trim: used
# [constants] bubble_protocol.schema.self_test: FAILED NOT_RUN PASSED RUNNING SKIPPED
_ZERO_PA = const(1500)
_FAILED = const(3)
_NOT_RUN = const(0)
_PASSED = const(2)
_RUNNING = const(1)
_SKIPPED = const(4)
# [end of constants]

_PULSE_US = const(3000)
_RISE_PA = const(1000)
_SUPPLY_PA = const(30000)
_ZERO_US = const(50000)  # when the zeros are taken
_WAIT_US = const(1600000)  # for the supply
_HOLD_US = const(50000)
_RELEASE_US = const(200000)

# Where the test is.
_OFF = const(0)
_ZERO = const(1)
_WAIT = const(2)
_HOLD = const(3)
_RELEASE = const(4)


class SelfTest:
    """`outcome` of the test and, as bits, the bubbles that are ill; `tick` changes the pulses while `running`."""

    def __init__(self, board: "ModuleType", wanted: bool):
        self.outcome = _RUNNING if wanted else _NOT_RUN
        self.untrue_zero = 0
        self.unfilled = 0
        self.unvented = 0
        self._tick_us = board.TICK_US
        self._pulse_us = _PULSE_US
        self._stage = _ZERO if wanted else _OFF
        self.running = wanted
        self._time = 0
        self._zero = array("i", bytearray(4 * board.BUBBLES))
        self._rise = array("i", bytearray(4 * board.BUBBLES))

    @property
    def failed(self) -> bool:
        """Whether something was found."""
        return self.outcome == _FAILED

    def skip(self) -> None:
        """End the test with what is known."""
        if self.running:
            self._end(_SKIPPED)

    def tick(self, bubbles: "Bubbles", supply: "Supply") -> None:
        """One period of the test, after control has filled in `bubbles.pulses`."""
        self._time += self._tick_us
        stage = self._stage
        if stage == _ZERO:
            if self._time >= _ZERO_US:
                self.untrue_zero = self._take_zeros(bubbles)
                self._next(_WAIT)
        elif stage == _WAIT:
            if supply.pressure_pa >= _SUPPLY_PA:
                self._apply_pulse(bubbles, self._pulse_us)
                self._next(_HOLD)
            elif self._time >= _WAIT_US:
                self._end(_SKIPPED)
        elif stage == _HOLD:
            self._apply_pulse(bubbles, 0)
            if self._time >= _HOLD_US:
                self.unfilled = self._take_rise(bubbles)
                self._next(_RELEASE)
        elif self._time >= _RELEASE_US:
            self.unvented = self._take_fall(bubbles)
            self._end(_PASSED)

    def _next(self, stage: int) -> None:
        self._stage = stage
        self._time = 0

    def _end(self, outcome: int) -> None:
        self._stage = _OFF
        self.running = False
        ill = self.untrue_zero | self.unfilled | self.unvented
        self.outcome = _FAILED if ill else outcome

    def _apply_pulse(self, bubbles: "Bubbles", fill_us: int) -> None:
        pulses = bubbles.pulses
        for i in range(bubbles.count):
            if not (self.untrue_zero >> i & 1 or bubbles.faults(i)):  # no air where nobody sees it
                pulses[2 * i] = fill_us
                pulses[2 * i + 1] = 0

    def _take_zeros(self, bubbles: "Bubbles") -> int:
        ill = 0
        for i in range(bubbles.count):
            pressure = bubbles.pressure_pa(i)
            self._zero[i] = pressure
            if pressure > _ZERO_PA or pressure < -_ZERO_PA or bubbles.faults(i):
                ill |= 1 << i
        return ill

    def _take_rise(self, bubbles: "Bubbles") -> int:
        ill = 0
        for i in range(bubbles.count):
            rise = bubbles.pressure_pa(i) - self._zero[i]
            self._rise[i] = rise
            if rise < _RISE_PA and not self.untrue_zero >> i & 1:
                ill |= 1 << i
        return ill

    def _take_fall(self, bubbles: "Bubbles") -> int:
        ill = 0
        for i in range(bubbles.count):
            left = bubbles.pressure_pa(i) - self._zero[i]
            if self._rise[i] >= _RISE_PA and 2 * left > self._rise[i]:
                ill |= 1 << i
        return ill
