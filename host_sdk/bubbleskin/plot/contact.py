"""Pictures of bubbles that touch: a plan's shape from the side and from above."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from bubbleskin.shape.contact import Shape
from bubbleskin.shape.plan import Plan

_COLOURS = "viridis"


def draw_plan(plan: Plan, path: str | Path) -> Path:
    """Draw the shape that `plan` ends in, from the side and from above, with the explanation below. Returns the path."""
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    side, above = figure.subplots(1, 2)
    colours = ScalarMappable(Normalize(5, max(14.0, plan.predicted_mm.max())), _COLOURS)
    draw_side(side, plan.shape, colours)
    draw_above(above, plan.shape, colours)
    figure.colorbar(colours, ax=above, label="height (mm)", shrink=0.7)
    figure.supxlabel(plan.explain(), fontsize=8, ha="left", x=0.02, wrap=True)
    figure.savefig(path, dpi=120)
    return Path(path)


def draw_side(axes: Axes, shape: Shape, colours: ScalarMappable) -> None:
    """The bubbles seen along y, those behind first; each at its true place and size, its height above it."""
    order = np.argsort(-shape.position[:, 1], kind="stable")
    for i in order:
        x, _, z = 1e3 * shape.position[i]
        axes.add_patch(
            Circle((x, z), 1e3 * shape.radius[i], fc=colours.to_rgba(shape.height_mm[i]), ec="k", alpha=0.75)
        )
        axes.text(x, z, str(i), ha="center", va="center", fontsize=8)
    axes.axhline(0, color="0.3", lw=2)
    axes.set(xlabel="x (mm)", ylabel="z (mm)", title="from the side", aspect="equal")
    _frame(axes, 1e3 * shape.position[:, 0], 1e3 * shape.radius)
    axes.set_ylim(-1, shape.height_mm.max() + 1.5)


def draw_above(axes: Axes, shape: Shape, colours: ScalarMappable) -> None:
    """The bubbles seen from above, the highest last, with a red line for each contact."""
    for i in np.argsort(shape.height_mm, kind="stable"):
        x, y, _ = 1e3 * shape.position[i]
        axes.add_patch(
            Circle((x, y), 1e3 * shape.radius[i], fc=colours.to_rgba(shape.height_mm[i]), ec="k", alpha=0.75)
        )
        axes.text(x, y, f"{i}\n{shape.height_mm[i]:.1f}", ha="center", va="center", fontsize=7)
    for contact in shape.contacts:
        ends = 1e3 * shape.position[[contact.first, contact.second], :2]
        axes.plot(ends[:, 0], ends[:, 1], color="tab:red", lw=0.5 + 20 * contact.force)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title="from above; red: contacts", aspect="equal")
    _frame(axes, 1e3 * shape.position[:, 0], 1e3 * shape.radius)
    y, r = 1e3 * shape.position[:, 1], 1e3 * shape.radius
    axes.set_ylim((y - r).min() - 1, (y + r).max() + 1)


def _frame(axes: Axes, x: np.ndarray, r: np.ndarray) -> None:
    axes.set_xlim((x - r).min() - 1, (x + r).max() + 1)
