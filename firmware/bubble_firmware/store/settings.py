"""What can be set over the wire, within the limits of the board. The schema lists it."""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, const
from bubble_protocol.schema.packed import SETTINGS
from bubble_protocol.steps import small_word

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.safety.deadman import Deadman
    from bubble_firmware.safety.fault_monitor import FaultMonitor

# [constants] bubble_protocol.schema.settings: ATMOSPHERE_PA BUDGET_KPA_S DEADMAN_HOLD DEADMAN_VENT REZERO_UM
_ATMOSPHERE_PA = const(3)
_BUDGET_KPA_S = const(2)
_DEADMAN_HOLD = const(0)
_DEADMAN_VENT = const(1)
_REZERO_UM = const(4)
# [end of constants]


class Settings:
    """`values` in use, one per setting; `lows` and `highs` are the hard limits; `version` counts changes since boot."""

    def __init__(self, board: "ModuleType", deadman: "Deadman", monitor: "FaultMonitor", bubbles: "Bubbles"):
        self._deadman = deadman
        self._bubbles = bubbles
        self._monitor = monitor
        self.count = len(SETTINGS)
        self.values = array("i")
        self.lows = array("i")
        self.highs = array("i")
        self.version = 0
        for low, high, default in SETTINGS:
            most: int = board.BUDGET_KPA_S if high is None else high
            self.lows.append(low)
            self.highs.append(most)
            self.values.append(most if default is None else default)
        self.wanted = array("i", self.values)
        self._defaults = array("i", self.values)
        self._take_effect()

    def first_invalid(self, values: "array[int]", at: int, count: int) -> int:
        """Index of the first of `count` pairs (setting, value) in `values[at:]` that is not allowed, -1 where all are.

        `count` itself where each is allowed and together they are not. Where all are, what they lead to stands ready for
        `use` in `wanted`.
        """
        wanted = self.wanted
        for number in range(self.count):
            wanted[number] = self.values[number]
        for index in range(count):
            number = values[at + 2 * index]
            value = small_word(values, at + 2 * index + 1)
            if number >= self.count or not self.lows[number] <= value <= self.highs[number]:
                return index
            wanted[number] = value
        if wanted[_DEADMAN_VENT] < wanted[_DEADMAN_HOLD]:
            return count
        return -1

    def use(self) -> None:
        """Take up what `first_invalid` has found good."""
        for number in range(self.count):
            self.values[number] = self.wanted[number]
        self.version = self.version + 1 & 0xFFFFFF
        self._take_effect()

    def use_defaults(self) -> None:
        """Take up what the firmware was made with."""
        for number in range(self.count):
            self.values[number] = self._defaults[number]
        self._take_effect()

    def _take_effect(self) -> None:
        values = self.values
        self._deadman.configure(values[_DEADMAN_HOLD], values[_DEADMAN_VENT])
        self._monitor.set_budget(values[_BUDGET_KPA_S])
        self._bubbles.set_atmosphere(values[_ATMOSPHERE_PA], values[_REZERO_UM])
