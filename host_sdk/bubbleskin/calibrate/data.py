"""From a trace to what is fitted: air that the valves have moved, tick by tick, and means of readings of a quiet line."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bubbleskin.calibrate.metering import Line, Valve, meter
from bubbleskin.calibrate.nominal import Nominal
from bubbleskin.calibrate.trace import Trace

Floats = NDArray[np.float64]

QUIET_S = 0.025
"""After a valve has shut: until the rubber's own viscosity and a pulse's heat show little."""
MEAN_S = 0.06
"""Of the readings that one mean is made of."""
READINGS_LEAST = 3
EMPTY_PA = 400.0
"""A line with less, for a few readings, is empty, and its air known anew."""
EMPTY_READINGS = 3


@dataclass(frozen=True, eq=False)
class Data:
    """One bubble's, by tick and by mean."""

    tick_s: float
    atmosphere: float
    pressure: Floats
    """Of the bubble, Pa, without zero and lift."""
    fill: Valve
    vent: Valve
    kpa_seconds: Floats
    """The pressure's integral: what a leak goes by."""
    anchors: NDArray[np.int64]
    """Of each tick, the tick at which its air was known last: where the bubble was empty."""
    lift: float
    first: NDArray[np.int64]
    """Tick at which each mean begins."""
    count: NDArray[np.int64]
    """Its readings."""

    def mean(self, values: Floats) -> Floats:
        """Means of what is given by tick."""
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray((total[self.first + self.count] - total[self.first]) / self.count)

    def since(self, total: Floats) -> Floats:
        """A running total since the bubble was empty."""
        return np.asarray(total - total[self.anchors])


def of_trace(trace: Trace, bubble: int, zero_pa: float, atmosphere_pa: float, nominal: Nominal) -> Data:
    """What a trace says of one bubble."""
    at = trace.column(bubble)
    line = Line(
        tick_ms=trace.tick_s * 1e3,
        pressure=trace.pressure_pa[:, at] - zero_pa,
        supply=trace.supply_now_pa,
        fill_us=trace.fill_us[:, at],
        vent_us=trace.vent_us[:, at],
        atmosphere=atmosphere_pa,
    )
    fill, vent, lift = meter(line, nominal)
    pressure = line.pressure - lift * (fill.rate * fill.flowing - vent.rate * vent.flowing)
    anchors = _anchors(line.pressure)
    first, count = _means(fill.active | vent.active, trace, pressure)
    return Data(
        tick_s=trace.tick_s,
        atmosphere=atmosphere_pa,
        pressure=pressure,
        fill=fill,
        vent=vent,
        kpa_seconds=np.cumsum(np.maximum(pressure, 0.0)) * trace.tick_s * 1e-3,
        anchors=anchors,
        lift=lift,
        first=first,
        count=count,
    )


def _anchors(pressure: Floats) -> NDArray[np.int64]:
    empty = pressure < EMPTY_PA
    long = empty.copy()
    for back in range(1, EMPTY_READINGS):
        long[back:] &= empty[:-back]
        long[:back] = False
    long[0] = True
    return np.maximum.accumulate(np.where(long, np.arange(len(pressure)), 0))


def _means(active: NDArray[np.bool_], trace: Trace, pressure: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First tick and readings of each mean: of a line that has been quiet for long enough, from the second way on."""
    settle = max(2, round(QUIET_S / trace.tick_s))
    size = max(READINGS_LEAST, round(MEAN_S / trace.tick_s))
    ticks = np.arange(len(active))
    last = np.maximum.accumulate(np.where(active, ticks, -1))  # a period in which something was open
    quiet = (ticks - last > settle) & (pressure > 2 * EMPTY_PA) & (ticks >= trace.fitted_from)
    first, count = [], []
    begin = None
    for tick in range(len(ticks) + 1):
        on = tick < len(ticks) and bool(quiet[tick])
        if begin is not None and (not on or tick - begin == size):
            if tick - begin >= READINGS_LEAST:
                first.append(begin)
                count.append(tick - begin)
            begin = None
        if on and begin is None:
            begin = tick
    return np.array(first, np.int64), np.array(count, np.int64)
