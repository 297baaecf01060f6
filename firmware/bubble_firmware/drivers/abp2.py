"""Honeywell ABP2 pressure sensors, all at one address, each on a channel of a TCA9548A (Honeywell 32350268, I2C section).

    AA 00 00    start a measurement; it takes up to 5 ms
    read        status, pressure in three bytes, temperature in three more, which nobody asks for here
    status      0x40 powered, 0x20 busy, 0x04 memory error, 0x01 saturated; good is 0x40
    pressure    10 % of 2**24 at the range's begin, 90 % at its end

One start goes to all sensors at once, through all channels of the switch. Each `read` brings what was started
the last time, so the tick, which must not be shorter than 5 ms, never waits. At 400 kHz eight sensors take 1.5 ms.
A sensor that does not answer is ABSENT and asked again after a while, because asking costs memory.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from array import array

    from machine import I2C

    from bubble_firmware.drivers.tca9548a import Tca9548a

# [constants] bubble_firmware.hal.base: ABSENT
_ABSENT = const(65535)
# [end of constants]

_ADDRESS = 0x28
_START = b"\xaa\x00\x00"
_POWERED = 0x40
_TENTH = 6554  # a tenth of 2**16: pressure without its last byte is used
_SPAN = 52429  # eight tenths
_AGAIN = 200  # reads


class Abp2:
    """`sensors` gauge sensors of 0 to `range_pa` on channels 0, 1, ... of `switch`, read as a converter's counts.

    A count is `pa_per_count`, `zero` stands for none.
    """

    def __init__(self, bus: "I2C", switch: "Tca9548a", sensors: int, range_pa: int, zero: int, pa_per_count: int):
        self.sensors = sensors
        self._bus = bus
        self._switch = switch
        self._zero = zero
        per = _SPAN * pa_per_count
        self._gain = ((range_pa << 16) + per // 2) // per
        self._all = (1 << sensors) - 1
        self._reply = bytearray(4)
        self._rest = bytearray(sensors)  # reads until a silent sensor is asked again
        self._switch_rest = 0
        self._started = False

    def read(self, counts: "array[int]", at: int) -> int:
        """Fill in `counts[at:]`, one per sensor, and start the next measurement; returns how many have answered."""
        answers = 0
        for channel in range(self.sensors):
            count = self._read(channel)
            counts[at + channel] = count
            if count != _ABSENT:
                answers += 1
        self._started = answers > 0
        if self._select(self._all):
            try:
                self._bus.writeto(_ADDRESS, _START)
                self._started = True
            except OSError:
                self._switch_rest = _AGAIN
        return answers

    def _read(self, channel: int) -> int:
        if not self._started:
            return _ABSENT
        if self._rest[channel]:
            self._rest[channel] -= 1
            return _ABSENT
        if not self._select(1 << channel):
            return _ABSENT
        reply = self._reply
        try:
            self._bus.readfrom_into(_ADDRESS, reply)
        except OSError:
            self._rest[channel] = _AGAIN
            return _ABSENT
        if reply[0] != _POWERED:
            return 0  # an end of the range: one may be noise
        count = self._zero + (((reply[1] << 8 | reply[2]) - _TENTH) * self._gain + 32768 >> 16)
        return 0 if count < 0 else 4095 if count > 4095 else count

    def _select(self, mask: int) -> bool:
        if self._switch_rest:
            self._switch_rest -= 1
            return False
        if self._switch.select(mask):
            return True
        self._switch_rest = _AGAIN
        return False
