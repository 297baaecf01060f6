"""Heights that move, in a few words: h = f(x, y, t). Type others after the port, such as 'seq(wave, noise(seed=3))'."""

import sys

import bubbleskin as bs

typed = sys.argv[2] if len(sys.argv) > 2 else "ripple.slow(2) * 0.5 + wave.rotate(30) * 0.5"
pattern = bs.patterns.parse(typed)
with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    sequence = pattern.sequence(skin.layout, seconds=6)
    print(f"{pattern}: {len(sequence.each)} steps, within 0.1 mm")
    skin.play(sequence)
    skin.vent()
