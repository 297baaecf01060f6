"""How much air has gone into a bubble and out, from what telemetry says: a sum over pulses, linear in what is unknown.

Flow through a restrictor follows ISO 6358 below the critical ratio b: ṁRT ~ √((p₁ − p₂)(p₂ + (1 − 2b) p₁)). Both pressures
are measured while air flows; where a reading falls into no pulse, what tube and rubber hold back while air flows, the *lift*, is
added to it. It stands here for itself, apart from the firmware and from the simulated plant.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin.calibrate.nominal import Nominal

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_ITERATIONS = 4  # of a flow that depends on the pressure that it makes


class Line(NamedTuple):
    """One bubble's line, reading by reading, one a tick. Gauge pressures in Pa."""

    tick_ms: float
    pressure: Floats
    supply: Floats
    fill_us: Floats
    """For how long the fill valve is energised in the period after the one that begins here, as telemetry says it."""
    vent_us: Floats
    atmosphere: float


class Valve(NamedTuple):
    """One valve of one bubble, reading by reading."""

    air: Floats
    """What has gone through it until then, µJ, if it is as it is taken for."""
    late: Floats
    """By how much less that is for each ms that it opens later, µJ/ms."""
    rate: Floats
    """Flow at the reading, where it is open; else that which it would have, µJ/ms."""
    flowing: Flags
    """Whether it is open at the reading."""
    active: Flags
    """Whether it is, or will be, or was open in the period that begins."""


def meter(line: Line, nominal: Nominal) -> tuple[Valve, Valve, float]:
    """Both valves, and the lift that their pressures show, in Pa per µJ/ms."""
    lift = 0.0
    for _ in range(2):
        fill, vent = _valve(line, nominal, 1, lift), _valve(line, nominal, -1, lift)
        lift = _lift(line.pressure, fill, vent)
    return fill, vent, lift


def _valve(line: Line, nominal: Nominal, sign: int, lift: float) -> Valve:
    tick = line.tick_ms
    commanded = line.fill_us if sign > 0 else line.vent_us
    energised = np.concatenate([[0.0], commanded[:-1]]) * 1e-3
    full = energised >= tick - 1e-6
    was_full = np.concatenate([[False], full[:-1]])
    begins = (energised > 0) & ~was_full
    ends = ~full & ((energised > 0) | was_full)
    opened = energised - np.where(begins, nominal.opens_ms, 0.0) + np.where(ends, nominal.closes_ms, 0.0)
    shuts_late = (energised > 0) & (energised + nominal.closes_ms > tick)
    flowing = np.concatenate([[False], shuts_late[:-1]])
    flow = _fill_flow if sign > 0 else _vent_flow
    rate = nominal.gain * flow(line, flowing, lift * nominal.gain, nominal.critical_ratio)
    mean = 0.5 * (rate + np.append(rate[1:], rate[-1]))
    return Valve(
        air=_so_far(mean * np.maximum(opened, 0.0)),
        late=_so_far(np.where(begins, mean, 0.0)),
        rate=rate,
        flowing=flowing,
        active=(energised > 0) | was_full,
    )


def _so_far(of_periods: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(of_periods)[:-1]])


def _iso(high: Floats, low: Floats, critical: float) -> Floats:
    return np.asarray(np.sqrt(np.maximum(high - low, 0.0) * (low + (1.0 - 2.0 * critical) * high)))


def _fill_flow(line: Line, flowing: Flags, lift: float, critical: float) -> Floats:
    high = line.supply + line.atmosphere
    flow = np.zeros_like(high)
    for _ in range(_ITERATIONS):
        low = line.pressure + line.atmosphere + np.where(flowing, 0.0, lift * flow)
        flow = _iso(high, np.minimum(low, high), critical)
    return flow


def _vent_flow(line: Line, flowing: Flags, lift: float, critical: float) -> Floats:
    low = np.full_like(line.pressure, line.atmosphere)
    flow = np.zeros_like(low)
    for _ in range(_ITERATIONS):
        gauge = np.maximum(line.pressure - np.where(flowing, 0.0, lift * flow), 0.0)
        flow = _iso(gauge + line.atmosphere, low, critical)
    return flow


_LIFT_USUAL = 4.0  # Pa per µJ/ms, where nothing shows it
_LIFT_FROM_PA = 5e3


def _lift(pressure: Floats, fill: Valve, vent: Valve) -> float:
    """What pressure falls by where a fill valve shuts, or rises by where a vent valve does, over the flow until then."""
    idle = ~(fill.active | vent.active)
    quiet = np.append(idle[1:-1] & idle[2:], [False, False])  # both periods after the next reading
    drops, flows = [np.zeros(0)], [np.zeros(0)]
    for valve, sign in ((fill, 1.0), (vent, -1.0)):
        shuts = valve.flowing[:-2] & ~valve.flowing[1:-1] & quiet[:-2] & (pressure[:-2] > _LIFT_FROM_PA)
        last = np.flatnonzero(shuts)
        drops.append(sign * (pressure[last] - pressure[last + 2]))
        flows.append(valve.rate[last])
    drop, flow = np.concatenate(drops), np.concatenate(flows)
    return max(float(np.dot(drop, flow) / np.dot(flow, flow)), 0.0) if len(flow) else _LIFT_USUAL
