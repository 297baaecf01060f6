"""Hardware made up within MicroPython: counts that follow the valves, with noise. It allocates nothing; for tests and tools."""

from bubble_firmware.drivers.flash import Memory
from bubble_firmware.hal.base import Hal


class FollowingHal(Hal):
    """A board whose pressures, in counts, rise while a fill valve is open and fall while a vent valve is.

    `fills`, `vents`, `rests`: ticks of bubbles with one valve or the other or neither open. `safe`: calls of `safe_outputs`.
    """

    def __init__(self, board):
        super().__init__(board)
        self.n = board.BUBBLES
        self.zero = board.SENSOR_ZERO
        self.level = bytearray(2 * self.n)
        self.flow = bytearray(self.n)  # what flows shows in the tube
        self.supply = 2550  # what is taken shows in the reservoir
        self.noise = 1
        self.fills = self.vents = self.rests = 0
        self.broken = False
        self.safe = 0
        self.flash = Memory(16384)

    def read_sensors(self, counts):
        """Fill in the counts; an OSError where the hardware is `broken`."""
        if self.broken:
            raise OSError(5)
        noise = self.noise
        level = self.level
        for i in range(self.n):
            noise = noise * 75 % 65537
            counts[i] = self.zero + (level[2 * i] | level[2 * i + 1] << 8) + (noise & 3) + self.flow[i]
        counts[self.n] = self.supply + (noise & 15)
        self.noise = noise

    def write_outputs(self, pulses, pump, dump):
        """Let the levels follow."""
        level = self.level
        self.supply += pump >> 12
        for i in range(self.n):
            self.supply -= pulses[2 * i] >> 11
            height = level[2 * i] | level[2 * i + 1] << 8
            fill = pulses[2 * i]
            vent = pulses[2 * i + 1]
            if fill:
                self.fills += 1
            elif vent:
                self.vents += 1
            else:
                self.rests += 1
            slow = 9 if height > 900 else 5
            height += (fill + 500 >> slow) - (vent + 500 >> slow)
            if height < 0:
                height = 0
            if height > 1900:
                height = 1900
            self.flow[i] = 0 if vent else 250 if fill else 90
            level[2 * i] = height & 255
            level[2 * i + 1] = height >> 8

        if self.supply > 2550:
            self.supply = 2550
        if self.supply < 2200:
            self.supply = 2200

    def safe_outputs(self):
        """Count it."""
        self.safe += 1

    def phase_us(self):
        """Never at a tick's very beginning."""
        return 100
