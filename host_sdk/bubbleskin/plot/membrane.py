"""Pictures of the membrane: curves with their branches, fits with their bands, tables with their error.

Every function returns a matplotlib ``Figure`` that belongs to nobody; ``figure.savefig(path)`` writes it.
Pressure lies across and height up, as in the paper's Fig. 4 and 6.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane.balloon import YeohBalloon
from bubbleskin.membrane.data import Measurements
from bubbleskin.membrane.fit import HEIGHT_SD, PRESSURE_SD, YeohFit, fit_yeoh
from bubbleskin.membrane.sheet import SheetFit, fit_sheet
from bubbleskin.membrane.synthetic import simulate_sheet
from bubbleskin.membrane.table import HEIGHT_TOLERANCE, PRESSURE_TOLERANCE, Table
from bubbleskin.plot.save import save as save

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195")
MARKERS = "osD^vP*"
STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.5,
    "errorbar.capsize": 1.5,
    "figure.dpi": 120,
    "savefig.dpi": 200,
    "svg.hashsalt": "bubbleskin",
}
WIDTH, HEIGHT = 4.6, 3.6  # inches


def plot_curve(balloons: Mapping[str, YeohBalloon], *, up_to_mm: float = 14.0) -> Figure:
    """Height against pressure for each named balloon: stable solid, unstable dashed, jumps as arrows.

    A balloon that snaps through also gets its Maxwell pressure, a thin dash-dotted line.
    """
    with rc_context(STYLE):
        figure, axes = _figure()
        for k, (name, balloon) in enumerate(balloons.items()):
            draw_curve(axes, balloon, up_to_mm=up_to_mm, colour=COLOURS[k % len(COLOURS)], label=name)
        snaps = any(balloon.limit_points() for balloon in balloons.values())
        named, _ = axes.get_legend_handles_labels()
        axes.legend(handles=[*named, *(_meanings() if snaps else [])], loc="upper left", handlelength=2.4)
        return figure


def plot_fit(fit: YeohFit | SheetFit, measurements: Measurements, *, title: str = "") -> Figure:
    """Measurements with error bars over the fitted curves and their 95 % confidence bands.

    Repeats of one setting are drawn as their mean with their standard deviation, single points with the
    noise that the fit found; outliers are crosses. A whole sheet has a colour per bubble and no bands.
    """
    with rc_context(STYLE):
        figure, axes = _figure()
        top = float(measurements.height.max()) * 1e3 + 0.5
        if isinstance(fit, YeohFit):
            draw_band(axes, fit, top)
            draw_curve(axes, fit.balloon, up_to_mm=top, colour=COLOURS[0], label="model, fitted")
            _draw_points(axes, fit, measurements, colour="#222222", marker="o", label="measured")
            _draw_plateau(axes, fit, measurements)
        else:
            for k, (number, one) in enumerate(fit.items()):
                colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
                draw_curve(axes, one.balloon, up_to_mm=top, colour=colour, thin=True)
                _draw_points(axes, one, measurements.of(number), colour=colour, marker=marker, label=f"bubble {number}")
        axes.set_title(title or measurements.source, loc="left")
        axes.legend(loc="upper left", handlelength=1.6)
        return figure


def plot_table(table: Table) -> Figure:
    """The knots on the curve, and below the error of every µm as a share of its tolerance.

    The tolerance is the looser of 2 Pa and 5 µm. Raises ``InvalidInput`` for a table without its balloon.
    """
    if table.balloon is None:
        raise InvalidInput("this table came without its balloon, so there is no curve to draw it on.")
    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 1.25 * HEIGHT), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2, 1]})
        h = np.arange(int(table.height_um[0]) + 1, int(table.height_um[-1]) + 1)
        stretch = table.balloon.stretch_at_height(np.maximum(h * 1e-6, table.balloon.rest_height))
        P = table.balloon.pressure(stretch)
        dP = 1e-6 / table.balloon.compliance(stretch)  # Pa/µm
        above.plot(h / 1e3, P / 1e3, color=COLOURS[0], label="model")
        above.plot(
            table.height_um / 1e3, table.pressure_pa / 1e3, ".", color=COLOURS[1], ms=5,
            label=f"{len(table)} knots",
        )  # fmt: skip
        above.set_ylabel("gauge pressure (kPa)")
        above.legend(loc="lower right")
        tolerance = np.maximum(PRESSURE_TOLERANCE, HEIGHT_TOLERANCE * np.abs(dP))
        share = (table.pressure_at(h) - P) / tolerance
        low, high = _envelope(share, 20)
        below.fill_between(h[10::20] / 1e3, low, high, color=COLOURS[1], lw=0, alpha=0.8)
        for edge in (-1, 1):
            below.axhline(edge, color="#555555", lw=0.9, ls=(0, (4, 3)))
        below.set_ylim(-1.25, 1.25)
        below.set_ylabel("error / tolerance")
        below.set_xlabel("height (mm)")
        error = table.max_error()
        above.set_title(
            f"every height within {error.pressure_pa:.1f} Pa or {error.height_um:.1f} µm\n"
            "(tolerance: the looser of 2 Pa and 5 µm)",
            loc="left",
        )
        return figure


def figure_4(*, seed: int = 4) -> tuple[Figure, Measurements]:
    """The paper's Fig. 4, one bubble measured in triplicate with the fitted model, from a simulation."""
    measurements, _ = simulate_sheet(1, spread=0.0, heights_mm=np.linspace(5.25, 12.6, 15), seed=seed)
    fit = fit_yeoh(measurements.height, measurements.pressure, step=measurements.step)
    title = "Height of one bubble, in triplicate (simulated measurements)"
    return plot_fit(fit, measurements, title=title), measurements


def figure_6(*, seed: int = 6) -> tuple[Figure, Measurements]:
    """The paper's Fig. 6, bubbles of one sheet that differ, each with its own fit, from a simulation."""
    measurements, _ = simulate_sheet(7, spread=0.1, pressures_kpa=np.arange(8.0, 30.1, 1.0), seed=seed)
    fit = fit_sheet(measurements.bubble, measurements.height, measurements.pressure)
    title = "Seven bubbles of one sheet (simulated measurements)"
    return plot_fit(fit, measurements, title=title), measurements


def draw_curve(
    axes: Axes, balloon: YeohBalloon, *, up_to_mm: float, colour: str, label: str = "", thin: bool = False
) -> None:
    """Draw one balloon's branches, and its jumps unless ``thin``, into ``axes``."""
    limits = balloon.limit_points()
    top = float(balloon.stretch_at_height(max(up_to_mm * 1e-3, balloon.rest_height)))
    ends = [1.0, *(point.stretch for point in limits if point.stretch < top), top]
    for k, (low, high) in enumerate(pairwise(ends)):
        # Denser towards the ends: the curve is steep at rest and flat at a limit point.
        x = low + (high - low) * (1 - np.cos(np.linspace(0, np.pi, 120))) / 2
        axes.plot(
            balloon.pressure(x) / 1e3,
            balloon.height(x) * 1e3,
            color=colour,
            ls="-" if k % 2 == 0 else (0, (3, 2)),
            lw=1.0 if thin else 1.6,
            label=label if k == 0 else None,
        )
    if thin:
        return
    for jump in (balloon.inflation_jump(), balloon.deflation_jump()):
        if jump is None or max(jump.from_stretch, jump.to_stretch) > top:
            continue
        p = jump.pressure / 1e3
        start, end = (balloon.height(x) * 1e3 for x in (jump.from_stretch, jump.to_stretch))
        axes.annotate(
            "", (p, end), (p, start),
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1, "ls": ":", "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        axes.plot([p], [start], "o", ms=4, mfc="white", mec=colour, mew=1.2)
    maxwell = balloon.maxwell_pressure()
    if maxwell is not None:
        small, *_, large = balloon.heights(maxwell) * 1e3
        axes.plot([maxwell / 1e3] * 2, [small, large], color=colour, lw=0.7, ls="-.")


def _figure() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
    axes = figure.subplots()
    axes.set_xlabel("gauge pressure (kPa)")
    axes.set_ylabel("height (mm)")
    return figure, axes


def _meanings() -> list[Line2D]:
    grey = "#555555"
    return [
        Line2D([], [], color=grey, ls="-", label="stable"),
        Line2D([], [], color=grey, ls=(0, (3, 2)), label="unstable"),
        Line2D([], [], color=grey, ls=":", marker="o", mfc="white", ms=4, lw=1, label="limit point, jump"),
        Line2D([], [], color=grey, ls="-.", lw=0.7, label="Maxwell pressure"),
    ]


def _draw_plateau(axes: Axes, fit: YeohFit, measurements: Measurements) -> None:
    """A closer look at the flattest part, where a little pressure is much height."""
    h = np.linspace(1.25, 2.0, 200) * fit.balloon.rest_height
    flat = h[np.argmax(np.abs(fit.balloon.compliance(fit.balloon.stretch_at_height(h))))]
    low, high = np.array([0.85, 1.2]) * flat
    if not np.any((low < measurements.height) & (measurements.height < high)):
        return
    inset = axes.inset_axes((0.12, 0.29, 0.42, 0.4))
    draw_band(inset, fit, high * 1e3)
    draw_curve(inset, fit.balloon, up_to_mm=high * 1e3, colour=COLOURS[0])
    _draw_points(inset, fit, measurements, colour="#222222", marker="o", label="")
    ends = fit.balloon.pressure_at_height(np.linspace(low, high, 50)) / 1e3
    inset.set_xlim(ends.min() - 0.3, ends.max() + 0.3)
    inset.set_ylim(low * 1e3, high * 1e3)
    inset.tick_params(labelsize=7, length=2)
    for spine in inset.spines.values():
        spine.set(visible=True, color="#888888")
    axes.indicate_inset_zoom(inset, edgecolor="#888888")


def draw_band(axes: Axes, fit: YeohFit, top_mm: float) -> None:
    """The 95 % confidence band of a fit, up to a height."""
    h = np.linspace(fit.balloon.rest_height, top_mm * 1e-3, 240)
    low, high = fit.pressure_band(h)
    axes.fill_betweenx(h * 1e3, low / 1e3, high / 1e3, color=COLOURS[0], alpha=0.2, lw=0, label="95 % confidence")


def _draw_points(axes: Axes, fit: YeohFit, measurements: Measurements, *, colour: str, marker: str, label: str) -> None:
    good = ~fit.outliers
    out = measurements
    axes.plot(out.pressure[~good] / 1e3, out.height[~good] * 1e3, "x", color=colour, ms=5, mew=1.2)
    p, h, p_sd, h_sd = _settings(measurements, good, fit)
    axes.errorbar(
        p / 1e3, h * 1e3, xerr=p_sd / 1e3, yerr=h_sd * 1e3, fmt=marker, ms=3.2, color=colour, elinewidth=0.8,
        label=label,
    )  # fmt: skip


def _settings(measurements: Measurements, good: np.ndarray, fit: YeohFit) -> tuple[np.ndarray, ...]:
    """Pressure and height of what is to be drawn, and the bar of each: means of repeats, or points."""
    p, h = measurements.pressure[good], measurements.height[good]
    if measurements.step is None:
        # The noise of a point: stated, times what the fit found.
        p_sd = PRESSURE_SD if measurements.pressure_sd is None else measurements.pressure_sd[good]
        h_sd = HEIGHT_SD if measurements.height_sd is None else measurements.height_sd[good]
        ones = np.ones(p.size) * fit.scale
        return p, h, p_sd * ones, h_sd * ones
    _, group, count = np.unique(measurements.step[good], return_inverse=True, return_counts=True)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(group, values) / count

    def deviation(values: np.ndarray) -> np.ndarray:
        return np.sqrt(np.bincount(group, (values - mean(values)[group]) ** 2) / np.maximum(count - 1, 1))

    return mean(p), mean(h), deviation(p), deviation(h)


def _envelope(values: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest of every ``width`` neighbours: what a printer could resolve of 9000 values."""
    cut = values[: values.size // width * width].reshape(-1, width)
    return cut.min(axis=1), cut.max(axis=1)
