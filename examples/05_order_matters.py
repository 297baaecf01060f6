"""The same targets in two orders: a middle that goes first is lifted by the ring around it."""

import sys

import bubbleskin as bs

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    for sequence in (bs.sequences.pop_up(skin.layout), bs.sequences.flat_twin(skin.layout)):
        skin.play(sequence)
        if skin.simulated:  # nobody else sees how high a bubble is lifted
            print(f"{sequence.name}: the middle is truly at {skin.simulated.height_mm[0]:.1f} mm")
        skin.vent()
        skin.sleep(1.5)
