"""What drives the coils of a board's valves, bubble by bubble: the RP2040's own PWM pins, or PCA9685s."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sim.rp2040.bus import I2cBus
from bubbleskin.sim.rp2040.pca9685 import Pca9685

_GPCK = 8
"""Function of a GPIO that puts out a clock."""
_SYSTEM, _ENABLED = 6, 0x800
"""Of CLK_GPOUT0_CTRL: source and enable."""
_GPOUT0_END = 0x0C
"""Registers below this are those of the clock output."""


class Bank(ABC):
    """The drivers of all coils, two a bubble. `drivers`: its chips, where they are chips of their own."""

    drivers: Sequence[Pca9685] = ()

    @abstractmethod
    def coils(self, bubble: int) -> tuple[bool, bool]:
        """Which coils of a bubble have current now, fill and vent."""

    @abstractmethod
    def pulses(self) -> NDArray[np.float64]:
        """Seconds of the period that runs for which fill has current, and for which vent has none, (n, 2)."""


class PwmBank(Bank):
    """The RP2040's own PWM pins: fill of bubble i on GPIO 2i, its vent on 2i + 1. `changed(bubble)` hears of every edge."""

    def __init__(self, chip: Any, data: ModuleType, changed: Callable[[int], None]):
        self._levels = [False] * (2 * data.BUBBLES)
        self._channels = chip.mcu.pwm.channels
        self._changed = changed
        for pin in range(2 * data.BUBBLES):
            chip.on_pin(pin, self._watch(pin))

    def _watch(self, pin: int) -> Callable[[bool | None], None]:
        def changed(level: bool | None) -> None:
            self._levels[pin] = level is True  # pulled down
            self._changed(pin // 2)

        return changed

    def coils(self, bubble: int) -> tuple[bool, bool]:
        """Which coils of a bubble have current now, fill and vent."""
        return self._levels[2 * bubble], self._levels[2 * bubble + 1]

    def pulses(self) -> NDArray[np.float64]:
        """Seconds of the compare registers in force, (n, 2): fill has current for so long, vent has none."""
        n = len(self._levels) // 2
        return np.array([[c.alarm_a.target, c.alarm_b.target] for c in self._channels[:n]]) * 1e-6


class Pca9685Bank(Bank):
    """PCA9685s clocked by the RP2040 itself: fill on output 2i, vent on 2i + 1. `changed(bubble)` hears of every edge.

    `absent`: chips that are not soldered in, such as "driver2".
    """

    def __init__(self, chip: Any, data: ModuleType, changed: Callable[[int], None], absent: tuple[str, ...]):
        self._chip = chip
        self._pin = chip.mcu.gpio[data.PIN_CLOCK]
        self._outputs: list[tuple[Pca9685, int]] = []
        drivers: list[Pca9685] = []
        self.drivers = drivers
        bus = I2cBus(chip, 0)
        for number, (address, bubbles) in enumerate(data.DRIVERS):
            first = len(self._outputs)

            def edge(output: int, level: bool, first: int = first, bubbles: int = bubbles) -> None:
                if output < 2 * bubbles:
                    changed(first + output // 2)

            driver = Pca9685(chip, address, edge, self._hz)
            drivers.append(driver)
            self._outputs += [(driver, 2 * bubble) for bubble in range(bubbles)]
            if f"driver{number}" not in absent:
                bus.add(driver)
        clocks = chip.mcu.clocks
        write = clocks.write_uint32

        def written(offset: int, value: int) -> None:
            write(offset, value)
            if offset < _GPOUT0_END:
                for driver in self.drivers:
                    driver.clock_changed()

        clocks.write_uint32 = written

    def _hz(self) -> float:
        clocks = self._chip.mcu.clocks
        control = clocks.gpout0_ctrl
        if not control & _ENABLED or control >> 5 & 15 != _SYSTEM or self._pin.function_select != _GPCK:
            return 0.0
        return self._chip.mcu.clk_sys * 256 / clocks.gpout0_div

    def coils(self, bubble: int) -> tuple[bool, bool]:
        """Which coils of a bubble have current now, fill and vent."""
        driver, output = self._outputs[bubble]
        return driver.level(output), driver.level(output + 1)

    def pulses(self) -> NDArray[np.float64]:
        """Seconds of the period that runs for which fill has current, and for which vent has none, (n, 2)."""
        pulses = []
        for driver, output in self._outputs:
            (fill_on, fill_off), (vent_on, vent_off) = driver.widths[output : output + 2]
            period = min(driver.period, 1.0)
            pulses.append([(fill_off - fill_on) * period, (1.0 - (vent_off - vent_on)) * period])
        return np.array(pulses)
