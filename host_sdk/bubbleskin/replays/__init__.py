"""A full recording, and the firmware that lives through it again: identical, or the first tick and value that differ."""

from bubbleskin.replays.compare import Difference
from bubbleskin.replays.run import ON, Replayed, replay

__all__ = ["ON", "Difference", "Replayed", "replay"]
