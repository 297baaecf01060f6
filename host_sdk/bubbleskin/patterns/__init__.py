"""Heights that move, in a few words: h = f(x, y, t), in Python as `bs.patterns.ripple().slow(2)`, typed as `ripple.slow(2)`."""

from bubbleskin.patterns.pattern import Pattern, level
from bubbleskin.patterns.typed import parse
from bubbleskin.patterns.words import WORDS, noise, pulse, ripple, seq, wave

__all__ = ["WORDS", "Pattern", "level", "noise", "parse", "pulse", "ripple", "seq", "wave"]
