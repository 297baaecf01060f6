"""Pictures of bubbles that touch: an array from above and from the side, a plan step by step, height against order."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Protocol

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from bubbleskin.contact.model import CompliantContact
from bubbleskin.contact.shape import Contact, Shape
from bubbleskin.layout import Layout
from bubbleskin.plot.membrane import COLOURS, STYLE

if TYPE_CHECKING:
    from bubbleskin.planner.plan import Plan


class Bubbles(Protocol):
    """What is drawn: a settled `Shape`, or bubbles in motion."""

    @property
    def height_mm(self) -> NDArray[np.float64]:
        """Tops, (n,)."""

    @property
    def position(self) -> NDArray[np.float64]:
        """Centres in m, (n, 3)."""

    @property
    def radius(self) -> NDArray[np.float64]:
        """m, (n,)."""

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Who touches whom, where that is known."""


LOW_MM, HIGH_MM = 5.0, 16.0
"""Ends of the colour scale: a bubble at rest, and one that its neighbours have lifted as far as they can."""
TALL_KPA = 26.69
"""What makes the paper's bubble 12 mm high."""

_ORDERS: dict[str, tuple[tuple[str, ...], str]] = {
    "alone": (("centre",), "12"),
    "ring first": (("ring", "all"), "12"),
    "together": (("all",), ""),
    "centre first": (("centre", "all"), "14"),
}
"""Who has pressure after each step; and what the paper measured, mm."""


def colours() -> ScalarMappable:
    """The colours of heights, the same in all pictures of contact."""
    return ScalarMappable(Normalize(LOW_MM, HIGH_MM), "viridis")


_BETWEEN = (0.34, 0.66)
"""Of the way from one centre to the other: there a line crosses no number."""


class Above:
    """The array from above: spheres at their places, lower ones beneath; contact as lines between them, as wide as it is strong.

    Everything that moves is drawn by `update`, which may be called again and again: `artists` are those things.
    """

    def __init__(self, axes: Axes, layout: Layout, *, numbers: bool = True) -> None:
        self._axes = axes
        self._circles = [axes.add_patch(Circle((0, 0))) for _ in range(len(layout))]
        self._numbers = [axes.text(0, 0, "", ha="center", va="center", fontsize=7, zorder=5) for _ in self._circles]
        self._numbered = numbers
        self._forces: list[Line2D] = []
        reach = np.abs(layout.positions_mm).max() + layout.pitch_mm
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=[], yticks=[])
        axes.grid(False)

    def update(self, shape: Bubbles) -> None:
        """Put everything where it is in `shape`."""
        centre, radius = 1e3 * shape.position, 1e3 * shape.radius
        paint = colours().to_rgba(shape.height_mm, alpha=0.9)
        for place, bubble in enumerate(np.argsort(centre[:, 2])):
            circle, number = self._circles[bubble], self._numbers[bubble]
            circle.set(center=centre[bubble, :2], radius=radius[bubble], color=paint[bubble], zorder=_order(place))
            red, green, blue, _ = paint[bubble]
            dark = 0.3 * red + 0.6 * green + 0.1 * blue < 0.5
            shown = self._numbered and radius[bubble] > 3
            text = f"{bubble}\n{shape.height_mm[bubble]:.1f}" if shown else ""
            number.set(position=centre[bubble, :2], text=text, color="white" if dark else "black")
        for line in self._forces:
            line.remove()
        self._forces = []
        for contact in shape.contacts:
            first, second = centre[[contact.first, contact.second]]
            ends = np.array([first + share * (second - first) for share in _BETWEEN])
            width = 0.6 + 8 * contact.force
            self._forces += self._axes.plot(ends[:, 0], ends[:, 1], color="#D55E00", lw=width, alpha=0.8, zorder=4)

    @property
    def artists(self) -> list[Artist]:
        """What `update` moves, as of the last."""
        return [*self._circles, *self._forces, *self._numbers]


class Side:
    """The array from the side, along y: spheres on their base or lifted off it; a line where each was asked to end.

    `update` and `artists` are as those of `Above`; the base plane is one of these, because it is drawn over the spheres.
    """

    def __init__(self, axes: Axes, layout: Layout, asked_mm: NDArray[np.float64] | None = None) -> None:
        self._circles = [axes.add_patch(Circle((0, 0), edgecolor="white")) for _ in range(len(layout))]
        if asked_mm is not None:
            x = layout.positions_mm[:, 0]
            axes.hlines(asked_mm, x - 2, x + 2, color="#D55E00", lw=1.5, label="asked", zorder=4)
            axes.legend(loc="upper right")
        self._base = axes.axhline(0, color="black", lw=1)
        reach = np.abs(layout.positions_mm[:, 0]).max() + layout.pitch_mm
        axes.set(xlim=(-reach, reach), ylim=(0, HIGH_MM + 2), aspect="equal", xticks=[], ylabel="mm")
        axes.grid(False)

    def update(self, shape: Bubbles) -> None:
        """Put everything where it is in `shape`."""
        centre, radius = 1e3 * shape.position, 1e3 * shape.radius
        paint = colours().to_rgba(shape.height_mm, alpha=0.9)
        for place, bubble in enumerate(np.argsort(-centre[:, 1])):
            circle, where = self._circles[bubble], centre[bubble, [0, 2]]
            circle.set(center=where, radius=radius[bubble], facecolor=paint[bubble], zorder=_order(place))

    @property
    def artists(self) -> list[Artist]:
        """What `update` moves, and the base plane."""
        return [*self._circles, self._base]


def _order(place: int) -> float:
    """Height of the `place`-th sphere in the picture: above those before it, below lines, which are at 2."""
    return 1 + place / (place + 1)


def draw_above(axes: Axes, layout: Layout, shape: Bubbles, *, numbers: bool = True) -> None:
    """One picture of `Above`."""
    Above(axes, layout, numbers=numbers).update(shape)


def draw_side(axes: Axes, layout: Layout, shape: Bubbles, asked_mm: NDArray[np.float64] | None = None) -> None:
    """One picture of `Side`."""
    Side(axes, layout, asked_mm).update(shape)


def plot_plan(plan: Plan, contact: CompliantContact, start: Shape | None = None) -> Figure:
    """A plan: the array after every step, from above and from the side; the last with what was asked."""
    shapes: list[Shape] = []
    now = start
    for step in plan.steps[:-1]:
        now = contact.settle_sizes(step.target_mm, now)
        shapes.append(now)
    shapes.append(plan.shape)
    titles = [f"step {k + 1}: {plan.layout.names(step.bubbles)}" for k, step in enumerate(plan.steps)] or ["no step"]
    with rc_context(STYLE):
        n = len(shapes)
        figure = Figure(figsize=(max(3.2 * n, 4.0), 5.2), layout="constrained")
        axes = figure.subplots(2, n, squeeze=False, height_ratios=(1.5, 1))
        for column, (shape, title) in enumerate(zip(shapes, titles, strict=True)):
            draw_above(axes[0, column], plan.layout, shape)
            draw_side(axes[1, column], plan.layout, shape, plan.asked_mm if column == n - 1 else None)
            axes[0, column].set_title(_folded(title), loc="left")
        figure.colorbar(colours(), ax=axes, label="height (mm)", shrink=0.6)
        worst = f"furthest from what was asked: {plan.error_mm:.2f} mm"
        figure.suptitle(worst, x=0.01, ha="left", fontsize=9)
        return figure


def orders(pressure_pa: float = TALL_KPA * 1e3) -> dict[str, Shape]:
    """The paper's experiment in the model: one hexagon at one pressure, inflated in different orders."""
    contact = CompliantContact(Layout.hexagon(rings=1))
    who = {"centre": np.arange(7) == 0, "ring": np.arange(7) > 0, "all": np.arange(7) >= 0}
    return {
        name: contact.settle([np.where(who[group], pressure_pa, 0.0) for group in groups])
        for name, (groups, _) in _ORDERS.items()
    }


def plot_order(shapes: dict[str, Shape] | None = None) -> Figure:
    """Like Fig. 5 of the paper: the height of the centre against the order of inflation, with the shapes beneath."""
    shapes = shapes or orders()
    layout = Layout.hexagon(rings=1)
    with rc_context(STYLE):
        figure = Figure(figsize=(7.4, 6.2), layout="constrained")
        grid = figure.add_gridspec(3, len(shapes), height_ratios=(1.7, 0.8, 1.4))
        bars = figure.add_subplot(grid[0, :])
        heights = [float(shape.height_mm[0]) for shape in shapes.values()]
        bars.bar(range(len(shapes)), heights, color=COLOURS[0], width=0.5, label="the model's centre")
        for k, height in enumerate(heights):
            bars.text(k, 0.5, f"{height:.2f}", ha="center", fontsize=10, color="white")
        measured = [(k, float(_ORDERS[name][1])) for k, name in enumerate(shapes) if _ORDERS[name][1]]
        bars.plot(*zip(*measured, strict=True), "D", color=COLOURS[1], ms=7, label="the paper's, about")
        bars.set(xticks=range(len(shapes)), ylim=(0, 17), ylabel="height of the centre (mm)")
        bars.set_xticklabels(list(shapes))
        bars.set_xlim(-0.5, len(shapes) - 0.5)
        bars.set_axisbelow(True)
        bars.grid(axis="x", visible=False)
        bars.legend(loc="upper left", ncols=2)
        bars.set_title(f"Seven bubbles at {TALL_KPA:g} kPa: order changes the shape", loc="left")
        for k, shape in enumerate(shapes.values()):
            draw_side(figure.add_subplot(grid[1, k]), layout, shape)
            draw_above(figure.add_subplot(grid[2, k]), layout, shape)
        return figure


def numbers(shapes: dict[str, Shape]) -> list[tuple[str, str, str]]:
    """What `plot_order` shows, as rows: order, which bubble, height in mm. The ring's are sorted: chance picks the highest."""
    rows = []
    for order, shape in shapes.items():
        rows.append((order, "centre", f"{shape.height_mm[0]:.2f}"))
        rows += [(order, "ring", f"{height:.2f}") for height in np.sort(shape.height_mm[1:])]
    return rows


def _folded(title: str) -> str:
    return "\n".join(textwrap.wrap(title, 28))
