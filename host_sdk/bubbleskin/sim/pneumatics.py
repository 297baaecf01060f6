"""Valves, tubes, pump and sensors: the formulas of the simulated plant, as plain arithmetic.

Air is counted in joules: an amount is pV = mRT, a flow is RTṁ in watts. At one temperature that is mass,
and neither R nor T has to appear. Pressures are absolute in Pa unless a name says gauge. The functions on
scalars are compiled by `kernel.py`; here they stay Python.
"""

import math

REFERENCE_PRESSURE = 100e3
"""Absolute pressure at which ISO 6358 states a conductance (ANR), Pa."""

REFERENCE_TEMPERATURE = 293.15
"""Temperature at which it does, K. Air is counted at this one."""

DM3_PER_S_BAR = 1e-8
"""One dm³/(s·bar), the unit of data sheets, in m³/(s·Pa)."""

LITRE_PER_MINUTE = 1e-3 / 60
"""One L/min in m³/s."""

AIR_VISCOSITY = 1.81e-5
"""Dynamic viscosity of air at 20 °C, Pa·s."""

VISCOSITY_EXPONENT = 0.7
"""It grows with this power of the temperature, and with it a tube's resistance."""

CRITICAL_RATIO = 0.5
"""p2/p1 below which a restrictor is choked: 0.5 suits short tube orifices (doi 10.1177/1687814016687264)."""

LAMINAR_RATIO = 0.995
"""p2/p1 above which orifice flow is taken as linear; 0.995 to 0.999 is usual for ISO 6358 models."""

RESTRICTOR = 0.0038 * DM3_PER_S_BAR
"""Sonic conductance of a 0.2 mm restrictor, m³/(s·Pa); other bores scale with their area."""

OPEN_LINE = RESTRICTOR * (0.8 / 0.2) ** 2
"""Sonic conductance of the 0.8 mm line without its bubble, m³/(s·Pa)."""

ZERO_COUNT = 160
"""What a sensor reads at zero gauge: it can fall below it before it clips."""

FULL_SCALE = 4095


def orifice_flow(p1: float, p2: float, conductance: float, critical_ratio: float) -> float:
    """Air flow RTṁ in W from `p1` to `p2` (absolute Pa), negative when p2 is the higher.

    ISO 6358 at the reference temperature: RTṁ = p_ref C p1 ψ with ψ = 1 up to p2/p1 = b and
    ψ = √(1 − ((p2/p1 − b)/(1 − b))²) above it. Near p2 = p1 that
    slope is infinite, so from p2/p1 = 0.995 on ψ is a straight line.
    """
    high = max(p1, p2)
    ratio = min(p1, p2) / high
    if ratio <= critical_ratio:
        psi = 1.0
    else:
        x = (max(critical_ratio, min(ratio, LAMINAR_RATIO)) - critical_ratio) / (1.0 - critical_ratio)
        psi = math.sqrt(1.0 - x * x)
        if ratio > LAMINAR_RATIO:
            psi *= (1.0 - ratio) / (1.0 - LAMINAR_RATIO)
    flow = REFERENCE_PRESSURE * conductance * high * psi
    return flow if p1 >= p2 else -flow


def tube_resistance(length: float, bore: float) -> float:
    """Laminar resistance 128 μ L / (π d⁴) of a tube in Pa·s/m³ (Hagen-Poiseuille)."""
    return 128.0 * AIR_VISCOSITY * length / (math.pi * bore**4)


def tube_flow(p1: float, p2: float, resistance: float) -> float:
    """Air flow RTṁ in W through a tube: the volume flow (p1 − p2)/R at the mean pressure."""
    return 0.5 * (p1 + p2) * (p1 - p2) / resistance


def pump_flow(gauge: float, duty: float, free_flow: float, stall: float, atmosphere: float) -> float:
    """Air flow RTṁ in W that the pump brings against `gauge` Pa, out of an `atmosphere` of so many Pa.

    Free air: `free_flow` m³/s against nothing, falling linearly to none at `stall` Pa gauge. Its check valve
    lets nothing back.
    """
    return atmosphere * free_flow * duty * max(0.0, 1.0 - gauge / stall)


def valve_window(
    energised: bool, is_open: bool, since: float, on: float, dt: float, opening: float, closing: float
) -> tuple[float, float, bool, bool, float]:
    """When a valve is open within an interval of `dt` whose first `on` seconds its coil is energised.

    A coil energised at t opens the valve at t + `opening`, if it is still energised then; de-energised at t
    it closes the valve at t + `closing`, if it is still de-energised then. `energised`, `is_open` and `since`
    (seconds since the coil last changed) are the state. Returns (start, stop, and the state after `dt`);
    the coil changes at most once after the start, so the valve is open from `start` to `stop` only.
    """
    start = stop = 0.0
    on = min(max(on, 0.0), dt)
    if on > 0.0:
        if not energised:
            energised, since = True, 0.0
        if not is_open:
            start = max(0.0, opening - since)
            is_open = start < on
        since += on
        if is_open:
            stop = on
        else:
            start = 0.0
    if on < dt:
        if energised:
            energised, since = False, 0.0
        if is_open:
            closes = on + max(0.0, closing - since)
            stop = min(closes, dt)
            is_open = closes > dt
        since += dt - on
    return start, stop, energised, is_open, since


def open_fraction(start: float, stop: float, t: float, h: float) -> float:
    """Share of the substep from `t` to `t + h` during which a valve open from `start` to `stop` is open."""
    return max(0.0, min(stop, t + h) - max(start, t)) / h


def sensor_counts(gauge: float, noise: float, pa_per_count: float) -> int:
    """What a 12-bit converter makes of `gauge` Pa plus `noise` Pa, in counts."""
    return min(max(round((gauge + noise) / pa_per_count + ZERO_COUNT), 0), FULL_SCALE)
