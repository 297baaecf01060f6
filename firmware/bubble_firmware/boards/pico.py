# mypy: disable-error-code="attr-defined,union-attr,call-overload"
"""Hands of a board that is built around a Raspberry Pi Pico: what `bubble_firmware.app` calls, in hardware.

Without power, in reset and in the boot loader all pins are inputs and the resistors of the board decide:
valve buffers disabled, so every fill valve closed and every vent valve open. See docs/hardware.md.
"""

import gc
import os
import sys
import time

import machine
from machine import ADC, SPI, WDT, Pin

from bubble_firmware.drivers import mcp3208, pwm, watchdog
from bubble_firmware.drivers.usb_serial import UsbSerial
from bubble_protocol import messages

_WATCHDOG_MS = 80
_SPI_HZ = 1000000
_MS_US = 1000
_BLINK = 64  # ticks

_PWM = pwm.BASE
_SPI = mcp3208.SPI0
_SIO = mcp3208.SIO


class Hands:
    """The hardware of `board`. Nothing in it allocates or raises once `wait` has been called."""

    self_test = True

    def __init__(self, board):
        self._disable = Pin(board.PIN_DISABLE, Pin.OUT, value=1)
        self._dump = Pin(board.PIN_DUMP, Pin.OUT, value=0)
        self._led = Pin(board.PIN_LED, Pin.OUT, value=1)
        self._estop = Pin(board.PIN_ESTOP, Pin.IN, Pin.PULL_UP)
        self._tick_us = board.TICK_US
        self._board = board
        self.boot_faults = messages.WATCHDOG if watchdog.has_bitten() else 0
        self.boot_id = int.from_bytes(os.urandom(4), "little") & 0x3FFFFFFF
        self.alarms = 0
        self.late_ticks = 0
        mhz = machine.freq() // 1000000
        if board.VALVES == "pwm":
            self._valves = PwmValves(board)
            pwm.start(_PWM, board.BUBBLES, board.TICK_US, mhz)
        else:
            from bubble_firmware.drivers.pca9685 import Pca9685Valves

            pwm.start(_PWM, 1, board.TICK_US, mhz)
            self._valves = Pca9685Valves(board)
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
        self._watchdog = None
        self._began = 0
        self._ticks = 0

    def wait(self):
        """Sleep until the next period has begun; returns how many have begun since the last call."""
        if self._watchdog is None:
            gc.collect()
            self._watchdog = WDT(timeout=_WATCHDOG_MS)
            pwm.wrapped(_PWM)
        left = self._tick_us - pwm.phase(_PWM)
        if pwm.wrapped(_PWM):
            self.late_ticks += 1
        else:
            if left > _MS_US + 200:
                time.sleep_ms((left - 200) // _MS_US)
            while not pwm.wrapped(_PWM):
                pass
        began = time.ticks_us()
        periods = 1
        if self._ticks:
            periods = (time.ticks_diff(began, self._began) + self._tick_us // 2) // self._tick_us
        self._began = time.ticks_add(began, -pwm.phase(_PWM))
        self._ticks += 1
        return periods if periods > 0 else 1

    def sense(self, counts):
        """Fill in the counts of this tick; look at everything else that may go wrong."""
        at = 0
        alarms = 0
        for converter in self._board.CONVERTERS:
            if mcp3208.read(_SPI, _SIO, converter[0], converter[1], counts, at) < converter[1]:
                alarms = messages.SENSOR_CHIP
            at += converter[1]
        counts[at] = self._supply.read_u16() >> 4
        if self._estop():
            alarms |= messages.ESTOP
        if self._valves.silent:
            alarms |= messages.VALVE_CHIP
        self.alarms = alarms

    def act(self, pulses, pump, dump):
        """Set the outputs of the next period."""
        pwm.pump(_PWM, pump)
        self._dump(1 if dump else 0)
        self._disable(0 if self._valves.write(pulses) else 1)

    def vent(self):
        """Fill closed, vent open, pump off: at once, whatever the valves' drivers are doing."""
        self._disable(1)
        pwm.pump(_PWM, 0)
        self._dump(0)
        self._valves.vent()

    def clear(self):
        """Try again what has failed."""
        self._valves.clear()

    def alive(self, mode, faults):
        """A tick has gone well: feed the watchdog, show it on the LED."""
        self._watchdog.feed()
        beat = self._ticks & (_BLINK - 1)
        if faults:
            self._led(beat >> 3 & 1)
        else:
            self._led(1 if mode != messages.VENTED or beat < 4 else 0)

    def tidy(self):
        """A moment when nothing is urgent."""
        gc.collect()

    def restart(self, into):
        """Start again: see RESTART. The link gets a moment to deliver the reply."""
        self._watchdog.feed()
        time.sleep_ms(_WATCHDOG_MS // 2)
        if into == messages.BOOT_LOADER:
            machine.bootloader()
        if into == messages.PROMPT:
            watchdog.stop()
            self._link.close()
            sys.exit()
        machine.reset()

    def phase_us(self):
        """Since this tick's period began."""
        return time.ticks_diff(time.ticks_us(), self._began)


class PwmValves:
    """Valves on the RP2040's own PWM."""

    silent = False

    def __init__(self, board):
        self._bubbles = board.BUBBLES
        self._tick_us = board.TICK_US

    def connect(self):
        """Hand the pins to the PWM, which already holds all valves safe."""
        for pin in range(2 * self._bubbles):
            Pin(pin, Pin.ALT, alt=Pin.ALT_PWM)

    def write(self, pulses):
        """Set the next period; says whether the valves do as they are told."""
        pwm.write(_PWM, pulses, self._bubbles)
        return True

    def vent(self):
        """Fill closed, vent open in the next period."""
        pwm.vent(_PWM, self._bubbles, self._tick_us)

    def clear(self):
        """Nothing here fails."""
