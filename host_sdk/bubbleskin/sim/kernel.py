"""The equations of ideal rubber, compiled: loops over the bubbles, written for one bubble at a time.

The membrane is that of the tables and the contact that of the planner, so that a plant can match both; `real` shares neither.

State and constants are arrays of records, one per bubble, so that the code reads like the equations. `bubbles` is (state,
constants), `reservoir` (air, supply), `coils` the seconds for which fill and vent have current, `contact` (place, necks,
springs, pairs, force) as of `bubbleskin.contact.energy`; without contact its arrays are empty.
"""

import inspect
import math
import sys
from functools import cache
from typing import Any

from bubbleskin.contact import energy
from bubbleskin.contact.energy import BUBBLE, SPRINGS
from bubbleskin.contact.energy import mechanics as _mechanics
from bubbleskin.membrane import balloon
from bubbleskin.native import load, njit, resolve
from bubbleskin.sim import devices, parameters, pneumatics, records
from bubbleskin.sim.devices import pointer
from bubbleskin.sim.devices import set_windows as _set_windows
from bubbleskin.sim.devices import way_out as _way_out
from bubbleskin.sim.pneumatics import OPEN_LINE
from bubbleskin.sim.records import AIR, CONSTANTS, DRAG, STATE, STRETCH_MAX, STRETCH_MIN, SUPPLY

_yeoh_pressure = njit(balloon.yeoh_pressure)
_orifice_flow = njit(pneumatics.orifice_flow)
_tube_flow = njit(pneumatics.tube_flow)
_pump_flow = njit(pneumatics.pump_flow)
_open_fraction = njit(pneumatics.open_fraction)


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
def _flows(s, p, source, outside, t, h):  # type: ignore[no-untyped-def]
    """RTṁ of a bubble's ways in and out from `t` to `t + h` s, W: fill from `source` Pa, vent, tube, and what is lost."""
    b = p.critical_ratio
    fill = vent = lost = 0.0
    fraction = _open_fraction(s.fill_start, s.fill_stop, t, h)
    if fraction > 0.0:
        fill = fraction * _orifice_flow(source, s.node, p.fill_conductance, b)
    fraction = _open_fraction(s.vent_start, s.vent_stop, t, h)
    if fraction > 0.0:
        vent = fraction * _orifice_flow(s.node, outside, p.vent_conductance, b)
    tube = _tube_flow(s.node, s.pressure, p.tube_resistance)
    leak = p.leak + s.leak
    if leak > 0.0:
        lost = leak * (s.pressure - outside)
    if s.pop_off > 0.0:
        lost += _orifice_flow(s.pressure, outside, s.pop_off * OPEN_LINE, b)
    return fill, vent, tube, lost


@njit(inline="always")
def _stretch(s, p, outside, load, h):  # type: ignore[no-untyped-def]
    """Let the membrane give way for `h` s against `outside` Pa of air and `load` Pa of neighbours; volumes before and after, m³.

    η dλ/dt = p − P(λ) − F/(4πR²), F what necks, base and neighbours press on the sphere with.
    """
    sphere = 4.0 / 3.0 * math.pi * p.radius * p.radius * p.radius
    before = p.tube_volume + sphere * s.stretch * s.stretch * s.stretch
    stretch = s.stretch + h * (s.pressure - outside - s.membrane - load) / p.viscosity
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
        fill, vent, tube, lost = _flows(s, p, source, supply.atmosphere, t, h)
        load = 0.0
        if len(place) and force[i, 3] != 0.0:
            load = force[i, 3] / (4.0 * math.pi * place[i, 3] * place[i, 3])
        before, volume = _stretch(s, p, supply.atmosphere, load, h)
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
        gauge = air.pressure - supply.atmosphere
        pumped = 0.0
        if air.pump_off == 0.0:
            pumped = _pump_flow(gauge, pump, supply.pump_free_flow, supply.pump_stall, supply.atmosphere)
        dumped = 0.0
        conductance = _way_out(air, supply, dump)
        if conductance > 0.0:
            dumped = _orifice_flow(air.pressure, supply.atmosphere, conductance, supply.critical_ratio)
        if len(contact[0]):
            _move_centres(contact, h)
        drawn, vented = _step_bubbles(bubbles, contact, air.pressure, supply, dumped, k * h, h)
        air.pressure += supply.polytropic * h * (pumped - drawn) / supply.volume
        air.pumped += h * pumped
        air.vented += h * vented


def _entries() -> dict[str, Any]:
    """`advance` for numba, with addresses in place of arrays; `Plant` says what they are given."""
    import numba
    from numba import carray, float64, int64, void

    state, constants, air, supply, necks, springs = map(pointer, (STATE, CONSTANTS, AIR, SUPPLY, BUBBLE, SPRINGS))
    numbers, whole = map(pointer, (float64, int64))
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

    return {"advance": advance}


@cache
def advance() -> Any:
    """Steps a plant; `Plant` says what it is given."""
    modules = [sys.modules[__name__], balloon, pneumatics, energy, parameters, devices, records]
    return load("plant", "".join(map(inspect.getsource, modules)).encode(), _entries)["advance"]
