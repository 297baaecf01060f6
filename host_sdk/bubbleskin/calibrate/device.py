"""From what was found to what the wristband takes: a table for each bubble, and its trim.

The firmware reckons with its board's line volume and critical ratio. Of a bubble whose line is another, it would take other
amounts of air for a height; flows are scaled so that what it takes them for, over all heights, comes right.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.calibrate.fit import (
    FILL,
    FILL_LATE,
    LEAK,
    LINE,
    QUICK,
    RADIUS,
    SLOW,
    SOFTENING,
    VENT,
    VENT_LATE,
    Estimate,
)
from bubbleskin.calibrate.nominal import Nominal, sphere_mm3
from bubbleskin.membrane.table import MAX_KNOTS, Table

Floats = NDArray[np.float64]

USED_MM = (5.5, 13.0)
"""Heights that flows are made right for."""
_GAIN_UNIT = 65536 * 8.0
_SHARE_UNIT = 65536
_LEAK_UNIT = 16.0
_CURVE_SD_LEAST = 0.01
_SOFTENING_SD_SHARE = 0.3  # of the softening by which a height beyond what it has been stretched to is off
_SD_MOST = 16384 / 65536
_LEAK_SURE = 3.0  # standard deviations from which a leak is believed
_TOP_SHARE = 0.995  # of the pressure that the board's air allows at its greatest height
_KNOTS_FINE = 4000


class Figures(NamedTuple):
    """One bubble's part of a trim, and its table."""

    zero: int
    opens_us: int
    closes_us: int
    flow_gain: int
    vent_opens_us: int
    vent_closes_us: int
    vent_flow_gain: int
    flow_sd: int
    curve_sd: int
    leak: int
    table: Table


def figures(estimate: Estimate, zero_pa: float, zero_counts: int, nominal: Nominal, atmosphere_pa: float) -> Figures:
    """What the wristband is to use for a bubble whose sensor says `zero_pa` without pressure, its zero being `zero_counts`."""
    values = estimate.values
    offset = zero_pa / nominal.pa_per_count
    zero = round(zero_counts + offset)
    rest_pa = zero_pa - (zero - zero_counts) * nominal.pa_per_count
    share = line_share(estimate, nominal, atmosphere_pa)
    fill, vent = (_dead_us(float(values[late]), nominal) for late in (FILL_LATE, VENT_LATE))
    leak = float(values[LEAK])
    sure = leak > _LEAK_SURE * float(estimate.sd[LEAK])
    return Figures(
        zero,
        *fill,
        _gain(values[FILL] * share, nominal),
        *vent,
        _gain(values[VENT] * share, nominal),
        _share(flow_sd(estimate)),
        _share(curve_sd(estimate)),
        round(leak * _LEAK_UNIT) if sure else 0,
        table(estimate, rest_pa, nominal, atmosphere_pa),
    )


def line_share(estimate: Estimate, nominal: Nominal, atmosphere_pa: float) -> float:
    """By what flows are scaled: air with the board's line against that with its own, least squares of heights over `USED_MM`."""
    values = estimate.values
    height = np.linspace(*USED_MM, 60)
    pressure = 1e-3 * (atmosphere_pa + estimate.curve(height))
    empty = sphere_mm3(2.0 * values[RADIUS])

    def needed(line: float) -> Floats:
        return pressure * (sphere_mm3(height) + line) - 1e-3 * atmosphere_pa * (empty + line)

    slope = pressure * 0.5 * np.pi * height**2
    true, taken = needed(float(values[LINE])) / slope, needed(nominal.line_mm3) / slope
    return float(true @ taken / (true @ true))


def flow_sd(estimate: Estimate) -> float:
    """Share by which the fill valve's flow may be off."""
    return float(estimate.sd[FILL] / estimate.values[FILL])


def curve_sd(estimate: Estimate) -> float:
    """Share by which pressures may be off the table's: what the rubber remembers, and what the fit leaves."""
    v = estimate.values
    left = estimate.rms_pa / float(np.mean(estimate.pressure_pa))
    parts = np.array([v[QUICK], v[SLOW], _SOFTENING_SD_SHARE * v[SOFTENING], left])
    return float(max(np.sqrt((parts**2).sum()), _CURVE_SD_LEAST))


def table(estimate: Estimate, rest_pa: float, nominal: Nominal, atmosphere_pa: float) -> Table:
    """The curve as the firmware takes it, from rest to the board's greatest height, with what the zero leaves."""
    fine = np.linspace(2.0 * float(estimate.values[RADIUS]), nominal.height_max_mm, _KNOTS_FINE)
    pressure = np.minimum(estimate.curve(fine) + rest_pa, top_pa(nominal, atmosphere_pa))
    bend = np.abs(np.gradient(np.gradient(pressure, fine), fine)) / (20.0 + np.abs(np.gradient(pressure, fine)))
    density = np.sqrt(bend)
    density += 0.1 * density.mean()
    so_far = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    at = np.interp(np.linspace(0.0, so_far[-1], MAX_KNOTS), so_far, fine)
    micrometres = np.rint(1e3 * at).astype(int)
    micrometres = np.maximum.accumulate(micrometres - np.arange(MAX_KNOTS)) + np.arange(MAX_KNOTS)
    micrometres[-1] = round(1e3 * nominal.height_max_mm)
    knots = np.rint(np.maximum(np.interp(1e-3 * micrometres, fine, pressure), 0.0)).astype(int)
    return Table(micrometres, knots)


def top_pa(nominal: Nominal, atmosphere_pa: float) -> float:
    """The greatest pressure that a table may have: the board's, and what its air allows at its greatest height."""
    volume = float(sphere_mm3(nominal.height_max_mm)) + nominal.line_mm3
    by_air = 1e3 * nominal.air_max_uj / volume - max(atmosphere_pa, _SEA_LEVEL_PA)
    return min(nominal.pressure_max_pa, _TOP_SHARE * by_air)


_SEA_LEVEL_PA = 101_325.0
"""For which a board's greatest amount of air is stated."""


def _gain(flow: float, nominal: Nominal) -> int:
    return round(float(flow) * nominal.gain * _GAIN_UNIT)


def _share(value: float) -> int:
    return round(min(value, _SD_MOST) * _SHARE_UNIT)


def _dead_us(late_ms: float, nominal: Nominal) -> tuple[int, int]:
    """Opening and closing dead time whose difference is what was found: only that shows, so half of it goes to each."""
    opens, closes = nominal.opens_ms + 0.5 * late_ms, nominal.closes_ms - 0.5 * late_ms
    return round(1e3 * max(opens, 0.0)), round(1e3 * max(closes, 0.0))
