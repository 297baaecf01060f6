"""How long ticks take and how late they begin: counts in bins, made once."""

from array import array

BINS = 24


class Histogram:
    """Counts of times in bins of `width` µs; the last bin also takes everything longer."""

    def __init__(self, width):
        self.width = width
        self.bins = array("i", bytearray(4 * BINS))

    def count(self, us):
        """Count one time."""
        index = us // self.width
        self.bins[index if index < BINS else BINS - 1] += 1
