# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""PCA9685: sixteen 12-bit PWM outputs on I2C (NXP PCA9685 rev. 4, section 7.3), here for pairs of valves.

One period is 4096 counts of EXTCLK / (PRE_SCALE + 1). The RP2040 makes EXTCLK from its own clock, so a period
is exactly a tick, and the clock is started when all chips are ready, together with the tick. New values are
taken up at the end of a period (7.3.3). Bubble i of a chip has output 2i for its fill and 2i + 1 for its vent:
a fill output is on from count 0 to its width, a vent output, inverted, from its width to the end.

    LEDn_ON, LEDn_OFF   12 bits each, low byte first, from register 6 on; bit 12 of ON: always on, of OFF: always off
    MODE1               0x80 restart, 0x40 EXTCLK, 0x20 auto-increment, 0x10 sleep, 0x01 all-call
    MODE2               0x04 totem pole; OUTNE 00: outputs low while /OE is high

`bus` is a `machine.I2C`: `writeto`, `readfrom_into`. It raises OSError when a chip does not answer.
"""

from bubble_protocol.frame import copy
from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr8, ptr16

if TYPE_CHECKING:
    from array import array

    from machine import I2C

    from bubble_protocol.mpy_compat import Buffer

_LED0 = 6
_DIVIDE = 5  # clocks of EXTCLK per count: PRE_SCALE + 1
_MODE1_AWAKE = 0x60  # EXTCLK, auto-increment
COUNTS = 4096
CLOCKS = COUNTS * _DIVIDE
"""Clocks of EXTCLK in one period."""

_FULL = const(16)  # bit 12, in the high byte


@micropython.viper
def encode(out: ptr8, pulse: ptr16, first: int, bubbles: int, tick_us: int, scale: int) -> int:
    """Put the outputs of `bubbles` bubbles from number `first` on into `out[1:]`; returns those that have changed.

    One bit a bubble. `scale` is counts per µs, << 16.
    """
    at = 1
    changed = 0
    bit = 1
    valve = 2 * first
    stop = valve + 2 * bubbles
    vent = 0
    while valve < stop:
        width = pulse[valve]
        on = 0
        off = width * scale + 32768 >> 16
        if width >= tick_us or off >= 4096:
            on = 0 if vent else 4096
            off = 4096 if vent else 0
        elif off == 0:
            on = 4096 if vent else 0
            off = 0 if vent else 4096
        elif vent:
            on = off
            off = 0
        if out[at] | out[at + 1] << 8 != on or out[at + 2] | out[at + 3] << 8 != off:
            changed |= bit
            out[at] = on & 255
            out[at + 1] = on >> 8
            out[at + 2] = off & 255
            out[at + 3] = off >> 8
        at += 4
        valve += 1
        vent = 1 - vent
        if vent == 0:
            bit += bit
    return changed


class Pca9685:
    """One chip at `address`, with the valves of `bubbles` bubbles from number `first` on.

    `missing`: it has not answered. From then on it is left alone until `start`.
    """

    def __init__(self, bus: "I2C", address: int, first: int, bubbles: int, tick_us: int):
        self.missing = True
        self._bus = bus
        self._address = address
        self._first = first
        self._bubbles = bubbles
        self._tick_us = tick_us
        self._scale = (COUNTS << 16) // tick_us
        self._frame = bytearray(1 + 8 * bubbles)
        self._frame[0] = _LED0
        self._part = bytearray(1 + 8)
        self._turn = 0
        self._mode = bytearray(1)  # MODE1

    def start(self) -> None:
        """Set the chip up, asleep, after power-on or whatever went before."""
        self.missing = False
        self._command(b"\x00\x10")  # MODE1: sleep, which PRE_SCALE and EXTCLK need
        self._command(b"\x00\x50")  # EXTCLK, which stays set until power goes
        self._command(b"\xfe\x04")  # PRE_SCALE
        self._command(b"\x01\x04")  # MODE2: totem pole, outputs low while /OE is high
        self._command(b"\x00\x70")  # auto-increment
        for index in range(1, len(self._frame)):
            self._frame[index] = 255  # no output: the next `write` sends all

    def wake(self) -> None:
        """Count: outputs follow what has been written."""
        self._command(b"\x00\x60")  # MODE1: EXTCLK, auto-increment, awake

    def write(self, pulses: "array[int]", again: bool) -> None:
        """Set the next period. What has not changed is only sent `again`, one bubble at a time, where that is wanted."""
        changed = encode(self._frame, pulses, self._first, self._bubbles, self._tick_us, self._scale)
        if again:
            turn = self._turn + 1
            if turn >= self._bubbles:
                turn = 0
            self._turn = turn
            changed |= 1 << turn
        if not changed:
            return
        more = changed & (changed - 1)  # without the first
        if more & (more - 1):  # three or more: all at once is quicker
            self._command(self._frame)
            return
        part = self._part
        at = 1
        while changed:
            if changed & 1:
                part[0] = _LED0 - 1 + at
                copy(self._frame, at, at + 8, part, 1)
                self._command(part)
            changed >>= 1
            at += 8

    def check(self) -> None:
        """See that the chip is there and awake: one that has lost its power sleeps."""
        self._command(b"\x00")
        if self.missing:
            return
        try:
            self._bus.readfrom_into(self._address, self._mode)
            self.missing = self._mode[0] != _MODE1_AWAKE
        except OSError:
            self.missing = True

    def _command(self, data: "Buffer") -> None:
        if self.missing:
            return
        try:
            self._bus.writeto(self._address, data)
        except OSError:  # allocates, but once: the chip is not asked again
            self.missing = True
