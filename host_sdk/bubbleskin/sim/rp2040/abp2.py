"""Honeywell ABP2, as seen from its pins: a pressure sensor on I2C (ABP2 series datasheet, "Sensor output")."""

from collections.abc import Callable

from bubbleskin.sim.rp2040.bus import I2cChip

_MEASURE = 0xAA
_POWERED, _BUSY = 0x40, 0x20  # of the status byte
_CONVERSION_NANOS = 5e6
_LOW, _HIGH = 0.1, 0.9  # transfer function A: share of 2^24 counts at either end of the range


class Abp2(I2cChip):
    """A sensor at `address` for `low` to `high` Pa gauge; `pressure()` is what it is exposed to, `now()` ns.

    0xAA 0x00 0x00 starts a conversion, which takes 5 ms. A read gives the status, three bytes of pressure and
    three of temperature, the last conversion's; the status says whether one is under way.
    """

    def __init__(
        self,
        pressure: Callable[[], float],
        now: Callable[[], float],
        low: float = 0.0,
        high: float = 100e3,
        address: int = 0x28,
    ):
        self.silent = False
        self._pressure = pressure
        self._now = now
        self._low, self._high = low, high
        self._address = address
        self._done: float | None = None
        self._result = bytes(6)
        self._pending = bytes(6)
        self._command = bytearray()
        self._answer = b""

    def start(self, address: int, read: bool) -> bool:
        """Its address."""
        if self.silent or address != self._address:
            return False
        self._command.clear()
        if read:
            busy = self._done is not None and self._now() < self._done
            if self._done is not None and not busy:
                self._result, self._done = self._pending, None
            self._answer = bytes([_POWERED | (_BUSY if busy else 0)]) + self._result
        return True

    def write(self, byte: int) -> bool:
        """The command."""
        self._command.append(byte)
        return len(self._command) <= 3

    def read(self) -> int:
        """The next byte of the answer."""
        value, self._answer = self._answer[:1], self._answer[1:]
        return value[0] if value else 0xFF

    def stop(self) -> None:
        """A whole command starts a conversion."""
        if bytes(self._command) == bytes([_MEASURE, 0, 0]):
            self._pending = self.counts(self._pressure()).to_bytes(3, "big") + (1 << 22).to_bytes(3, "big")
            self._done = self._now() + _CONVERSION_NANOS
        self._command.clear()

    def counts(self, pascals: float) -> int:
        """The 24-bit count of a pressure, clipped."""
        share = _LOW + (_HIGH - _LOW) * (pascals - self._low) / (self._high - self._low)
        return min(max(round(share * (1 << 24)), 0), (1 << 24) - 1)
