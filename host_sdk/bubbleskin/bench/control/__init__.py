"""True heights of contenders on the same plants: the firmware, and the law of the first release."""

from bubbleskin.bench.control.measure import rows

__all__ = ["rows"]
