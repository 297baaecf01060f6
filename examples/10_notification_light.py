"""A notification light that is felt: one pulse for each line on standard input, such as `tail -f mail.log | python THIS`."""

import sys

import bubbleskin as bs
from bubbleskin.demonstrations.pulse import pulse, pulse_per_line

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    gentle = pulse(skin.layout, rate_hz=0.4, depth_mm=4, loops=1)
    for lines in pulse_per_line(skin, sys.stdin, gentle):
        print(f"felt: {lines[-1]}")
