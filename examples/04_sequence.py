"""Shapes in a row, played by the wristband's own clock: up together, and down one after the other."""

import sys

import bubbleskin as bs

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    shape = [10.0] * skin.info.bubbles
    steps = [bs.Step(shape, ramp=0.8, easing="smooth", until=bs.Settled(timeout_s=2), name="up")]
    for bubble in range(skin.info.bubbles):
        shape = [*shape[:bubble], 6.0, *shape[bubble + 1 :]]
        steps.append(bs.Step(shape, ramp=0.3, name=f"bubble {bubble} down"))
    played = skin.play(bs.Sequence(steps, loops=2))
    print(f"{len(played.steps)} steps in {played.ended - played.began[0]:.1f} s")
