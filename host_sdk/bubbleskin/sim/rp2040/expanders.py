"""The coils of a board with PCA9685: two outputs a bubble, clocked by the RP2040 itself."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sim.rp2040.bus import I2cBus
from bubbleskin.sim.rp2040.pca9685 import Pca9685

_GPCK = 8  # function of a GPIO that puts out a clock
_SYSTEM, _ENABLED = 6, 0x800  # CLK_GPOUT0_CTRL: source and enable


class Pca9685Bank:
    """The PCA9685 of a board, bubble by bubble: fill on output 2i, vent on 2i + 1. `drive` hears of every edge."""

    def __init__(self, chip: Any, data: ModuleType, drive: Callable[[int], None], absent: tuple[str, ...]):
        self._chip = chip
        self._pin = chip.mcu.gpio[data.PIN_CLOCK]
        self._outputs: list[tuple[Pca9685, int]] = []
        self.drivers: list[Pca9685] = []
        bus = I2cBus(chip, 0)
        for number, (address, bubbles) in enumerate(data.DRIVERS):
            first = len(self._outputs)

            def edge(output: int, level: bool, first: int = first, bubbles: int = bubbles) -> None:
                if output < 2 * bubbles:
                    drive(first + output // 2)

            driver = Pca9685(chip, address, edge, self._hz)
            self.drivers.append(driver)
            self._outputs += [(driver, 2 * bubble) for bubble in range(bubbles)]
            if f"driver{number}" not in absent:
                bus.add(driver)
        clocks = chip.mcu.clocks
        write = clocks.write_uint32

        def written(offset: int, value: int) -> None:
            write(offset, value)
            if offset < 0x0C:  # GPOUT0
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
        """Which coils have current, fill and vent."""
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
