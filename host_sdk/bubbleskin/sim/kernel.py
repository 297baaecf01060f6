"""The equations of the plant, compiled: two loops over the bubbles, written for one bubble at a time.

State and figures are arrays of records, one per bubble, so that the code reads like the equations.
"""

import inspect
import math
import zlib
from dataclasses import fields

import numpy as np
from numba import njit

from bubbleskin.contact import energy
from bubbleskin.contact.energy import mechanics as _mechanics
from bubbleskin.membrane import balloon
from bubbleskin.membrane.balloon import ATMOSPHERE
from bubbleskin.sim import pneumatics
from bubbleskin.sim.parameters import PlantParameters, Supply
from bubbleskin.sim.pneumatics import OPEN_LINE

STRETCH_MIN, STRETCH_MAX = 0.8, 6.0
"""Where the model ends: a membrane under suction buckles, an over-inflated one slips off its barb."""

DRAG = 0.05
"""What slows a centre down, N·s/m: it follows its springs within milliseconds, much faster than air flows. Small
enough not to show, large enough for steps of 50 µs: h k < 2 DRAG even where six neighbours push (1800 N/m)."""

FAILURES = ("leak", "pop_off", "fill_stuck", "vent_stuck", "sensor_stuck", "sensor_absent", "sensor_bias")
"""What can be made to fail, all 0 when healthy; `Plant.inject` says what the values mean."""

STATE = np.dtype(
    [(name, "f8") for name in ("stretch", "pressure", "node")]
    + [(f"{valve}_{name}", "?") for valve in ("fill", "vent") for name in ("energised", "open")]
    + [(f"{valve}_{name}", "f8") for valve in ("fill", "vent") for name in ("since", "start", "stop")]
    + [(name, "f8") for name in FAILURES],
    align=True,
)
AIR = np.dtype([(name, "f8") for name in ("pressure", "pumped", "vented")])
SUPPLY = np.dtype([(f.name, "f8") for f in fields(Supply)])
CONSTANTS = np.dtype([(f.name, "f8") for f in fields(PlantParameters) if f.name != "supply"])


_yeoh_pressure = njit(balloon.yeoh_pressure)
_orifice_flow = njit(pneumatics.orifice_flow)
_tube_flow = njit(pneumatics.tube_flow)
_pump_flow = njit(pneumatics.pump_flow)
_valve_window = njit(pneumatics.valve_window)
_open_fraction = njit(pneumatics.open_fraction)
_sensor_counts = njit(pneumatics.sensor_counts)


def _compile(stamp: int):  # type: ignore[no-untyped-def]
    """Compile `advance` and `sense`, which are documented where `Plant` calls them.

    numba's cache looks at this file and at what a function closes over, not at the other files that it
    calls into. `stamp` stands for those: without it an edited formula would go on running as it was.
    """

    @njit(cache=True)
    def advance(  # type: ignore[no-untyped-def]
        state,
        constants,
        airs,
        supplies,
        fill_on,
        vent_on,
        dt,
        substeps,
        pump,
        dump,
        place,
        necks,
        springs,
        pairs,
        force,
    ):
        _ = stamp
        air, supply = airs[0], supplies[0]
        h = dt / substeps
        n = supply.polytropic
        b = supply.critical_ratio

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

        for k in range(substeps):
            t = k * h
            pumped = _pump_flow(air.pressure - ATMOSPHERE, pump, supply.pump_free_flow, supply.pump_stall)
            vented = _orifice_flow(air.pressure, ATMOSPHERE, supply.dump_conductance, b) if dump else 0.0
            drawn = vented
            if len(
                place
            ):  # centres follow the forces of necks, base and neighbours; what is left acts on the membranes
                force[:] = 0.0
                _mechanics(place, necks, springs[0], pairs, force)
                for i in range(len(place)):
                    c = place[i]
                    kz = springs[0].kz_up if c[2] > c[3] else springs[0].kz_down
                    c[0] -= h * force[i, 0] / (DRAG + h * springs[0].kxy)
                    c[1] -= h * force[i, 1] / (DRAG + h * springs[0].kxy)
                    c[2] -= h * force[i, 2] / (DRAG + h * kz)
            for i in range(len(state)):
                s, p = state[i], constants[i]
                # RTṁ of the bubble's ways in and out, W
                fill = vent = lost = 0.0
                fraction = _open_fraction(s.fill_start, s.fill_stop, t, h)
                if fraction > 0.0:
                    fill = fraction * _orifice_flow(air.pressure, s.node, p.fill_conductance, b)
                fraction = _open_fraction(s.vent_start, s.vent_stop, t, h)
                if fraction > 0.0:
                    vent = fraction * _orifice_flow(s.node, ATMOSPHERE, p.vent_conductance, b)
                tube = _tube_flow(s.node, s.pressure, p.tube_resistance)
                if s.leak > 0.0:
                    lost = s.leak * (s.pressure - ATMOSPHERE)
                if s.pop_off > 0.0:
                    lost += _orifice_flow(s.pressure, ATMOSPHERE, s.pop_off * OPEN_LINE, b)

                # η dλ/dt = p − P(λ) − F/(4πR²), F what necks, base and neighbours press on the sphere with
                sphere = 4.0 / 3.0 * math.pi * p.radius * p.radius * p.radius
                before = p.tube_volume + sphere * s.stretch * s.stretch * s.stretch
                membrane = _yeoh_pressure(s.stretch, p.mu, p.c2, p.c3, p.thickness, p.radius)
                if len(place):
                    membrane += force[i, 3] / (4.0 * math.pi * place[i, 3] * place[i, 3])
                stretch = s.stretch + h * (s.pressure - ATMOSPHERE - membrane) / p.viscosity
                s.stretch = min(max(stretch, STRETCH_MIN), STRETCH_MAX)
                if len(place):
                    place[i, 3] = p.radius * s.stretch
                volume = p.tube_volume + sphere * s.stretch * s.stretch * s.stretch

                # dp/dt = n/V (RTṁ − p dV/dt); the new V and the old p, so that n = 1 keeps pV exactly
                s.node += n * h * (fill - vent - tube) / p.node_volume
                s.pressure += n * (h * (tube - lost) - s.pressure * (volume - before)) / volume
                drawn += fill
                vented += vent + lost
            air.pressure += n * h * (pumped - drawn) / supply.volume
            air.pumped += h * pumped
            air.vented += h * vented

    @njit(cache=True)
    def sense(state, constants, noise, pa_per_count, counts):  # type: ignore[no-untyped-def]
        _ = stamp
        for i in range(len(state)):
            s, p = state[i], constants[i]
            gauge = (s.node - ATMOSPHERE) * p.sensor_gain + p.sensor_offset + s.sensor_bias
            counts[i] = _sensor_counts(gauge, p.sensor_noise * noise[i], pa_per_count)
            if s.sensor_stuck > 0.0:
                counts[i] = s.sensor_stuck
            if s.sensor_absent > 0.0:
                counts[i] = 0

    return advance, sense


advance, sense = _compile(
    zlib.crc32((inspect.getsource(balloon) + inspect.getsource(pneumatics) + inspect.getsource(energy)).encode())
)
