"""All bubbles together: each fitted by itself, then again with what the others tell of its restrictor."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bubbleskin.calibrate import fit as fits
from bubbleskin.calibrate import yardstick
from bubbleskin.calibrate.data import Data, of_trace
from bubbleskin.calibrate.fit import FILL, FILL_LATE, LINE, MEANS_LEAST, VENT, Estimate
from bubbleskin.calibrate.nominal import Nominal
from bubbleskin.calibrate.trace import Trace

Floats = NDArray[np.float64]

_COMPARED_LEAST = 3
"""Bubbles: with fewer there is hardly anything to compare with."""
_VOLUMES = FILL, VENT, LINE
_COMPARED_SD = 0.01
"""Share by which a comparison is off besides its noise: pressures at which restrictors work, heat."""


Sizes = Mapping[int, tuple[float, float]]
"""By bubble: how many times as high it is as was found, and the standard deviation of that."""


def sized(
    estimates: Mapping[int, Estimate], data: Mapping[int, Data], nominal: Nominal, sizes: Sizes
) -> dict[int, Estimate]:
    """Estimates of bubbles whose heights have been measured: with lengths times s, all volumes and flows are times s³."""
    found = dict(estimates)
    for bubble, (factor, sd) in sizes.items():
        if bubble not in estimates:
            continue
        one = estimates[bubble]
        flow = float(one.values[FILL]) * factor**3
        start = replace(
            one, values=one.values * np.where(np.isin(np.arange(len(one.values)), _VOLUMES), factor**3, 1.0)
        )
        found[bubble] = _fitted(data[bubble], nominal, (flow, 3.0 * sd * flow), start) or one
    return found


def estimate(
    traces: Sequence[Trace], zero_pa: Floats, atmosphere_pa: float, nominal: Nominal
) -> tuple[dict[int, Estimate], dict[int, Data]]:
    """What is found of every bubble that has enough to fit, and the data of all."""
    data = {
        bubble: of_trace(trace, bubble, float(zero_pa[bubble]), atmosphere_pa, nominal)
        for trace in traces
        for bubble in trace.bubbles
    }
    enough = {bubble: one for bubble, one in data.items() if len(one.first) >= MEANS_LEAST}
    alone = {bubble: found for bubble, one in enough.items() if (found := _fitted(one, nominal, None))}
    flows = _told_by_others(traces, data, alone)
    if not flows:
        return alone, data
    again = {bubble: _fitted(data[bubble], nominal, flows[bubble], one) for bubble, one in alone.items()}
    return {bubble: one for bubble, one in again.items() if one}, data


def _fitted(
    data: Data, nominal: Nominal, flow: tuple[float, float] | None, start: Estimate | None = None
) -> Estimate | None:
    """A fit; None where data is of no bubble at all, and numbers run out of bounds."""
    try:
        with np.errstate(all="ignore"):
            found = fits.fit(data, nominal, flow, start)
    except (ValueError, np.linalg.LinAlgError):
        return None
    return found if np.isfinite(found.values).all() and np.isfinite(found.covariance).all() else None


def _told_by_others(
    traces: Sequence[Trace], data: Mapping[int, Data], alone: Mapping[int, Estimate]
) -> dict[int, tuple[float, float]]:
    """Of each bubble what the reservoir and the others say of its fill valve's flow factor: value and standard deviation."""
    draws = [_draw(trace, data, alone) for trace in traces if all(bubble in alone for bubble in trace.bubbles)]
    if sum(len(draw.taken) for draw in draws) < _COMPARED_LEAST:
        return {}
    flows = yardstick.compare(draws)
    own = np.array([alone[bubble].values[FILL] for bubble in flows.bubbles])
    own_sd = np.array([alone[bubble].sd[FILL] for bubble in flows.bubbles])
    if (flows.value <= 0).any():
        return {}
    # In logarithms: what is compared is own + a constant that nobody knows.
    n = len(own)
    apart = np.log(flows.value) - np.log(own)
    noise = flows.covariance / np.outer(flows.value, flows.value) + _COMPARED_SD**2 * np.eye(n)
    found = {}
    for k, bubble in enumerate(flows.bubbles):
        others = np.arange(n) != k
        weight = np.linalg.pinv(noise[np.ix_(others, others)] + np.diag((own_sd / own)[others] ** 2)).sum(axis=0)
        constant = float(weight @ apart[others] / weight.sum())
        variance = float(1.0 / weight.sum() + noise[k, k])
        value = float(flows.value[k] * np.exp(-constant))
        found[bubble] = value, value * variance**0.5
    return {bubble: found.get(bubble, (1.0, 10.0)) for bubble in alone}


def _draw(trace: Trace, data: Mapping[int, Data], alone: Mapping[int, Estimate]) -> yardstick.Draw:
    taken = {}
    for bubble in trace.bubbles:
        fill = data[bubble].fill
        moved = fill.air - alone[bubble].values[FILL_LATE] * fill.late
        taken[bubble] = np.append(np.diff(moved), 0.0)
    return yardstick.Draw(trace.tick_s, trace.supply_now_pa, trace.supply_pa, taken)
