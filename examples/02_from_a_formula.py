"""A shape by a formula: a dome that moves through the wristband, from its lower left to its upper right."""

import sys

import numpy as np

import bubbleskin as bs

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    for place in np.linspace(-15, 15, 7):  # mm
        skin.show(lambda x, y, at=place: 6 + 5 * np.exp(-((x - at) ** 2 + (y - at) ** 2) / 150), over=0.2)
        print(f"The dome is at {place:+.0f} mm, bubble {int(skin.state().height_mm.argmax())} is the highest.")
