"""Valves, relief valve and sensors of the plant, compiled: what is the same whatever the bubbles are made of."""

import inspect
import sys
from functools import cache
from typing import Any

import numpy as np

from bubbleskin.native import load, njit, resolve
from bubbleskin.sim import parameters, pneumatics, records
from bubbleskin.sim.records import AIR, CONSTANTS, STATE, SUPPLY

_valve_window = njit(pneumatics.valve_window)
_sensor_counts = njit(pneumatics.sensor_counts)


@njit(inline="always")
def set_windows(bubbles, coils, dt):  # type: ignore[no-untyped-def]
    """When each valve is open within the next `dt` s, from how long its coil has current."""
    state, constants = bubbles
    fill_on, vent_on = coils
    for i in range(len(state)):
        s, p = state[i], constants[i]
        s.fill_start, s.fill_stop, s.fill_energised, s.fill_open, s.fill_since = _valve_window(
            s.fill_energised, s.fill_open, s.fill_since, fill_on[i], dt, p.fill_opening, p.fill_closing
        )
        if s.fill_stuck != 0.0:
            s.fill_start, s.fill_stop = 0.0, dt if s.fill_stuck > 0.0 else 0.0
        s.vent_start, s.vent_stop, s.vent_energised, s.vent_open, s.vent_since = _valve_window(
            s.vent_energised, s.vent_open, s.vent_since, vent_on[i], dt, p.vent_opening, p.vent_closing
        )
        if s.vent_stuck != 0.0:
            s.vent_start, s.vent_stop = 0.0, dt if s.vent_stuck > 0.0 else 0.0


@njit(inline="always")
def way_out(air, supply, dump):  # type: ignore[no-untyped-def]
    """Sonic conductance of dump and relief valve of the reservoir together, m³/(s·Pa)."""
    opening = (air.pressure - supply.atmosphere - supply.relief_pressure) / supply.relief_range
    if air.relief_stuck > 0.0:
        opening = 0.0
    dumps = (dump or air.dump_stuck > 0.0) and air.dump_stuck >= 0.0
    if dumps or opening > 0.0:
        return supply.dump_conductance * ((1.0 if dumps else 0.0) + min(max(opening, 0.0), 1.0))
    return 0.0


@njit
def read_sensors(bubbles, reservoir, noise, pa_per_count, supply_pa_per_count, counts):  # type: ignore[no-untyped-def]
    """All sensors into `counts`, the reservoir's last."""
    state, constants = bubbles
    air, supply = reservoir[0][0], reservoir[1][0]
    for i in range(len(state)):
        s, p = state[i], constants[i]
        gauge = (s.node - supply.atmosphere) * p.sensor_gain + p.sensor_offset + s.sensor_bias
        counts[i] = _sensor_counts(gauge, p.sensor_noise * noise[i], pa_per_count)
        if s.sensor_stuck > 0.0:
            counts[i] = s.sensor_stuck
        if s.sensor_absent > 0.0:
            counts[i] = 0
    gauge = (air.pressure - supply.atmosphere) * supply.sensor_gain + supply.sensor_offset + air.supply_bias
    if air.supply_flat > 0.0:
        gauge = air.supply_flat
    counts[-1] = _sensor_counts(gauge, supply.sensor_noise * noise[-1], supply_pa_per_count)
    if air.supply_stuck > 0.0:
        counts[-1] = air.supply_stuck
    if air.supply_absent > 0.0:
        counts[-1] = 0


def pointer(kind: Any) -> Any:
    """numba's type for where an array of numbers or of records is."""
    import numba

    return numba.types.CPointer(numba.from_dtype(kind) if isinstance(kind, np.dtype) else kind)


def _entries() -> dict[str, Any]:
    """`sense` for numba, with addresses in place of arrays."""
    import numba
    from numba import carray, float64, int64, uint16, void

    resolve(globals())
    state, constants, air, supply = map(pointer, (STATE, CONSTANTS, AIR, SUPPLY))
    numbers, words = map(pointer, (float64, uint16))

    @numba.njit(void(int64, state, constants, air, supply, numbers, float64, float64, words))
    def sense(n, state, constants, air, supply, noise, pa_per_count, supply_pa_per_count, counts):  # type: ignore[no-untyped-def]
        bubbles = carray(state, (n,)), carray(constants, (n,))
        reservoir = carray(air, (1,)), carray(supply, (1,))
        noises, found = carray(noise, (n + 1,)), carray(counts, (n + 1,))
        read_sensors(bubbles, reservoir, noises, pa_per_count, supply_pa_per_count, found)

    return {"sense": sense}


@cache
def sense() -> Any:
    """Reads all sensors; `Plant` says what it is given."""
    modules = [sys.modules[__name__], pneumatics, parameters, records]
    return load("sensors", "".join(map(inspect.getsource, modules)).encode(), _entries)["sense"]
