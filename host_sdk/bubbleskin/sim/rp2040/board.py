"""A simulated wristband whose firmware is the real UF2, on an emulated RP2040 with the board's chips around it."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from bubbleskin.errors import LinkError
from bubbleskin.sim.board import Simulated
from bubbleskin.sim.recipe import PlantOptions
from bubbleskin.sim.rp2040.banks import Bank, Pca9685Bank, PwmBank
from bubbleskin.sim.rp2040.bus import SpiBus
from bubbleskin.sim.rp2040.chip import BOOT_S, Chip
from bubbleskin.sim.rp2040.mcp3208 import Mcp3208
from bubbleskin.sim.rp2040.valves import Valves
from bubbleskin.sim.wiring import FILL, VENT, Wiring

FAILURES = ("converter_silent", "driver_silent", "supply_lost", "estop", "hang")
"""What can be made to fail beside what `Plant.inject` knows."""


def pump_carrier(chip: Chip, data: ModuleType) -> Any:
    """The emulator's PWM slice at the pump's pin (RP2040 datasheet, table 525: two pins a slice, eight slices)."""
    return chip.mcu.pwm.channels[data.PIN_PUMP >> 1 & 7]


def pass_over_carrier(chip: Chip, data: ModuleType) -> None:
    """Let the emulator take no notice of the pump's carrier: nobody does, and it would be most of its events."""
    carrier = pump_carrier(chip, data)
    for alarm in (carrier.alarm_a, carrier.alarm_b, carrier.alarm_bottom):
        alarm.enable = False


class Rp2040Board(Simulated):
    """The board called `board`, or of that file, running the UF2 at `firmware`, in emulated time.

    `seed`, `spread`, `contact` and `options` are those of `SimulatedBoard`. `absent`: chips that are not soldered in, such as
    "converter0" or "driver2".
    """

    no_history = (
        "when the emulated chip looks at its sensors and at its link is seen by nobody. "
        "Record on sim:// or micropython://, and replay that on the chip: bubbleskin replay FILE --on rp2040"
    )

    def __init__(
        self,
        board: str | Path,
        firmware: Path,
        *,
        seed: int = 0,
        spread: float = 0.0,
        contact: bool = True,
        absent: tuple[str, ...] = (),
        wiring: Wiring | None = None,
        **options: Unpack[PlantOptions],
    ):
        super().__init__(board, seed=seed, spread=spread, contact=contact, wiring=wiring, **options)
        self.chip = Chip(firmware)
        self.from_device = self.chip.from_device
        self._supply_lost = False
        self._valves = Valves(self.plant, lambda: self.chip.time, self._pump_duty)
        self._solder(self.data, absent)

    # ---- the circuit

    def _solder(self, data: ModuleType, absent: tuple[str, ...]) -> None:
        chip = self.chip
        spi = SpiBus(chip, 0)
        self._converters = []
        first = 0
        for number, (pin, inputs) in enumerate(data.CONVERTERS):
            converter = Mcp3208(self._input(first, inputs))
            self._converters.append(converter)
            if f"converter{number}" not in absent:
                spi.add(converter, pin)
            first += inputs
        self._disabled = True
        self._pressed = False
        self._coils = self.wiring.coils(data.BUBBLES).tolist()
        self._channels = self.wiring.channels(data.BUBBLES).tolist()
        for valve in set(range(VENT, 2 * data.BUBBLES, 2)) - set(self._coils):
            self._valves.set(valve // 2, VENT, True)  # no output drives it: open
        chip.on_pin(data.PIN_DISABLE, self._disable)
        if data.VALVES == "pwm":
            self._bank: Bank = PwmBank(chip, data, self._drive)
        else:
            self._bank = Pca9685Bank(chip, data, self._drive, absent)
        chip.on_pin(data.PIN_DUMP, lambda level: self._valves.dump(level is True or self._supply_lost))
        self._press(False)
        convert = chip.mcu.adc.on_adc_read
        supply_input = data.PIN_SUPPLY - 26

        def read(channel: int) -> None:
            if channel == supply_input:
                chip.mcu.adc.channel_values[channel] = self._valves.advance().sense_supply()
            convert(channel)

        chip.mcu.adc.on_adc_read = read
        pass_over_carrier(chip, data)

    def _input(self, first: int, inputs: int) -> Callable[[int], int]:
        def sample(channel: int) -> int:
            return int(self._valves.advance().sense()[self._channels[first + channel]]) if channel < inputs else 0

        return sample

    def _disable(self, level: bool | None) -> None:
        disabled = level is not False  # pulled up
        if disabled != self._disabled:
            self._disabled = disabled
            self._drive_all()

    def _press(self, pressed: bool) -> None:
        """The emergency stop: one contact is in the loop that a pin reads, the other in the valves' and the pump's supply."""
        self._pressed = pressed
        self.chip.mcu.gpio[self.data.PIN_ESTOP].set_input_value(self._loop_is_open(pressed))

    def _drive_all(self) -> None:
        for bubble in range(self.data.BUBBLES):
            self._drive(bubble)

    def _pump_duty(self) -> float:
        carrier = pump_carrier(self.chip, self.data)
        if (
            self._supply_lost
            or self._pressed
            or not carrier.csr & 1
            or self.chip.mcu.gpio[self.data.PIN_PUMP].function_select != 4
        ):
            return 0.0
        return min((carrier.cc & 0xFFFF) / (carrier.top + 1), 1.0)

    def _drive(self, bubble: int) -> None:
        """Bring what one bubble's outputs drive in line with them: without current a fill valve is shut and a vent valve open."""
        currents = (False, False) if self._disabled or self._pressed else self._bank.coils(bubble)
        for output in (VENT, FILL):
            coil = self._coils[2 * bubble + output]
            if coil >= 0:
                valve = coil % 2
                self._valves.set(coil // 2, valve, currents[output] != (valve == VENT))

    # ---- the names of SimulatedBoard

    @property
    def time(self) -> float:
        """Emulated seconds since power came."""
        return self.chip.time

    @property
    def height_mm(self) -> NDArray[np.float64]:
        """The true heights, which the firmware can only estimate, (n,)."""
        return self._valves.advance().height_mm

    @property
    def pulses(self) -> NDArray[np.float64]:
        """Seconds that fill and vent valve of each bubble are open in the period that runs, (n, 2)."""
        if self._disabled:
            return np.tile([0.0, self.tick_s], (self.data.BUBBLES, 1))
        return np.minimum(self._bank.pulses(), self.tick_s)

    def boot(self) -> None:
        """Run until the chip has appeared on USB; `LinkError` where it does not."""
        while not self.chip.connected:
            self.chip.run(self.tick_s)
            if self.time > BOOT_S:
                raise LinkError(f"The emulated board has not appeared on USB within {BOOT_S:g} emulated seconds.")

    def tick(self) -> None:
        """Let as much time pass as one period takes; periods themselves are the chip's affair."""
        if self.to_device:
            self.chip.write(bytes(self.to_device))
            self.to_device.clear()
        self.chip.run(self.tick_s)
        self._valves.advance()

    def listen(self, phase_us: int) -> None:
        """Nothing: the chip looks at its link when it likes."""

    def _inject(self, fault: str, number: int, value: float) -> None:
        """Make something fail, as of `Plant.inject` or one of `FAILURES`; a value of 0 mends it.

        `converter_silent`, `driver_silent`: chip `number` answers no more. `supply_lost`: the pump stands still
        and the reservoir empties. `estop`: the button is pressed, so the valves have no current. `hang`: the program is
        stuck from now on.
        """
        on = value != 0
        self._valves.advance()
        if fault == "converter_silent":
            self._converters[number].silent = on
        elif fault == "driver_silent":
            self._bank.drivers[number].silent = on
        elif fault == "supply_lost":
            self._supply_lost = on
            self._valves.dump(on)
        elif fault == "estop":
            self._press(on)
            self._drive_all()
        elif fault == "hang":
            self.chip.hang()
        else:
            self.plant.inject(fault, number, value)

    def close(self) -> None:
        """Nothing to end: the emulator runs only when it is stepped."""
