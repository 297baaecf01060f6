"""Pictures of the array: its shape seen from above and from the side, and heights over time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from bubbleskin.demo import Show
from bubbleskin.layout import Layout
from bubbleskin.plot.membrane import COLOURS, STYLE
from bubbleskin.plot.save import save

_HEIGHTS = "viridis"
_ASKED = "#D55E00"


def draw_shows(path: str | Path, layout: Layout, shows: Sequence[Show], limits_mm: tuple[float, float]) -> Path:
    """One picture of several shows, a row each: the array from above, from the side, and height over time.

    The last shape of each show is the one that is drawn, true where the board is simulated. `limits_mm`: heights
    of the colour scale. Returns the file's path.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(11, 3.1 * len(shows)), layout="constrained")
        axes = figure.subplots(len(shows), 3, squeeze=False, width_ratios=(1, 1.15, 1.3))
        colours = ScalarMappable(Normalize(*limits_mm), _HEIGHTS)
        for row, show in zip(axes, shows, strict=True):
            _above(row[0], layout, show, colours)
            _side(row[1], layout, show, colours, limits_mm[1])
            _over_time(row[2], layout, show)
            row[0].set_title(show.title, loc="left", fontweight="bold")
        label = f"{_kind(shows[0]) if shows else ''} height (mm)".strip()
        figure.colorbar(colours, ax=axes[:, 0], label=label, location="left", shrink=0.8)
        save(figure, path)
    return Path(path)


def _kind(show: Show) -> str:
    return "true" if show.true else "told"


def _above(axes: Axes, layout: Layout, show: Show, colours: ScalarMappable) -> None:
    """Circles of the bubbles' size with number and height in them."""
    for bubble, (x, y) in enumerate(layout.positions_mm):
        height = show.height_mm[-1, bubble]
        red, green, blue, _ = colours.to_rgba(height)
        axes.add_patch(Circle((x, y), min(height, layout.pitch_mm) / 2, color=(red, green, blue)))
        dark = 0.3 * red + 0.6 * green + 0.1 * blue < 0.5
        text = f"{bubble}\n{height:.2f}"
        axes.text(x, y, text, ha="center", va="center", color="white" if dark else "black", fontsize=7)
    reach = np.abs(layout.positions_mm).max() + 0.75 * layout.pitch_mm
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    axes.grid(False)


def _side(axes: Axes, layout: Layout, show: Show, colours: ScalarMappable, top: float) -> None:
    """The bubbles as spheres, seen along y; a line where each was asked to end."""
    state = show.states[-1]
    for bubble in np.argsort(-layout.positions_mm[:, 1]):
        x = layout.positions_mm[bubble, 0]
        height, radius = show.height_mm[-1, bubble], state.alone_mm[bubble] / 2  # a lifted one hangs above its base
        axes.add_patch(
            Circle((x, height - radius), radius, facecolor=colours.to_rgba(height), edgecolor="white", lw=1.2)
        )
    for bubble, x in enumerate(layout.positions_mm[:, 0]):
        axes.hlines(state.target_mm[bubble], x - 2, x + 2, color=_ASKED, lw=1.5, label="" if bubble else "asked")
    reach = np.abs(layout.positions_mm[:, 0]).max() + 0.75 * layout.pitch_mm
    axes.axhline(0, color="black", lw=1)
    axes.set(xlim=(-reach, reach), ylim=(0, 1.15 * top), aspect="equal", xlabel="x (mm)", ylabel="height (mm)")
    axes.grid(False)
    axes.legend(loc="upper right")


def _over_time(axes: Axes, layout: Layout, show: Show) -> None:
    """Height of every bubble against time, its target dashed in the same colour."""
    time = np.array([state.time for state in show.states]) - show.states[0].time
    targets = np.array([state.target_mm for state in show.states])
    many = len(layout) > len(COLOURS)
    lines = []
    for bubble in range(len(layout)):
        colour = f"C{bubble % 10}" if many else COLOURS[bubble]
        lines += axes.plot(time, show.height_mm[:, bubble], color=colour, label=f"{bubble}")
        axes.plot(time, targets[:, bubble], color=colour, lw=0.8, ls="--")
    lines.append(Line2D([], [], color="black", lw=0.8, ls="--", label="asked"))
    axes.set(xlabel="time (s)", ylabel=f"{_kind(show)} height (mm)", xlim=(0, time[-1]))
    axes.legend(handles=lines, title="bubble", ncols=2 if many else 1, loc="center left", bbox_to_anchor=(1, 0.5))
