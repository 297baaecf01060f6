"""A first shape: the middle bubble up. Run it with a port, or without for a simulated wristband."""

import sys

import bubbleskin as bs

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    heights = [7.0] * skin.info.bubbles  # mm, one per bubble
    heights[0] = 12.0
    state = skin.show(heights)  # returns when all have settled
    print(f"The middle is at {state.height_mm[0]:.1f} mm, its neighbours are at {state.height_mm[1:].mean():.1f} mm.")
