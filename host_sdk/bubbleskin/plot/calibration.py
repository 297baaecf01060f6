"""Pictures of a calibration: for each bubble its curve, what was measured, and the band of what is uncertain; and the sheet."""

from collections.abc import Callable

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bubbleskin.calibrate.device import curve_sd
from bubbleskin.calibrate.result import BubbleCalibration, SelfCalibration
from bubbleskin.calibrate.verdict import leak_share
from bubbleskin.plot.membrane import COLOURS, STYLE
from bubbleskin.plot.save import save as save

_COLUMNS = 4
_PANEL = 2.7, 2.3  # inches
_TOP_MM = 14.0
_PULLED = "#222222"
_AMISS = "#D55E00"


def draw(calibration: SelfCalibration) -> Figure:
    """A panel for each bubble, pressure across and height up, and four of the whole sheet below."""
    bubbles = calibration.bubbles
    rows = -(-len(bubbles) // _COLUMNS)
    with rc_context(STYLE):
        figure = Figure(figsize=(_COLUMNS * _PANEL[0], (rows + 1) * _PANEL[1]), layout="constrained")
        grid = figure.add_gridspec(rows + 1, _COLUMNS)
        shared: Axes | None = None
        for k, each in enumerate(bubbles):
            axes = figure.add_subplot(grid[k // _COLUMNS, k % _COLUMNS], sharex=shared, sharey=shared)
            shared = shared or axes
            _draw_bubble(axes, each)
            axes.label_outer() if k < len(bubbles) - _COLUMNS else axes.set_xlabel("pressure (kPa)")
            if k % _COLUMNS == 0:
                axes.set_ylabel("height (mm)")
        if shared is not None and (names := shared.get_legend_handles_labels()[1]):
            shared.legend(loc="lower right", handlelength=1.4, title=None if names else "")
        fitted = [each for each in bubbles if each.estimate is not None]
        for column, (title, value) in enumerate(_OF_SHEET.items()):
            _draw_sheet(figure.add_subplot(grid[rows, column]), title, fitted, value)
        return figure


def draw_one(each: BubbleCalibration) -> Figure:
    """The panel of one bubble, larger."""
    with rc_context(STYLE):
        figure = Figure(figsize=(5.2, 3.6), layout="constrained")
        axes = figure.subplots()
        _draw_bubble(axes, each)
        axes.set(xlabel="pressure (kPa)", ylabel="height (mm)")
        if axes.get_legend_handles_labels()[1]:
            axes.legend(loc="lower right")
        return figure


def _draw_bubble(axes: Axes, each: BubbleCalibration) -> None:
    amiss = "" if each.verdict.accepted else f": {', '.join(each.verdict.reasons)}"
    axes.set_title(f"bubble {each.bubble}{amiss}", color=_AMISS if amiss else _PULLED)
    estimate = each.estimate
    if estimate is None:
        return
    heights = np.linspace(2.0 * estimate.wall.radius, _TOP_MM, 300)
    pressure = 1e-3 * estimate.curve(heights)
    band = curve_sd(estimate) * pressure
    axes.fill_betweenx(
        heights, pressure - band, pressure + band, color=COLOURS[0], alpha=0.18, lw=0, label="memory, 1 sd"
    )
    axes.plot(pressure, heights, color=COLOURS[0], label="relaxed, fitted")
    axes.plot(1e-3 * estimate.pressure_pa, estimate.height_mm, "o", ms=2.4, mew=0, color=_PULLED, label="measured")
    axes.plot(1e-3 * estimate.model_pa, estimate.height_mm, "+", ms=4, mew=0.7, color=COLOURS[1], label="model")


_Value = Callable[[BubbleCalibration], tuple[tuple[float, float], ...]]


def _flows(each: BubbleCalibration) -> tuple[tuple[float, float], ...]:
    return each.parameters["fill_flow"], each.parameters["vent_flow"]


def _stiffness(each: BubbleCalibration) -> tuple[tuple[float, float], ...]:
    return (each.parameters["mu_h0"],)


def _memory(each: BubbleCalibration) -> tuple[tuple[float, float], ...]:
    names = "quick", "slow", "softening"
    return tuple((100 * value, 100 * sd) for value, sd in (each.parameters[name] for name in names))


def _leak(each: BubbleCalibration) -> tuple[tuple[float, float], ...]:
    assert each.estimate is not None
    value, sd = each.parameters["leak"]
    share = 100 * leak_share(each.estimate)
    return ((share, abs(share * sd / value) if value else 0.0),)


_OF_SHEET: dict[str, _Value] = {
    "flows of fill, vent (nominal 1)": _flows,
    "μ h0 (Pa m)": _stiffness,
    "memory: quick, slow, softening (%)": _memory,
    "leak at 12 mm (% of air a second)": _leak,
}


def _draw_sheet(axes: Axes, title: str, bubbles: list[BubbleCalibration], value: _Value) -> None:
    """Values of all bubbles with their 95 % intervals, side by side where there are several of each."""
    axes.set_title(title)
    axes.set_xlabel("bubble")
    if not bubbles:
        return
    found: NDArray[np.float64] = np.array([value(each) for each in bubbles])
    numbers = np.array([each.bubble for each in bubbles])
    series = found.shape[1]
    for k in range(series):
        at = numbers + 0.22 * (k - 0.5 * (series - 1))
        axes.errorbar(at, found[:, k, 0], 1.96 * found[:, k, 1], fmt="o", ms=3, lw=1, color=COLOURS[k])
    axes.set_xticks(numbers[:: max(1, len(numbers) // 8)])
    axes.xaxis.grid(visible=False)
