"""A flame graph of a profile: functions as bars over those that they call, as wide as what they take."""

from collections import defaultdict
from collections.abc import Iterable, Mapping

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bubbleskin.plot.membrane import COLOURS, STYLE

_WIDTH, _BAR = 10.0, 0.24  # inches
_LABELLED = 0.02  # of the width: less has no room for a name
_CHARACTER = 0.0058  # of the width
_PALE = 0.45

Stack = tuple[str, ...]


def plot_flames(profiles: Iterable[tuple[str, Mapping[Stack, float]]]) -> Figure:
    """A flame graph for each (title, µs by stack): the outermost function at the bottom, ours by room, the rest grey."""
    drawn = list(profiles)
    depths = [max(map(len, stacks)) for _, stacks in drawn]
    with rc_context(STYLE):
        figure = Figure(figsize=(_WIDTH, sum(_BAR * depth + 0.7 for depth in depths)), layout="constrained")
        axes = figure.subplots(len(drawn), 1, squeeze=False, height_ratios=depths)[:, 0]
        rooms: dict[str, str] = {}
        for one, (title, stacks) in zip(axes, drawn, strict=True):
            _draw(one, stacks, rooms)
            one.set_title(title, loc="left")
            one.set_xlabel("µs of a tick, mean")
            one.set_yticks([])
            one.grid(False)
            one.spines[["left", "right", "top"]].set_visible(False)
        return figure


def _draw(axes: Axes, stacks: Mapping[Stack, float], rooms: dict[str, str]) -> None:
    total = sum(stacks.values())
    axes.set_xlim(0, total)
    _bars(axes, stacks, 0.0, 0, total, rooms)


def _bars(
    axes: Axes, stacks: Mapping[Stack, float], left: float, depth: int, total: float, rooms: dict[str, str]
) -> None:
    below: dict[str, dict[Stack, float]] = defaultdict(lambda: defaultdict(float))
    for stack, spent in stacks.items():
        if stack:
            below[stack[0]][stack[1:]] += spent
    for name, rest in sorted(below.items(), key=lambda one: -sum(one[1].values())):
        width = sum(rest.values())
        room, _, function = name.partition(": ")
        colour = rooms.setdefault(room.split("/")[0], COLOURS[len(rooms) % len(COLOURS)]) if function else "#aaaaaa"
        axes.barh(depth, width, 0.94, left, align="edge", color=colour, alpha=_PALE, edgecolor="white", linewidth=0.5)
        if width > _LABELLED * total:
            room_for = int(width / total / _CHARACTER)
            label = (function or name)[:room_for]
            axes.text(left + 0.003 * total, depth + 0.45, label, fontsize=6.5, va="center", clip_on=True)
        _bars(axes, rest, left, depth + 1, total, rooms)
        left += width
