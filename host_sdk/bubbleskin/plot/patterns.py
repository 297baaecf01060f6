"""Patterns from above, at several moments beside each other."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from bubbleskin.layout import Layout
from bubbleskin.patterns import Pattern
from bubbleskin.plot.contact import colours
from bubbleskin.plot.membrane import STYLE
from bubbleskin.plot.save import save
from bubbleskin.sequence.library import HIGH_MM, LOW_MM


def draw_patterns(path: str | Path, layout: Layout, patterns: Mapping[str, Pattern], moments: Sequence[float]) -> Path:
    """A row for each pattern under its name, a column for each of the `moments`, s; returns the file's path."""
    with rc_context(STYLE):
        figure = Figure(figsize=(1.35 * len(moments) + 1, 1.5 * len(patterns) + 0.25), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(len(patterns), len(moments), squeeze=False)
        scale = colours()
        scale.set_clim(LOW_MM, HIGH_MM)
        for place, moment in zip(axes[0], moments, strict=True):
            place.set_title(f"{moment:g} s", fontsize=9)
        for row, (name, pattern) in zip(axes, patterns.items(), strict=True):
            for place, heights in zip(row, pattern.heights(layout, moments), strict=True):
                _above(place, layout, heights, scale)
            if len(patterns) > 1:
                row[0].text(
                    -0.08, 0.5, name, transform=row[0].transAxes, rotation=90, ha="right", va="center", fontsize=9
                )
        figure.colorbar(scale, ax=axes, label="height (mm)", shrink=0.9 if len(patterns) == 1 else 0.4)
        save(figure, path, dpi=110)
    return Path(path)


def _above(axes: Axes, layout: Layout, heights: NDArray[np.float64], scale: ScalarMappable) -> None:
    for (x, y), height in zip(layout.positions_mm, heights, strict=True):
        axes.add_patch(Circle((x, y), 0.46 * layout.pitch_mm, color=scale.to_rgba(height)))
    reach = np.abs(layout.positions_mm).max() + 0.55 * layout.pitch_mm
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_axis_off()
