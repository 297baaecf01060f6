"""How fast films of sequences are drawn, beside what matplotlib takes for a picture of nothing."""

import tempfile
from collections.abc import Iterator
from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bubbleskin.bench.rows import REPEATS, Row, fastest, share_of
from bubbleskin.layout import Layout
from bubbleskin.plot.sequence import Frame, animate

_FRAMES = 60
"""Four seconds of the command's film."""


def rows(size: float = 1.0) -> Iterator[Row]:
    """A film of seven bubbles, encoding included."""
    repeats, count = share_of(REPEATS, size), max(2, share_of(_FRAMES, size))
    figure = Figure(figsize=(4.2, 6.0))
    figure.subplots(2, 1)
    figure.savefig(BytesIO(), dpi=80)  # Fonts are found once.
    empty, _ = fastest(partial(figure.savefig, BytesIO(), dpi=80), repeats)
    layout = Layout.hexagon(rings=1)
    frames = [_frame(layout, k / 15, 9 + 4 * np.sin(k / 10 + np.arange(7))) for k in range(count)]
    with tempfile.TemporaryDirectory() as folder:
        seconds, _ = fastest(partial(animate, layout, frames, Path(folder) / "film.gif"), repeats)
    yield Row(f"a film of {count} frames", seconds, "s", "< 5")
    yield Row("one frame, by an empty figure with two axes, saved", seconds / count / empty, "×", "< 1")


def _frame(layout: Layout, time: float, height_mm: np.ndarray) -> Frame:
    radius = height_mm / 2e3
    return Frame(time, height_mm, np.column_stack([layout.positions_mm / 1e3, radius]), radius)
