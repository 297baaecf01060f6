"""What all bubbles do, 20 times a second, while the wristband takes a shape."""

import sys

import bubbleskin as bs

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    skin.show(bs.shapes.plane(skin.layout), over=1.0, wait=False)
    for state in skin.telemetry(rate_hz=20):
        print(" ".join(f"{height:5.2f}" for height in state.height_mm), state.status[0])
        if state.arrived:
            break
