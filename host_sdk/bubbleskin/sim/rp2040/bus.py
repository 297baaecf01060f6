"""SPI and I2C of the emulated chip, with chips at the other end. Every byte takes the time its bits take."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

NANOS = 1e9
_SPI_GAP = 1.5
"""Bit times between two words: the PL022 lifts its own select between them in mode 0."""
_IC_FS_SPKLEN = 0xA0
"""Register with the length of spikes that are suppressed, in clocks: RP2040 datasheet, 4.3.17."""


class SpiChip(ABC):
    """A chip behind a chip select."""

    @abstractmethod
    def select(self, selected: bool) -> None:
        """Chip select has gone low, or high again."""

    @abstractmethod
    def transfer(self, byte: int) -> int:
        """The byte that it sends while it receives `byte`."""


class SpiBus:
    """The chips on one of the RP2040's SPI blocks. While none is selected, or none answers, the line is pulled up."""

    def __init__(self, chip: Any, block: int):
        self._spi = chip.mcu.spi[block]
        self._chip = chip
        self._selected: list[SpiChip] = []
        self._byte = 0
        self._done = chip.mcu.clock.create_alarm(self._complete)
        self._spi.on_transmit = self._transmit

    def add(self, device: SpiChip, select_pin: int) -> None:
        """Solder `device` to the bus, its chip select to GPIO `select_pin`."""

        def level(high: bool | None) -> None:
            if high is False:
                self._selected.append(device)
            elif device in self._selected:
                self._selected.remove(device)
            device.select(high is False)

        self._chip.on_pin(select_pin, level)

    def _transmit(self, byte: int) -> None:
        self._byte = byte
        self._done.schedule((self._spi.data_bits + _SPI_GAP) * NANOS / self._spi.clock_frequency)

    def _complete(self) -> None:
        answer = 0xFF
        for device in self._selected:  # two at once pull each other's ones down
            answer &= device.transfer(self._byte)
        self._spi.complete_transmit(answer)


class I2cChip(ABC):
    """A chip on an I2C bus. It does not acknowledge by returning False."""

    @abstractmethod
    def start(self, address: int, read: bool) -> bool:
        """The bus has addressed `address`; whether this chip takes part."""

    @abstractmethod
    def write(self, byte: int) -> bool:
        """Take a byte; whether it is acknowledged."""

    @abstractmethod
    def read(self) -> int:
        """The next byte."""

    @abstractmethod
    def stop(self) -> None:
        """The transfer is over."""


class I2cBus:
    """The chips on one of the RP2040's I2C blocks. Where none acknowledges, the transfer is aborted."""

    def __init__(self, chip: Any, block: int):
        self._i2c = chip.mcu.i2c[block]
        self._chips: list[I2cChip] = []
        self._active: list[I2cChip] = []
        self._next: Callable[[], None] = lambda: None
        self._alarm = chip.mcu.clock.create_alarm(lambda: self._next())
        self._i2c.on_start = self._start
        self._i2c.on_connect = self._connect
        self._i2c.on_write_byte = self._write
        self._i2c.on_read_byte = self._read
        self._i2c.on_stop = self._stop

    def add(self, device: I2cChip) -> None:
        """Solder `device` to the bus."""
        self._chips.append(device)

    def _after(self, bits: float, then: Callable[[], None]) -> None:
        i2c = self._i2c
        # The bit of the DW_apb_i2c: RP2040 datasheet, 4.3.14.1.
        clocks = i2c.scl_high_period + i2c.read_uint32(_IC_FS_SPKLEN) + 7 + i2c.scl_low_period + 1
        self._next = then
        self._alarm.schedule(bits * clocks * NANOS / i2c.rp2040.clk_sys)

    def _start(self, repeated: bool) -> None:
        self._after(1, self._i2c.complete_start)

    def _connect(self, address: int, mode: int) -> None:
        def done() -> None:
            if repeated := self._active:
                for device in repeated:
                    device.stop()
            self._active = [device for device in self._chips if device.start(address, bool(mode))]
            self._i2c.complete_connect(bool(self._active))

        self._after(9, done)

    def _write(self, byte: int) -> None:
        def done() -> None:
            taken = [device.write(byte) for device in self._active]
            self._i2c.complete_write(any(taken))

        self._after(9, done)

    def _read(self, _more: bool) -> None:
        def done() -> None:
            value = 0xFF
            for device in self._active:
                value &= device.read()
            self._i2c.complete_read(value)

        self._after(9, done)

    def _stop(self) -> None:
        def done() -> None:
            active, self._active = self._active, []
            for device in active:
                device.stop()
            self._i2c.complete_stop()

        self._after(1, done)
