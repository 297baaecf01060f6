"""The pictures in which skins, states, plans, sequences, fits and calibrations show themselves in notebooks."""

import io
from functools import singledispatch
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bubbleskin.calibrate.result import SelfCalibration
from bubbleskin.device.state import State
from bubbleskin.errors import BubbleskinError
from bubbleskin.layout import Layout
from bubbleskin.membrane import Calibration, YeohFit
from bubbleskin.planner.plan import Plan
from bubbleskin.plot import calibration as self_calibration
from bubbleskin.plot.contact import Bubbles, colours, draw_above, draw_side
from bubbleskin.plot.membrane import COLOURS, STYLE, draw_band, draw_curve
from bubbleskin.plot.sequence import spheres
from bubbleskin.sequence.model import Sequence
from bubbleskin.skin import Skin

_DPI = 100
_SECONDS = 30.0
"""Of a sequence, at most."""
_MOMENTS = 600
_LEGEND_MAX = 7
_FIT_TOP_MM = 14.0


def draw(shown: object) -> bytes | None:
    """The picture of `shown` as PNG; None where it has none, such as a skin whose wristband has gone."""
    try:
        with rc_context(STYLE):
            drawn = io.BytesIO()
            figure_of(shown).savefig(drawn, format="png", dpi=_DPI)
        return drawn.getvalue()
    except BubbleskinError:
        return None


@singledispatch
def figure_of(shown: object) -> Figure:
    """The picture of one thing. Raises `BubbleskinError` where there is nothing to draw."""
    raise BubbleskinError(f"A {type(shown).__name__} has no picture.")


class _Spheres(NamedTuple):
    """Bubbles as spheres that nobody pushes aside: who pushes whom is not told."""

    height_mm: NDArray[np.float64]
    position: NDArray[np.float64]
    radius: NDArray[np.float64]
    contacts: tuple[()] = ()


@figure_of.register
def _(skin: Skin) -> Figure:
    """The array at this moment: true heights of a simulated wristband, estimated ones of a real one."""
    state = skin.state()
    if skin.simulated:
        plant = skin.simulated.plant
        bubbles = _Spheres(skin.simulated.height_mm, plant.position_m, plant.parameters.radius * plant.stretch)
        what = "true heights"
    else:
        bubbles = _Spheres(state.height_mm, *spheres(skin.layout, state))
        what = "heights as the wristband knows them"
    return _array(skin.layout, bubbles, state.target_mm, f"{skin.info.board}, {state.mode}, {state.time:.2f} s: {what}")


@figure_of.register
def _(plan: Plan) -> Figure:
    """How it ends, and what was asked."""
    steps = f"{len(plan.steps)} step{'' if len(plan.steps) == 1 else 's'}"
    return _array(
        plan.layout, plan.shape, plan.asked_mm, f"{steps}; furthest from what was asked: {plan.error_mm:.2f} mm"
    )


def _array(layout: Layout, bubbles: Bubbles, asked_mm: NDArray[np.float64], title: str) -> Figure:
    """From above and from the side, beside each other."""
    figure = Figure(figsize=(7.6, 3.2), layout="constrained")
    above, side = figure.subplots(1, 2)
    draw_above(above, layout, bubbles)
    draw_side(side, layout, bubbles, asked_mm)
    figure.colorbar(colours(), ax=[above, side], label="height (mm)", shrink=0.8)
    figure.suptitle(title, x=0.01, ha="left", fontsize=9)
    return figure


@figure_of.register
def _(state: State) -> Figure:
    """Height and target of each bubble, with two standard deviations."""
    figure, axes = _axes("bubble", "height (mm)")
    bubbles = np.arange(len(state.height_mm))
    ill = np.array([bool(faults) for faults in state.faults], dtype=bool)
    axes.bar(bubbles, state.height_mm, width=0.6, color=np.where(ill, COLOURS[1], COLOURS[0]).tolist())
    if state.sd_mm is not None:
        axes.errorbar(bubbles, state.height_mm, 2 * state.sd_mm, fmt="none", ecolor="#222222", label="± 2 sd")
    axes.hlines(state.target_mm, bubbles - 0.42, bubbles + 0.42, color=COLOURS[4], lw=2, label="target")
    axes.set_xticks(bubbles)
    axes.grid(axis="x", visible=False)
    axes.set_axisbelow(True)
    axes.set_ylim(0, 1.25 * max(np.max(state.height_mm), np.max(state.target_mm)))
    axes.legend(loc="upper right", ncols=2)
    faults = f", with faults: {', '.join(bubbles[ill].astype(str))}" if ill.any() else ""
    axes.set_title(f"{state.mode} at {state.time:.3f} s{faults}", loc="left")
    return figure


@figure_of.register
def _(sequence: Sequence) -> Figure:
    """What is asked of each bubble over time."""
    figure, axes = _axes("time (s)", "target (mm)")
    shown = min(sequence.duration, _SECONDS)
    times = np.linspace(0, shown, _MOMENTS)
    heights = sequence.targets_at(times)
    for bubble, height in enumerate(heights.T):
        axes.plot(times, height, lw=1.2, color=COLOURS[bubble % len(COLOURS)], label=f"{bubble}")
    if sequence.bubbles <= _LEGEND_MAX:
        axes.legend(title="bubble", loc="center left", bbox_to_anchor=(1, 0.5))
    axes.set_xlim(0, shown)
    length = f"the first {shown:g} s of it" if sequence.duration > shown else f"{shown:g} s"
    axes.set_title(f"{sequence.name or 'sequence'}: {len(sequence.each)} steps, {length}", loc="left")
    return figure


@figure_of.register
def _(fit: YeohFit) -> Figure:
    """The fitted curve and its band."""
    figure, axes = _axes("gauge pressure (kPa)", "height (mm)")
    draw_band(axes, fit, _FIT_TOP_MM)
    draw_curve(axes, fit.balloon, up_to_mm=_FIT_TOP_MM, colour=COLOURS[0], label="model, fitted")
    mu, c2, c3 = fit.parameters
    axes.set_title(f"μ = {mu / 1e3:.4g} kPa, C2 = {c2:.4g} Pa, C3 = {c3:.4g} Pa", loc="left")
    axes.legend(loc="upper left")
    return figure


@figure_of.register
def _(calibration: Calibration) -> Figure:
    """The tables of all bubbles."""
    figure, axes = _axes("gauge pressure (kPa)", "height (mm)")
    for bubble, table in enumerate(calibration.tables):
        colour = COLOURS[bubble % len(COLOURS)]
        axes.plot(table.pressure_pa / 1e3, table.height_um / 1e3, lw=1.2, color=colour, label=f"{bubble}")
    if len(calibration.tables) <= _LEGEND_MAX:
        axes.legend(title="bubble", loc="center left", bbox_to_anchor=(1, 0.5))
    axes.set_title(f"{calibration.board}: {len(calibration.tables)} tables", loc="left")
    return figure


@figure_of.register
def _(calibration: SelfCalibration) -> Figure:
    return self_calibration.draw(calibration)


def _axes(across: str, up: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(5.6, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.set(xlabel=across, ylabel=up)
    return figure, axes
