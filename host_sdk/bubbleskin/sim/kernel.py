"""The equations of the plant, compiled: loops over the bubbles, written for one bubble at a time.

State and constants are arrays of records, one per bubble, so that the code reads like the equations. `bubbles` is (state,
constants), `reservoir` (air, supply), `coils` the seconds for which fill and vent have current, `contact` (place, necks,
springs, pairs, force) as of `bubbleskin.contact.energy`; without contact its arrays are empty.
"""

import inspect
import math
import sys
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from bubbleskin.contact import energy
from bubbleskin.contact.energy import BUBBLE, SPRINGS
from bubbleskin.contact.energy import mechanics as _mechanics
from bubbleskin.membrane import balloon
from bubbleskin.membrane.balloon import ATMOSPHERE
from bubbleskin.native import load, njit, resolve
from bubbleskin.sim import parameters, pneumatics
from bubbleskin.sim.parameters import PlantParameters, Supply
from bubbleskin.sim.pneumatics import OPEN_LINE

STRETCH_MIN, STRETCH_MAX = 0.8, 6.0
"""Where the model ends: a membrane under suction buckles, an over-inflated one slips off its barb."""

DRAG = 0.05
"""What slows a centre down, N·s/m: it follows its springs within milliseconds, much faster than air flows. Small
enough not to show, large enough for steps of 50 µs: h k < 2 DRAG even where six neighbours push (1800 N/m)."""

FAILURES = ("leak", "pop_off", "fill_stuck", "vent_stuck", "sensor_stuck", "sensor_absent", "sensor_bias")
"""What can be made to fail, all 0 when healthy; `Plant.inject` says what the values mean."""

SUPPLY_FAILURES = ("supply_stuck", "supply_flat", "supply_bias", "supply_absent", "relief_stuck")
"""The same of the reservoir."""

STATE = np.dtype(
    [(name, "f8") for name in ("stretch", "pressure", "node", "membrane")]
    + [(f"{valve}_{name}", "?") for valve in ("fill", "vent") for name in ("energised", "open")]
    + [(f"{valve}_{name}", "f8") for valve in ("fill", "vent") for name in ("since", "start", "stop")]
    + [(name, "f8") for name in FAILURES],
    align=True,
)
AIR = np.dtype([(name, "f8") for name in ("pressure", "pumped", "vented", *SUPPLY_FAILURES)])
SUPPLY = np.dtype([(f.name, "f8") for f in fields(Supply)])
CONSTANTS = np.dtype([(f.name, "f8") for f in fields(PlantParameters) if f.name != "supply"])


_yeoh_pressure = njit(balloon.yeoh_pressure)
_orifice_flow = njit(pneumatics.orifice_flow)
_tube_flow = njit(pneumatics.tube_flow)
_pump_flow = njit(pneumatics.pump_flow)
_valve_window = njit(pneumatics.valve_window)
_open_fraction = njit(pneumatics.open_fraction)
_sensor_counts = njit(pneumatics.sensor_counts)


@njit(inline="always")
def _set_windows(bubbles, coils, dt):  # type: ignore[no-untyped-def]
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
def _move_centres(contact, h):  # type: ignore[no-untyped-def]
    """Let centres follow the forces of necks, base and neighbours for `h` s; what is left of them acts on the membranes."""
    place, necks, springs, pairs, force = contact
    force[:] = 0.0
    _mechanics(place, necks, springs[0], pairs, force)
    for i in range(len(place)):
        c = place[i]
        kz = springs[0].kz_up if c[2] > c[3] else springs[0].kz_down
        c[0] -= h * force[i, 0] / (DRAG + h * springs[0].kxy)
        c[1] -= h * force[i, 1] / (DRAG + h * springs[0].kxy)
        c[2] -= h * force[i, 2] / (DRAG + h * kz)


@njit(inline="always")
def _flows(s, p, source, b, t, h):  # type: ignore[no-untyped-def]
    """RTṁ of a bubble's ways in and out from `t` to `t + h` s, W: fill from `source` Pa, vent, tube, and what is lost."""
    fill = vent = lost = 0.0
    fraction = _open_fraction(s.fill_start, s.fill_stop, t, h)
    if fraction > 0.0:
        fill = fraction * _orifice_flow(source, s.node, p.fill_conductance, b)
    fraction = _open_fraction(s.vent_start, s.vent_stop, t, h)
    if fraction > 0.0:
        vent = fraction * _orifice_flow(s.node, ATMOSPHERE, p.vent_conductance, b)
    tube = _tube_flow(s.node, s.pressure, p.tube_resistance)
    if s.leak > 0.0:
        lost = s.leak * (s.pressure - ATMOSPHERE)
    if s.pop_off > 0.0:
        lost += _orifice_flow(s.pressure, ATMOSPHERE, s.pop_off * OPEN_LINE, b)
    return fill, vent, tube, lost


@njit(inline="always")
def _stretch(s, p, load, h):  # type: ignore[no-untyped-def]
    """Let the membrane give way for `h` s under `load` Pa from outside; volumes before and after, m³.

    η dλ/dt = p − P(λ) − F/(4πR²), F what necks, base and neighbours press on the sphere with.
    """
    sphere = 4.0 / 3.0 * math.pi * p.radius * p.radius * p.radius
    before = p.tube_volume + sphere * s.stretch * s.stretch * s.stretch
    stretch = s.stretch + h * (s.pressure - ATMOSPHERE - s.membrane - load) / p.viscosity
    s.stretch = min(max(stretch, STRETCH_MIN), STRETCH_MAX)
    return before, p.tube_volume + sphere * s.stretch * s.stretch * s.stretch


@njit(inline="always")
def _step_bubbles(bubbles, contact, source, supply, dumped, t, h):  # type: ignore[no-untyped-def]
    """Every bubble from `t` to `t + h` s on a reservoir at `source` Pa that has `dumped`: what is drawn and vented, W."""
    state, constants = bubbles
    place, force = contact[0], contact[4]
    n = supply.polytropic
    drawn = vented = dumped
    for i in range(len(state)):  # In a loop of their own: no bubble waits for the one before.
        s, p = state[i], constants[i]
        s.membrane = _yeoh_pressure(s.stretch, p.mu, p.c2, p.c3, p.thickness, p.radius)
    for i in range(len(state)):
        s, p = state[i], constants[i]
        fill, vent, tube, lost = _flows(s, p, source, supply.critical_ratio, t, h)
        load = 0.0
        if len(place) and force[i, 3] != 0.0:
            load = force[i, 3] / (4.0 * math.pi * place[i, 3] * place[i, 3])
        before, volume = _stretch(s, p, load, h)
        if len(place):
            place[i, 3] = p.radius * s.stretch
        # dp/dt = n/V (RTṁ − p dV/dt); the new V and the old p, so that n = 1 keeps pV exactly
        s.node += n * h * (fill - vent - tube) / p.node_volume
        s.pressure += n * (h * (tube - lost) - s.pressure * (volume - before)) / volume
        drawn += fill
        vented += vent + lost
    return drawn, vented


@njit
def _advance(bubbles, reservoir, contact, coils, dt, substeps, pump, dump):  # type: ignore[no-untyped-def]
    air, supply = reservoir[0][0], reservoir[1][0]
    h = dt / substeps
    _set_windows(bubbles, coils, dt)
    for k in range(substeps):
        pumped = _pump_flow(air.pressure - ATMOSPHERE, pump, supply.pump_free_flow, supply.pump_stall)
        dumped = 0.0
        opening = (air.pressure - ATMOSPHERE - supply.relief_pressure) / supply.relief_range
        if air.relief_stuck > 0.0:
            opening = 0.0
        if dump or opening > 0.0:
            conductance = supply.dump_conductance * ((1.0 if dump else 0.0) + min(max(opening, 0.0), 1.0))
            dumped = _orifice_flow(air.pressure, ATMOSPHERE, conductance, supply.critical_ratio)
        if len(contact[0]):
            _move_centres(contact, h)
        drawn, vented = _step_bubbles(bubbles, contact, air.pressure, supply, dumped, k * h, h)
        air.pressure += supply.polytropic * h * (pumped - drawn) / supply.volume
        air.pumped += h * pumped
        air.vented += h * vented


@njit
def _sense(bubbles, reservoir, noise, pa_per_count, supply_pa_per_count, counts):  # type: ignore[no-untyped-def]
    state, constants = bubbles
    for i in range(len(state)):
        s, p = state[i], constants[i]
        gauge = (s.node - ATMOSPHERE) * p.sensor_gain + p.sensor_offset + s.sensor_bias
        counts[i] = _sensor_counts(gauge, p.sensor_noise * noise[i], pa_per_count)
        if s.sensor_stuck > 0.0:
            counts[i] = s.sensor_stuck
        if s.sensor_absent > 0.0:
            counts[i] = 0
    air, supply = reservoir[0][0], reservoir[1][0]
    gauge = air.pressure - ATMOSPHERE + supply.sensor_offset + air.supply_bias
    if air.supply_flat > 0.0:
        gauge = air.supply_flat
    counts[-1] = _sensor_counts(gauge, supply.sensor_noise * noise[-1], supply_pa_per_count)
    if air.supply_stuck > 0.0:
        counts[-1] = air.supply_stuck
    if air.supply_absent > 0.0:
        counts[-1] = 0


def _entries() -> dict[str, Any]:
    """`advance` and `sense` for numba, with addresses in place of arrays; `Plant` says what they are given."""
    import numba
    from numba import carray, float64, int64, uint16, void

    def array_of(kind: Any) -> Any:
        return numba.types.CPointer(numba.from_dtype(kind) if isinstance(kind, np.dtype) else kind)

    state, constants, air, supply, necks, springs = map(array_of, (STATE, CONSTANTS, AIR, SUPPLY, BUBBLE, SPRINGS))
    numbers, whole, words = map(array_of, (float64, int64, uint16))
    plant = (int64, state, constants, air, supply)
    resolve(globals())

    @numba.njit(
        void(
            *plant,
            int64,
            int64,
            numbers,
            necks,
            springs,
            whole,
            numbers,
            numbers,
            numbers,
            float64,
            int64,
            float64,
            int64,
        )
    )
    def advance(  # type: ignore[no-untyped-def]
        n,
        state,
        constants,
        air,
        supply,
        m,
        k,
        place,
        necks,
        springs,
        pairs,
        force,
        fill_on,
        vent_on,
        dt,
        substeps,
        pump,
        dump,
    ):
        bubbles = carray(state, (n,)), carray(constants, (n,))
        reservoir = carray(air, (1,)), carray(supply, (1,))
        where = carray(place, (m, 4)), carray(necks, (m,))
        contact = (*where, carray(springs, (1,)), carray(pairs, (k, 2)), carray(force, (m, 4)))
        coils = carray(fill_on, (n,)), carray(vent_on, (n,))
        _advance(bubbles, reservoir, contact, coils, dt, substeps, pump, dump != 0)

    @numba.njit(void(*plant, numbers, float64, float64, words))
    def sense(n, state, constants, air, supply, noise, pa_per_count, supply_pa_per_count, counts):  # type: ignore[no-untyped-def]
        bubbles = carray(state, (n,)), carray(constants, (n,))
        reservoir = carray(air, (1,)), carray(supply, (1,))
        _sense(bubbles, reservoir, carray(noise, (n + 1,)), pa_per_count, supply_pa_per_count, carray(counts, (n + 1,)))

    return {"advance": advance, "sense": sense}


@cache
def compiled() -> dict[str, Any]:
    """`advance` and `sense`, which are documented where `Plant` calls them."""
    modules = [sys.modules[__name__], balloon, pneumatics, energy, parameters]
    return load("plant", "".join(map(inspect.getsource, modules)).encode(), _entries)
