"""Tasks for sweeps under test; workers import them by name."""

import os

from bubbleskin.errors import InvalidInput


def rise(skin, random, *, height_mm=8.0):
    """The true height of bubble 0 after a second."""
    skin.show([height_mm] * skin.info.bubbles, wait=False)
    skin.sleep(1.0)
    return {"height_mm": float(skin.simulated.height_mm[0]), "drawn": float(random.random())}


def fails(skin, random):
    """On every other wristband."""
    seed = int(random.integers(1 << 30))
    if seed % 2:
        raise InvalidInput("This one does not want to.")
    return {"seed_drawn": float(seed)}


def raises(skin, random):
    """A mistake in a task."""
    return {"ratio": 1 / 0}


def no_number(skin, random):
    """What is no number is no figure."""
    return {"height_mm": "high"}


def dies(skin, random):
    """As one that the system kills."""
    os._exit(9)


def nothing(skin, random):
    """Forgot to return."""
