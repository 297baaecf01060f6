"""PCA9685, as seen from its pins: sixteen 12-bit PWM outputs on I2C (NXP PCA9685 rev. 4, sections 7.3 and 7.4).

One reading of the datasheet is an assumption: it has new values taken up "at the end of the LOW cycle" (7.3.3),
and here that is when the counter of 4096 wraps, for every output.
"""

from collections.abc import Callable
from typing import Any

from bubbleskin.sim.rp2040.bus import NANOS, I2cChip

_MODE1, _MODE2, _LED0, _ALL_LED, _PRE_SCALE = 0x00, 0x01, 0x06, 0xFA, 0xFE
_EXTCLK, _INCREMENT, _SLEEP, _ALL_CALL = 0x40, 0x20, 0x10, 0x01
_ALL_CALL_ADDRESS = 0x70
_OUTPUTS = 16
_PERIOD_COUNTS = 4096
_FULL = 0x1000  # of ON: always on; of OFF: always off, which wins
_INTERNAL_HZ = 25e6


class Pca9685(I2cChip):
    """A chip at `address` on a bus. `changed(output, level)` is called for every edge at its sixteen outputs.

    `external_hz()` is the clock at its EXTCLK pin; call `clock_changed` when that has changed. `silent`: it does
    not answer any more, and its outputs go on as they were told last.
    """

    def __init__(self, chip: Any, address: int, changed: Callable[[int, bool], None], external_hz: Callable[[], float]):
        self.silent = False
        self._address = address
        self._changed = changed
        self._external_hz = external_hz
        self._clock = chip.mcu.clock
        self._alarm = self._clock.create_alarm(self._event)
        self._levels = [False] * _OUTPUTS
        self._latched: list[tuple[int, int]] = [(0, _FULL)] * _OUTPUTS
        self._events: list[int] = []
        self._count = 0.0  # at `_since`; it goes on from there at `_rate` counts per ns
        self._since = 0.0
        self._rate = 0.0
        self._next = 0
        self._power_on()

    def _power_on(self) -> None:
        self._registers = bytearray(256)
        self._registers[_MODE1] = _SLEEP | _ALL_CALL
        self._registers[_MODE2] = 0x04
        self._registers[0x05] = _ALL_CALL_ADDRESS << 1
        for output in range(_OUTPUTS):
            self._registers[_LED0 + 4 * output + 3] = _FULL >> 8
        self._registers[_PRE_SCALE] = 0x1E
        self._staged: list[tuple[int, int]] = []
        self._pointer = -1

    # ---- the bus

    def start(self, address: int, read: bool) -> bool:
        """Its own address, or that of all, or the general call that resets."""
        if self.silent:
            return False
        self._general = address == 0
        mode1 = self._registers[_MODE1]
        if address == self._address or (mode1 & _ALL_CALL and address == self._registers[0x05] >> 1):
            if not read:
                self._pointer = -1
            return True
        return self._general and not read

    def write(self, byte: int) -> bool:
        """The register's number, then its values."""
        if self._general:
            if byte == 0x06:
                self._power_on()
                self._go()
            return byte == 0x06
        if self._pointer < 0:
            self._pointer = byte
        else:
            self._staged.append((self._pointer, byte))
            self._advance()
        return True

    def read(self) -> int:
        """The register that was named last."""
        value = self._registers[self._pointer]
        self._advance()
        return value

    def stop(self) -> None:
        """What was written comes into force together (OCH is 0)."""
        staged, self._staged = self._staged, []
        for register, value in staged:
            self._set(register, value)

    def _advance(self) -> None:
        if self._registers[_MODE1] & _INCREMENT:
            self._pointer = 0 if self._pointer == 0x45 else (self._pointer + 1) & 0xFF

    def _set(self, register: int, value: int) -> None:
        registers = self._registers
        asleep = registers[_MODE1] & _SLEEP
        if register == _PRE_SCALE:
            if asleep:
                registers[_PRE_SCALE] = max(value, 3)
        elif register == _MODE1:
            external = registers[_MODE1] & _EXTCLK  # stays until power goes
            if asleep and value & _SLEEP:
                external |= value & _EXTCLK
            registers[_MODE1] = value & ~(0x80 | _EXTCLK) | external
            if bool(asleep) != bool(value & _SLEEP):
                self._go()
        elif _ALL_LED <= register < _ALL_LED + 4:
            for output in range(_OUTPUTS):
                registers[_LED0 + 4 * output + register - _ALL_LED] = value
        elif register < _LED0 + 4 * _OUTPUTS:
            registers[register] = value

    # ---- the outputs

    @property
    def widths(self) -> list[tuple[float, float]]:
        """Of each output in the period that runs: from when to when it is on, in periods; (0, 1) is always."""
        return [_window(on, off) for on, off in self._latched]

    def level(self, output: int) -> bool:
        """Whether the output is high, but for output enable."""
        return self._levels[output]

    @property
    def period(self) -> float:
        """Seconds of one period; infinite while it is not clocked."""
        return _PERIOD_COUNTS / self._rate / NANOS if self._rate else float("inf")

    def clock_changed(self) -> None:
        """The clock at EXTCLK has changed, stopped or begun."""
        if self._registers[_MODE1] & _EXTCLK:
            now = self._clock.nanos
            self._count += (now - self._since) * self._rate
            self._since = now
            self._run()

    def _go(self) -> None:
        """Wake up, counting from 0, or fall asleep."""
        self._count = 0.0
        self._since = self._clock.nanos
        self._latch()
        self._run()

    def _run(self) -> None:
        mode1 = self._registers[_MODE1]
        hz = self._external_hz() if mode1 & _EXTCLK else _INTERNAL_HZ
        self._rate = 0.0 if mode1 & _SLEEP else hz / (self._registers[_PRE_SCALE] + 1) / NANOS
        self._alarm.cancel()
        if self._rate:
            self._next = next(i for i, count in enumerate(self._events) if count > self._count)
            self._arm()

    def _arm(self) -> None:
        ahead = (self._events[self._next] - self._count) / self._rate
        self._alarm.schedule(max(self._since + ahead - self._clock.nanos, 0.0))

    def _event(self) -> None:
        count = self._events[self._next]
        if count == _PERIOD_COUNTS:
            self._since += (_PERIOD_COUNTS - self._count) / self._rate
            self._count = 0.0
            self._latch()
        else:
            self._look(count)
            self._next += 1
        self._arm()

    def _latch(self) -> None:
        registers = self._registers
        self._latched = [
            (
                registers[at] | registers[at + 1] << 8,
                registers[at + 2] | registers[at + 3] << 8,
            )
            for at in range(_LED0, _LED0 + 4 * _OUTPUTS, 4)
        ]
        edges = {count for pair in self._latched for count in pair if 0 < count < _PERIOD_COUNTS}
        self._events = [*sorted(edges), _PERIOD_COUNTS]
        self._next = 0
        self._look(0)

    def _look(self, count: int) -> None:
        awake = not self._registers[_MODE1] & _SLEEP
        for output, (on, off) in enumerate(self._latched):
            if off & _FULL or not awake:
                level = False
            elif on & _FULL:
                level = True
            elif on <= off:
                level = on <= count < off
            else:
                level = count >= on or count < off
            if level != self._levels[output]:
                self._levels[output] = level
                self._changed(output, level)


def _window(on: int, off: int) -> tuple[float, float]:
    if off & _FULL:
        return 0.0, 0.0
    if on & _FULL:
        return 0.0, 1.0
    return on / _PERIOD_COUNTS, (off if off > on else _PERIOD_COUNTS) / _PERIOD_COUNTS
