"""Draw the pictures of `docs/patterns.md`, and the heights behind them as a table.

python tools/generate/pattern_pictures.py            # draw them, write the table
python tools/generate/pattern_pictures.py --check    # fail if the heights are not those of the table
"""

from collections.abc import Callable
from pathlib import Path

import generated

import bubbleskin as bs
from bubbleskin.plot.patterns import draw_patterns

LAYOUT = bs.Layout.hexagon(3)
NUMBERS = Path("docs/pictures/patterns.csv")
WORDS = {  # each at six moments, so many seconds apart
    "ripple": ("ripple", 0.25),
    "wave": ("wave", 0.25),
    "pulse": ("pulse", 0.75),
    "noise": ("noise", 1.0),
    "seq": ("seq(0, wave, 1)", 0.5),
}
CHANGES = (
    "wave",
    "wave.slow(2)",
    "wave.rotate(90)",
    "wave.mirror",
    "wave.shift(0.5)",
    "wave * ripple",
    "wave * 0.5 + 0.5",
)
MOMENTS = 6


def moments(apart: float) -> list[float]:
    return [k * apart for k in range(MOMENTS)]


def one_word(text: str, apart: float) -> Callable[[Path], object]:
    return lambda path: draw_patterns(path, LAYOUT, {text: bs.patterns.parse(text)}, moments(apart))


def changes(path: Path) -> None:
    draw_patterns(path, LAYOUT, {text: bs.patterns.parse(text) for text in CHANGES}, moments(0.25))


def numbers() -> str:
    """Of the bubbles on the right, from the middle outwards."""
    rows = ["pattern,time s,middle mm,ring 1 mm,ring 2 mm,ring 3 mm"]
    for text, apart in (*WORDS.values(), *((text, 0.25) for text in CHANGES)):
        for time, heights in zip(moments(apart), bs.patterns.parse(text).heights(LAYOUT, moments(apart)), strict=True):
            rows.append(f'"{text}",{time:g},' + ",".join(f"{heights[bubble]:.2f}" for bubble in (0, 1, 7, 19)))
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    pictures = {Path(f"docs/pictures/pattern_{name}.png"): one_word(*word) for name, word in WORDS.items()}
    generated.main({NUMBERS: numbers}, pictures | {Path("docs/pictures/pattern_changes.png"): changes})
