"""The topographic mouse: a volcano under the wristband, felt while a pointer circles over it."""

import sys

import bubbleskin as bs
from bubbleskin.demonstrations.pointer import PATHS, Pointer, follow
from bubbleskin.demonstrations.terrain import Terrain

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    terrain = Terrain.named("volcano", skin.layout)
    for moment in follow(skin, terrain, Pointer(PATHS["wander"](terrain)), mode="stretched", seconds=4):
        if round(moment.time * 30) % 30 == 0:  # once a second
            patch = terrain.look(moment.x_mm, moment.y_mm, "stretched", skin.state())
            print(f"({moment.x_mm:.0f}, {moment.y_mm:.0f}) mm: {patch}")
    skin.vent()
