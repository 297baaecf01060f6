"""A picture of control: what a bubble was asked, how high it truly stood, and how high it was told to stand."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bubbleskin.plot.membrane import COLOURS, STYLE

_WIDTH, _HEIGHT = 8.6, 2.6  # inches, of a row
_OFF_MM = 0.3  # to which errors are drawn


class Track(NamedTuple):
    """One bubble over time: s and mm, (k,) each."""

    time: NDArray[np.float64]
    asked: NDArray[np.float64]
    true: NDArray[np.float64]
    told: NDArray[np.float64]


def plot_tracks(plants: Mapping[str, Mapping[str, Track]]) -> Figure:
    """A row for each plant: heights of all contenders on the left; on the right how far off the first of them is."""
    with rc_context(STYLE):
        figure = Figure(figsize=(_WIDTH, _HEIGHT * len(plants)), layout="constrained")
        axes = figure.subplots(len(plants), 2, squeeze=False, sharex=True)
        for (name, tracks), (heights, errors) in zip(plants.items(), axes, strict=True):
            _draw_heights(heights, tracks)
            _draw_errors(errors, tracks)
            heights.set_title(name, loc="left")
            errors.set_title(f"{next(iter(tracks))}, less what was asked", loc="left")
        axes[0, 0].legend(loc="upper right", ncols=2)
        for one in axes[-1]:
            one.set_xlabel("time (s)")
        return figure


def _draw_heights(axes: Axes, tracks: Mapping[str, Track]) -> None:
    first = next(iter(tracks.values()))
    axes.plot(first.time, first.asked, color="#222222", linewidth=0.8, drawstyle="steps-post", label="asked")
    for colour, (name, track) in zip(COLOURS, tracks.items(), strict=False):
        axes.plot(track.time, track.true, color=colour, label=f"{name}: true")
        axes.plot(track.time, track.told, color=colour, linestyle=":", label=f"{name}: told")
    axes.set_ylabel("height (mm)")
    axes.set_ylim(4.8, 15.6)


def _draw_errors(axes: Axes, tracks: Mapping[str, Track]) -> None:
    track = next(iter(tracks.values()))
    axes.plot(track.time, track.true - track.asked, color=COLOURS[0])
    axes.plot(track.time, track.told - track.asked, color=COLOURS[0], linestyle=":")
    axes.set_ylabel("off (mm)")
    axes.set_ylim(-_OFF_MM, _OFF_MM)
