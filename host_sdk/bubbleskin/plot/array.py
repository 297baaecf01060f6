"""Pictures of the array: its shape seen from above and from the side, and heights over time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from bubbleskin.demo import Show
from bubbleskin.layout import Layout
from bubbleskin.plot.save import save

_COLOURS = "viridis"


def draw_shows(path: str | Path, layout: Layout, shows: Sequence[Show], limits_mm: tuple[float, float]) -> Path:
    """One picture of several shows, a row each: the array from above, from the side, and height over time.

    The last state of each show is the shape that is drawn. `limits_mm`: heights
    of the colour scale. Returns the file's path.
    """
    figure = Figure(figsize=(13, 3.6 * len(shows)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(shows), 3, squeeze=False, width_ratios=(1, 1.15, 1.3))
    colours = ScalarMappable(Normalize(*limits_mm), _COLOURS)
    for row, (title, states) in zip(axes, shows, strict=True):
        _above(row[0], layout, states[-1], colours)
        _side(row[1], layout, states[-1], colours, limits_mm[1])
        _over_time(row[2], layout, states)
        row[0].set_title(title, loc="left", fontweight="bold")
    figure.colorbar(colours, ax=axes[:, 0], label="height (mm)", location="left", shrink=0.8)
    save(figure, path, dpi=130)
    return Path(path)


def _above(axes, layout, state, colours):  # type: ignore[no-untyped-def]
    """Circles of the bubbles' size with asked and reached height in them."""
    for bubble, (x, y) in enumerate(layout.positions_mm):
        height = state.height_mm[bubble]
        red, green, blue, _ = colours.to_rgba(height)
        axes.add_patch(Circle((x, y), min(height, layout.pitch_mm) / 2, color=(red, green, blue)))
        dark = 0.3 * red + 0.6 * green + 0.1 * blue < 0.5
        axes.text(
            x, y, f"{bubble}\n{height:.2f}", ha="center", va="center", color="white" if dark else "black", fontsize=8
        )
    reach = np.abs(layout.positions_mm).max() + 0.75 * layout.pitch_mm
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x (mm)", ylabel="y (mm)")


def _side(axes, layout, state, colours, top):  # type: ignore[no-untyped-def]
    """The bubbles as spheres, seen along y; a line where each was asked to end."""
    for bubble in np.argsort(-layout.positions_mm[:, 1]):
        x = layout.positions_mm[bubble, 0]
        height, radius = state.height_mm[bubble], state.alone_mm[bubble] / 2  # a lifted one hangs above its base
        axes.add_patch(
            Circle((x, height - radius), radius, facecolor=colours.to_rgba(height), edgecolor="white", lw=1.2)
        )
    for bubble, x in enumerate(layout.positions_mm[:, 0]):
        axes.hlines(
            state.target_mm[bubble], x - 2, x + 2, color="tab:red", lw=1.5, label="asked" if bubble == 0 else None
        )
    reach = np.abs(layout.positions_mm[:, 0]).max() + 0.75 * layout.pitch_mm
    axes.axhline(0, color="black", lw=1)
    axes.set(xlim=(-reach, reach), ylim=(0, 1.15 * top), aspect="equal", xlabel="x (mm)", ylabel="height (mm)")
    axes.legend(loc="upper right", frameon=False, fontsize=8)


def _over_time(axes, layout, states):  # type: ignore[no-untyped-def]
    """Height of every bubble against time, its target dashed in the same colour."""
    time = np.array([state.time for state in states]) - states[0].time
    heights = np.array([state.height_mm for state in states])
    targets = np.array([state.target_mm for state in states])
    for bubble in range(len(layout)):
        (line,) = axes.plot(time, heights[:, bubble], lw=1.5, label=f"{bubble}")
        axes.plot(time, targets[:, bubble], color=line.get_color(), lw=0.8, ls="--")
    axes.set(xlabel="time (s)", ylabel="height (mm)", xlim=(0, time[-1]))
    axes.grid(alpha=0.3)
    axes.legend(
        title="bubble",
        frameon=False,
        fontsize=8,
        ncols=2 if len(layout) > 9 else 1,
        loc="center left",
        bbox_to_anchor=(1, 0.5),
    )
