"""MCP3208, as seen from its pins: eight 12-bit inputs on SPI (Microchip DS21298E, section 5 and figure 5-1)."""

from collections.abc import Callable

from bubbleskin.sim.rp2040.bus import SpiChip

_SETTING = 4  # bits after the start bit: single or differential, then the channel
_PULLED_UP = 1  # what the line reads while the chip does not drive it


class Mcp3208(SpiChip):
    """`sample(channel)` is the count, 0 to 4095, at an input now. `silent`: it has died and drives nothing.

    A conversion: the first one after chip select is the start bit; four bits of setting follow; the input is
    sampled in the clock after them; then come a zero (the null bit) and twelve bits, most significant first,
    and then the same bits the other way round, of which zeros are all that is left after bit 11.
    """

    def __init__(self, sample: Callable[[int], int]):
        self.silent = False
        self._sample = sample
        self._clock = -1  # clocks since the start bit, -1 before it
        self._setting = 0
        self._answer = 0

    def select(self, selected: bool) -> None:
        """Either edge ends a conversion."""
        self._clock = -1
        self._setting = 0

    def transfer(self, byte: int) -> int:
        """Eight clocks."""
        answer = 0
        for bit in range(7, -1, -1):
            answer = answer << 1 | self._shift(byte >> bit & 1)
        return answer

    def _shift(self, bit: int) -> int:
        if self.silent:
            return _PULLED_UP
        if self._clock < 0:
            self._clock = 0 if bit else -1
            return _PULLED_UP
        self._clock += 1
        if self._clock <= _SETTING:
            self._setting = self._setting << 1 | bit
            return _PULLED_UP
        if self._clock == _SETTING + 1:
            self._answer = self._convert()
            return _PULLED_UP
        place = _SETTING + 2 + 12 - self._clock  # 12 at the null bit, 11 at the first of the answer
        if place == 12:
            return 0
        if place >= 0:
            return self._answer >> place & 1
        return self._answer >> -place & 1 if place >= -11 else 0

    def _convert(self) -> int:
        channel = self._setting & 7
        if self._setting & 8:
            return self._sample(channel)
        return max(self._sample(channel) - self._sample(channel ^ 1), 0)
