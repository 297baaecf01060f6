"""The same targets in two orders: a middle that goes first is lifted by the ring around it."""

import sys

import bubbleskin as bs

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    for make in (bs.sequences.pop_up, bs.sequences.flat_twin):
        sequence = make(skin.layout, high_mm=11.0)  # higher ones are cut: nobody is lifted past the limit
        skin.play(sequence)
        if skin.simulated:  # nobody else sees how high a bubble is lifted
            print(f"{sequence.name}: the middle is truly at {skin.simulated.height_mm[0]:.1f} mm")
        skin.vent()
        skin.sleep(1.5)
