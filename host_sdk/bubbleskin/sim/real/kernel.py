"""The equations of real rubber and gas, compiled: loops over the bubbles, as `bubbleskin.sim.kernel` of ideal ones.

`bubbles` is (state, constants), `reservoir` (air, supply), `coils` the seconds for which fill and vent have current, `touch`
(place, barbs, pairs, force) as of `push`; without contact its arrays are empty.
"""

import inspect
import math
import sys
from functools import cache
from typing import Any

from bubbleskin.native import load, njit, resolve
from bubbleskin.sim import devices, parameters, pneumatics, records
from bubbleskin.sim.devices import pointer
from bubbleskin.sim.devices import set_windows as _set_windows
from bubbleskin.sim.devices import way_out as _way_out
from bubbleskin.sim.pneumatics import OPEN_LINE, REFERENCE_TEMPERATURE, VISCOSITY_EXPONENT
from bubbleskin.sim.real import gas, push, rubber
from bubbleskin.sim.real.gas import HEAT_RATIO
from bubbleskin.sim.real.push import push as _push
from bubbleskin.sim.records import AIR, CONSTANTS, STATE, STRETCH_MAX, STRETCH_MIN, SUPPLY

_orifice_flow = njit(pneumatics.orifice_flow)
_tube_flow = njit(pneumatics.tube_flow)
_pump_flow = njit(pneumatics.pump_flow)
_open_fraction = njit(pneumatics.open_fraction)
_energy_density = njit(rubber.energy_density)
_elastic_stress = njit(rubber.elastic_stress)
_softening = njit(rubber.softening)
_branch = njit(rubber.branch)
_wall_pressure = njit(rubber.wall_pressure)
_expanded = njit(gas.expanded)
_cooled = njit(gas.cooled)


@njit(inline="always")
def _orifice(p1, p2, warm1, warm2, conductance, b):  # type: ignore[no-untyped-def]
    """Flow of air and of heat through an orifice: dA/dt and RTṁ, W, from p1 at θ1 to p2 at θ2. ISO 6358: ṁ ~ p1/√T1."""
    flow = _orifice_flow(p1, p2, conductance, b)
    warm = warm1 if flow >= 0.0 else warm2
    root = math.sqrt(warm)
    return flow / root, flow * root


@njit(inline="always")
def _wall(s, p):  # type: ignore[no-untyped-def]
    """Stresses of the wall at its new stretch, a step after the last ones, and the pressure that it holds."""
    stress = _elastic_stress(s.stretch, p.mu, p.c2, p.c3)
    if s.stretch >= s.largest:
        s.largest = s.stretch
    else:
        worst = _energy_density(s.largest, p.mu, p.c2, p.c3)
        stress *= _softening(_energy_density(s.stretch, p.mu, p.c2, p.c3), worst, p.mullins, p.mullins_width)
    change = stress - s.stress
    s.quick = s.quick_left * s.quick + s.quick_new * change
    s.slow = s.slow_left * s.slow + s.slow_new * change
    s.stress = stress
    s.membrane = _wall_pressure(s.stretch, stress + s.quick + s.slow, p.thickness, p.radius)


@njit(inline="always")
def _volume(s, p):  # type: ignore[no-untyped-def]
    """Line and sphere, m³."""
    radius = p.radius * s.stretch
    return p.tube_volume + 4.0 / 3.0 * math.pi * radius * radius * radius


@njit(inline="always")
def _step_bubble(s, p, source, outside, load, t, h):  # type: ignore[no-untyped-def]
    """One bubble from `t` to `t + h` s. Returns air and heat drawn, and air lost, J.

    `source` is pressure (Pa) and θ; `outside` too, and by how much tubes resist more in such air.
    """
    wall = outside[1]
    volume = _volume(s, p)
    warm_node = s.node * p.node_volume / s.node_air
    fill = fill_heat = vent = vent_heat = lost = lost_heat = 0.0
    fraction = _open_fraction(s.fill_start, s.fill_stop, t, h)
    if fraction > 0.0:
        fill, fill_heat = _orifice(
            source[0], s.node, source[1], warm_node, fraction * p.fill_conductance, p.critical_ratio
        )
    fraction = _open_fraction(s.vent_start, s.vent_stop, t, h)
    if fraction > 0.0:
        vent, vent_heat = _orifice(s.node, outside[0], warm_node, wall, fraction * p.vent_conductance, p.critical_ratio)
    tube_heat = _tube_flow(s.node, s.pressure, p.tube_resistance * outside[2])
    leak = p.leak + s.leak
    warm = warm_node
    if tube_heat < 0.0 or leak > 0.0 or s.pop_off > 0.0:
        warm = s.pressure * volume / s.line_air
    tube = tube_heat / (warm_node if tube_heat >= 0.0 else warm)
    if leak > 0.0:
        lost_heat = leak * (s.pressure - outside[0])
        lost = lost_heat / warm
    if s.pop_off > 0.0:
        gone, gone_heat = _orifice(s.pressure, outside[0], warm, wall, s.pop_off * OPEN_LINE, p.critical_ratio)
        lost += gone
        lost_heat += gone_heat

    stretch = s.stretch + h * (s.pressure - outside[0] - s.membrane - load) / p.viscosity
    s.stretch = min(max(stretch, STRETCH_MIN), STRETCH_MAX)
    _wall(s, p)
    after = _volume(s, p)

    s.node_air += h * (fill - vent - tube)
    energy = s.node * p.node_volume + h * HEAT_RATIO * (fill_heat - vent_heat - tube_heat)
    s.node = _cooled(energy, s.node_air, wall, p.node_heat_time, h) / p.node_volume
    s.line_air += h * (tube - lost)
    energy = _expanded(s.pressure * volume, volume, after) + h * HEAT_RATIO * (tube_heat - lost_heat)
    s.pressure = _cooled(energy, s.line_air, wall, p.heat_time * s.stretch * s.stretch, h) / after
    return h * fill, h * fill_heat, h * (vent + lost)


@njit
def _advance(bubbles, reservoir, touch, coils, dt, substeps, pump, dump):  # type: ignore[no-untyped-def]
    state, constants = bubbles
    place, force = touch[0], touch[3]
    air, supply = reservoir[0][0], reservoir[1][0]
    h = dt / substeps
    wall = supply.temperature / REFERENCE_TEMPERATURE
    outside = (supply.atmosphere, wall, wall**VISCOSITY_EXPONENT)
    _set_windows(bubbles, coils, dt)
    for i in range(len(state)):
        s, p = state[i], constants[i]
        s.quick_left, s.quick_new = _branch(p.quick_strength, p.quick_time, h)
        s.slow_left, s.slow_new = _branch(p.slow_strength, p.slow_time, h)
    for k in range(substeps):
        warm = air.pressure * supply.volume / air.air
        gauge = air.pressure - supply.atmosphere
        pumped = 0.0
        if air.pump_off == 0.0:
            pumped = _pump_flow(gauge, pump, supply.pump_free_flow, supply.pump_stall, supply.atmosphere)
        dumped = dumped_heat = 0.0
        conductance = _way_out(air, supply, dump)
        if conductance > 0.0:
            dumped, dumped_heat = _orifice(
                air.pressure, supply.atmosphere, warm, wall, conductance, supply.critical_ratio
            )
        if len(place):
            _push(place, touch[1], constants, touch[2], force, h)
        source = (air.pressure, warm)
        drawn, drawn_heat, vented = h * dumped, h * dumped_heat, h * dumped
        for i in range(len(state)):
            s, p = state[i], constants[i]
            load = 0.0
            if len(place) and force[i, 3] != 0.0:
                load = force[i, 3] / (4.0 * math.pi * place[i, 3] * place[i, 3])
            fill, fill_heat, lost = _step_bubble(s, p, source, outside, load, k * h, h)
            if len(place):
                place[i, 3] = p.radius * s.stretch
            drawn += fill
            drawn_heat += fill_heat
            vented += lost
        air.air += h * pumped / wall - drawn
        energy = air.pressure * supply.volume + HEAT_RATIO * (h * pumped - drawn_heat)
        air.pressure = _cooled(energy, air.air, wall, supply.heat_time, h) / supply.volume
        air.pumped += h * pumped / wall
        air.vented += vented


def _entries() -> dict[str, Any]:
    """`advance` for numba, with addresses in place of arrays; `Plant` says what they are given."""
    import numba
    from numba import carray, float64, int64, void

    state, constants, air, supply = map(pointer, (STATE, CONSTANTS, AIR, SUPPLY))
    numbers, whole = map(pointer, (float64, int64))
    plant = (int64, state, constants, air, supply)
    where = (int64, int64, numbers, numbers, whole, numbers)
    resolve(globals())

    @numba.njit(void(*plant, *where, numbers, numbers, float64, int64, float64, int64))
    def advance(  # type: ignore[no-untyped-def]
        n, state, constants, air, supply, m, k, place, barbs, pairs, force, fill_on, vent_on, dt, substeps, pump, dump
    ):
        bubbles = carray(state, (n,)), carray(constants, (n,))
        reservoir = carray(air, (1,)), carray(supply, (1,))
        touch = carray(place, (m, 4)), carray(barbs, (m, 2)), carray(pairs, (k, 2)), carray(force, (m, 4))
        coils = carray(fill_on, (n,)), carray(vent_on, (n,))
        _advance(bubbles, reservoir, touch, coils, dt, substeps, pump, dump != 0)

    return {"advance": advance}


@cache
def advance() -> Any:
    """Steps a plant; `Plant` says what it is given."""
    modules = [sys.modules[__name__], rubber, gas, push, pneumatics, parameters, devices, records]
    return load("real", "".join(map(inspect.getsource, modules)).encode(), _entries)["advance"]
