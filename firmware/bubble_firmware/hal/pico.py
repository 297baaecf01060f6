# mypy: disable-error-code="attr-defined,union-attr,call-overload,method-assign"
"""A board that is built around a Raspberry Pi Pico: `hal.base.Hal` in hardware.

Without power, in reset and in the boot loader all pins are inputs and the resistors of the board decide:
valve buffers disabled, so every fill valve closed and every vent valve open. See docs/hardware.md.
"""

import gc
import os
import sys
import time
from array import array

import machine
import vfs
from machine import ADC, I2C, SPI, WDT, Pin

from bubble_firmware.drivers import clock, mcp3208, pca9685, pwm, watchdog
from bubble_firmware.drivers.flash import Files, Sectors
from bubble_firmware.drivers.led import show as show_led
from bubble_firmware.drivers.usb_serial import UsbSerial
from bubble_firmware.drivers.watchdog import feed
from bubble_firmware.hal.base import Hal
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

# [constants] bubble_protocol.schema.faults: ESTOP SENSOR_CHIP VALVE_CHIP WATCHDOG
# [constants] bubble_protocol.schema.system: BOOT_LOADER PROMPT
_ESTOP = const(1)
_SENSOR_CHIP = const(8)
_VALVE_CHIP = const(4)
_WATCHDOG = const(32)
_BOOT_LOADER = const(1)
_PROMPT = const(2)
# [end of constants]

_WATCHDOG_MS = 80
_FLASH_MS = 2000  # longer than the slowest erase
_ROM_SEGMENT = 2  # of `vfs.rom_ioctl`
_SPI_HZ = 2000000
_I2C_HZ = 1000000
_I2C_TIMEOUT_US = 2000  # a stuck bus costs so much, once
_MS_US = 1000
_HEAP_LOW = 65536  # bytes

_PWM = pwm.BASE
_TIMER = pwm.TIMER
_SPI = mcp3208.SPI0
_SIO = mcp3208.SIO


class PicoHal(Hal):
    """The hardware of `board`. Nothing in it allocates or raises once `wait` has been called."""

    self_test = True

    def __init__(self, board: "ModuleType"):
        super().__init__(board)
        self._disable = Pin(board.PIN_DISABLE, Pin.OUT, value=1)
        self._dump = Pin(board.PIN_DUMP, Pin.OUT, value=0)
        self._led = board.PIN_LED
        Pin(self._led, Pin.OUT, value=1)
        self._estop = Pin(board.PIN_ESTOP, Pin.IN, Pin.PULL_UP)
        self._tick_us = board.TICK_US
        self.boot_faults = _WATCHDOG if watchdog.has_bitten() else 0
        self.boot_id = (int.from_bytes(os.urandom(4), "little") + watchdog.count_boot()) & 0x3FFFFFFF
        self.active_faults = 0
        self._disabled = True
        self._dumping = 0
        self.late_ticks = 0
        mhz = machine.freq() // 1000000
        if board.VALVES == "pwm":
            self._valves: "PwmValves | ExpanderValves" = PwmValves(board)
            pwm.start(_PWM, board.BUBBLES, board.TICK_US, mhz)
        else:
            pwm.start(_PWM, 1, board.TICK_US, mhz)
            self._valves = ExpanderValves(board, mhz)
        self._valves.connect()
        Pin(board.PIN_PUMP, Pin.ALT, alt=Pin.ALT_PWM)
        for select, _ in board.CONVERTERS:
            Pin(select, Pin.OUT, value=1)
        SPI(0, baudrate=_SPI_HZ, sck=Pin(board.PIN_SCK), mosi=Pin(board.PIN_MOSI), miso=Pin(board.PIN_MISO))
        Pin(board.PIN_MISO, Pin.ALT, pull=Pin.PULL_UP, alt=Pin.ALT_SPI)
        self._supply = ADC(Pin(board.PIN_SUPPLY))
        self._link = UsbSerial()
        self.receive = self._link.receive
        self.send = self._link.send
        # Our own UF2 has flash for the store, see micropython.cmake. Another MicroPython has files.
        if hasattr(vfs, "rom_ioctl"):
            self.flash: "Sectors | Files" = Sectors(vfs.rom_ioctl(_ROM_SEGMENT, 0), _patient_watchdog)
        else:
            self.flash = Files(_patient_watchdog)
        self._running = False
        self._overrun_allowed = True
        self._began = array("i", (0,))
        self._first = True
        self._ticks = 0
        self._converters = board.CONVERTERS

        # A default is a local: an attribute costs the chip 2.5 µs.
        def phase_us(
            elapsed: "Callable[..., int]" = pwm.elapsed, timer: int = _TIMER, began: "array[int]" = self._began
        ) -> int:
            return elapsed(timer, began)

        self.phase_us = phase_us

    def wait(self) -> int:
        """Sleep until the next period has begun; returns how many have begun since the last call."""
        if not self._running:
            gc.collect()
            WDT(timeout=_WATCHDOG_MS)
            self._running = True
            pwm.wrapped(_PWM)
        left = self._tick_us - pwm.phase(_PWM)
        if pwm.wrapped(_PWM) and not self._overrun_allowed:
            self.late_ticks += 1
        else:  # after a tick that was allowed to overrun, too: what begins in the middle of a period is late for the next one
            if left > _MS_US + 200:
                time.sleep_ms((left - 200) // _MS_US)
            while not pwm.wrapped(_PWM):
                pass
        if self._valves.stopped:
            self._valves.start_clock()
        periods = pwm.begin(_PWM, _TIMER, self._began, self._tick_us)
        if self._first:
            self._first = False
            periods = 1
        self._ticks += 1
        self._overrun_allowed = False
        return periods if periods > 0 else 1

    def read_sensors(self, counts: "array[int]") -> None:
        """Fill in the counts of this tick; look at everything else that may go wrong."""
        at = 0
        faults = 0
        read = mcp3208.read
        for select, channels in self._converters:
            if read(_SPI, _SIO, select, channels, counts, at) < channels:
                faults = _SENSOR_CHIP
            at += channels
        counts[at] = self._supply.read_u16() >> 4
        if self._estop():
            faults |= _ESTOP
        if self._valves.silent:
            faults |= _VALVE_CHIP
        self.active_faults = faults

    def write_outputs(self, pulses: "array[int]", pump: int, dump: int) -> None:
        """Set the outputs of the next period."""
        disabled = not self._valves.write(pulses, pump)
        if disabled != self._disabled:
            self._disabled = disabled
            self._disable(disabled)
        if dump != self._dumping:
            self._dumping = dump
            self._dump(dump)

    def safe_outputs(self) -> None:
        """Fill closed, vent open, pump off: at once, whatever the valves' drivers are doing."""
        self._disable(1)
        self._disabled = True
        self._dump(0)
        self._dumping = 0
        self._valves.vent()

    def clear_faults(self) -> None:
        """Try again what has failed."""
        self._valves.clear_faults()

    def feed_watchdog(self, mode: int, faults: int) -> None:
        """A tick has gone well: feed the watchdog, show it on the LED."""
        feed(_WATCHDOG_MS)
        ticks = self._ticks
        if not ticks & 3:
            show_led(_SIO, self._led, ticks, mode, faults)

    def allow_overrun(self) -> None:
        """This tick may take long."""
        self._overrun_allowed = True

    def idle(self) -> None:
        """Collect what garbage there is, if that is necessary at all."""
        self.allow_overrun()
        if gc.mem_free() < _HEAP_LOW:
            gc.collect()

    def restart(self, into: int) -> None:
        """Start again: see RESTART. The link gets a moment to deliver the reply."""
        feed(_WATCHDOG_MS)
        time.sleep_ms(_WATCHDOG_MS // 2)
        if into == _BOOT_LOADER:
            machine.bootloader()
        if into == _PROMPT:
            watchdog.stop()
            self._link.close()
            sys.exit()
        machine.reset()


def _patient_watchdog() -> None:
    """Flash keeps everything waiting: until the next tick the watchdog waits, too."""
    feed(_FLASH_MS)


class PwmValves:
    """Valves on the RP2040's own PWM."""

    silent = False  # whether a chip between us and the valves does not answer
    stopped = False  # whether `start_clock` is wanted when the next period begins

    def __init__(self, board: "ModuleType"):
        self._bubbles = board.BUBBLES
        self._tick_us = board.TICK_US

    def connect(self) -> None:
        """Hand the pins to the PWM, which already holds all valves safe."""
        for pin in range(2 * self._bubbles):
            Pin(pin, Pin.ALT, alt=Pin.ALT_PWM)

    def write(self, pulses: "array[int]", pump: int) -> bool:
        """Set the next period; says whether the valves do as they are told."""
        pwm.write(_PWM, pulses, self._bubbles, pump)
        return True

    def vent(self) -> None:
        """Fill closed, vent open in the next period."""
        pwm.vent(_PWM, self._bubbles, self._tick_us)

    def clear_faults(self) -> None:
        """Nothing here fails."""


class ExpanderValves:
    """Valves on PCA9685, whose clock is made here so that their periods are ticks."""

    def __init__(self, board: "ModuleType", mhz: int):
        self.silent = False
        self.stopped = False
        self._tick_us = board.TICK_US
        self._divider = clock.divider(mhz, board.TICK_US, pca9685.CLOCKS)
        self._safe = array("H", bytearray(4 * board.BUBBLES))
        for index in range(1, 2 * board.BUBBLES, 2):
            self._safe[index] = board.TICK_US
        bus = I2C(0, freq=_I2C_HZ, sda=Pin(board.PIN_SDA), scl=Pin(board.PIN_SCL), timeout=_I2C_TIMEOUT_US)
        self._chips = []
        first = 0
        for address, bubbles in board.DRIVERS:
            self._chips.append(pca9685.Pca9685(bus, address, first, bubbles, board.TICK_US))
            first += bubbles
        self._turn = 0
        self._ticks = 0
        Pin(board.PIN_CLOCK, Pin.ALT, alt=Pin.ALT_GPCK)

    def connect(self) -> None:
        """Set all chips up with safe outputs; they count once the clock runs."""
        clock.stop()
        for chip in self._chips:
            chip.start()
            chip.write(self._safe, True)
            chip.wake()
        self.stopped = True
        self.silent = False

    def start_clock(self) -> None:
        """A period of the tick has just begun: let those of the chips begin."""
        clock.start(self._divider)
        self.stopped = False

    def write(self, pulses: "array[int]", pump: int) -> bool:
        """Set the next period; says whether the valves do as they are told."""
        pwm.write(_PWM, pulses, 0, pump)
        chips = self._chips
        turn = self._turn + 1
        if turn == len(chips):
            turn = 0
        self._turn = turn
        chips[turn].check()
        self._ticks += 1
        again = not self._ticks & 3
        silent = False
        for index in range(len(chips)):
            chip = chips[index]
            chip.write(pulses, index == turn and again)
            if chip.missing:
                silent = True
        self.silent = silent
        return not silent

    def vent(self) -> None:
        """Fill closed, vent open in the next period; `DISABLE` has done it already. Pump off."""
        pwm.vent(_PWM, 0, 0)
        for chip in self._chips:
            chip.write(self._safe, False)

    def clear_faults(self) -> None:
        """Ask chips that were silent again."""
        if self.silent:
            self.connect()
