"""Keeps the fault monitor's state, runs its checks in every tick, see `fault_checks`, and knows which faults are new."""

from array import array

from bubble_firmware.safety import fault_checks
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType
    from typing import Any

    from bubble_firmware.control.bubbles import Bubbles

# [constants] bubble_firmware.safety.watch_layout: used
_CLOSED_TICKS = const(18)
_LOGGED_FAULTS = const(20)
_PREVIOUS_AIR = const(22)
_WATCH_WORDS = const(31)
_LOSS_MAX = const(0)
_FROZEN_MAX = const(1)
_CLOSED_WINDOW = const(2)
_STALL_MAX = const(3)
_FLOW_DUE = const(4)
_NO_FLOW_MAX = const(5)
_BUDGET_FREE_PA = const(6)
_BUDGET_MAX = const(7)
_LIMIT_WORDS = const(8)
_SETTLE_TICKS = const(-2)
# [end of constants]

_LOSS_UJ_S = const(50000)
_CLOSED_WINDOW_US = const(300000)
_STALL_US = const(300000)
_FLOW_DUE_US = const(15000)
_NO_FLOW_US = const(30000)


class FaultMonitor:
    """Watches `bubbles`. `check`, after `Bubbles.step`, returns what it has found, as bits: NEW_FAULT and those after it."""

    def __init__(self, board: "ModuleType", bubbles: "Bubbles"):
        n = board.BUBBLES
        self._bubbles = bubbles
        self._count = n
        self._tick_us = board.TICK_US
        self._supply_enough_pa = board.PRESSURE_MAX_PA
        self._watch = array("i", bytearray(4 * _WATCH_WORDS * n))
        self._limits = limits = array("i", bytearray(4 * _LIMIT_WORDS))
        limits[_LOSS_MAX] = _LOSS_UJ_S * board.TICK_US // 1000000
        limits[_FROZEN_MAX] = board.FROZEN_US // board.TICK_US
        limits[_CLOSED_WINDOW] = _CLOSED_WINDOW_US // board.TICK_US
        limits[_STALL_MAX] = _STALL_US // board.TICK_US
        limits[_FLOW_DUE] = -(-_FLOW_DUE_US // board.TICK_US)
        limits[_NO_FLOW_MAX] = _NO_FLOW_US // board.TICK_US
        limits[_BUDGET_FREE_PA] = board.BUDGET_FREE_PA
        self.set_budget(board.BUDGET_KPA_S)
        for at in range(0, n * _WATCH_WORDS, _WATCH_WORDS):
            self._watch[at + _PREVIOUS_AIR] = -1
            self._watch[at + _CLOSED_TICKS] = _SETTLE_TICKS

        # Defaults are locals, see `Bubbles`.
        work = (
            bubbles.state,
            fault_checks.check_pressures,
            fault_checks.check_air,
            fault_checks.check_lines,
            bubbles.pulses,
        )

        def check(
            rows: memoryview = bubbles.rows,
            watch: "array[int]" = self._watch,
            limits: "array[int]" = limits,
            work: "tuple[Any, ...]" = work,
        ) -> int:
            found = work[1](rows, watch, limits, work[0])
            work[2](rows, watch, limits, work[0])
            return found | work[3](rows, watch, limits, work[0], work[4])

        self.check = check

    def set_budget(self, kpa_s: int) -> None:
        """How much pressure times time above the threshold each bubble may have."""
        self._limits[_BUDGET_MAX] = kpa_s * (1000000000 // self._tick_us)

    def block_backflow(self, supply_pa: int) -> None:
        """After `Bubbles.step`: no fill valve opens to a supply below the bubble's pressure, which would empty it."""
        if supply_pa < self._supply_enough_pa:
            bubbles = self._bubbles
            fault_checks.block_backflow(bubbles.rows, bubbles.pulses, supply_pa, self._count)

    def open_vents(self) -> None:
        """After `check`: whatever has been decided for this tick, every fill valve is closed and every vent valve open."""
        bubbles = self._bubbles
        fault_checks.open_vents(bubbles.rows, bubbles.pulses, self._tick_us, self._count)

    def take_new_faults(self, bubble: int) -> int:
        """The fault bits of a bubble that are new since the last time."""
        at = bubble * _WATCH_WORDS + _LOGGED_FAULTS
        faults = self._bubbles.faults(bubble)
        new = faults & ~self._watch[at]
        self._watch[at] = faults
        return new

    def acknowledge(self, bubble: int) -> None:
        """The faults of this bubble are acknowledged: those that still are there are new."""
        self._watch[bubble * _WATCH_WORDS + _LOGGED_FAULTS] = 0
