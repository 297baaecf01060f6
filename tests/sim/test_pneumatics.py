import math

import numpy as np
import pytest

from bubbleskin.membrane.balloon import ATMOSPHERE
from bubbleskin.sim import pneumatics as pn

LINE = 160e3  # absolute, about the supply


def psi(p2, p1=LINE, b=0.5):
    return pn.orifice_flow(p1, p2, pn.RESTRICTOR, b) / (100e3 * pn.RESTRICTOR * p1)


def test_a_choked_orifice_passes_what_its_sonic_conductance_says():
    # 1 dm³/(s·bar) at 2 bar upstream is 2 dm³/s of air at 1 bar: 200 W of RTṁ.
    assert pn.orifice_flow(200e3, 50e3, 1.0 * pn.DM3_PER_S_BAR, 0.5) == pytest.approx(200.0)
    assert psi(0.5 * LINE) == psi(0.1 * LINE) == 1.0


def test_subsonic_orifice_flow_is_the_ellipse_of_iso_6358():
    for ratio in (0.5, 0.6, 0.75, 0.9, 0.99):
        y = psi(ratio * LINE)
        assert y**2 + ((ratio - 0.5) / 0.5) ** 2 == pytest.approx(1.0)


def test_orifice_flow_has_a_sign_and_no_jumps():
    p2 = np.linspace(0.3, 3.0, 20_001) * LINE
    flow = np.array([pn.orifice_flow(LINE, p, pn.RESTRICTOR, 0.5) for p in p2])
    assert np.all(np.diff(flow) <= 0)
    assert pn.orifice_flow(LINE, LINE, pn.RESTRICTOR, 0.5) == 0.0
    assert pn.orifice_flow(ATMOSPHERE, LINE, pn.RESTRICTOR, 0.5) == -pn.orifice_flow(
        LINE, ATMOSPHERE, pn.RESTRICTOR, 0.5
    )
    for joint in (0.5, pn.LAMINAR_RATIO):
        assert psi((joint - 1e-12) * LINE) == pytest.approx(psi((joint + 1e-12) * LINE), rel=1e-9)
    # The steepest part is the straight one about p1 = p2, and it is finite.
    steepest = 100e3 * pn.RESTRICTOR * LINE * math.sqrt(1 - 0.99**2) / 0.005 / LINE
    assert np.abs(np.diff(flow) / np.diff(p2)).max() == pytest.approx(steepest, rel=0.02)


def test_one_metre_of_one_millimetre_bore():
    assert pn.tube_resistance(1.0, 1e-3) == pytest.approx(7.4e8, rel=0.01)
    assert pn.tube_resistance(1.0, 0.5e-3) == pytest.approx(16 * pn.tube_resistance(1.0, 1e-3))


def test_tube_flow_is_the_volume_flow_at_mean_pressure():
    assert pn.tube_flow(130e3, 126e3, 5e8) == pytest.approx(128e3 * (4e3 / 5e8))
    assert pn.tube_flow(126e3, 130e3, 5e8) == -pn.tube_flow(130e3, 126e3, 5e8)


def test_the_pump_falls_linearly_to_its_stall_and_never_sucks():
    free = pn.pump_flow(0.0, 1.0, 5e-5, 120e3, ATMOSPHERE)
    assert free == pytest.approx(101325 * 5e-5)
    assert pn.pump_flow(60e3, 0.5, 5e-5, 120e3, ATMOSPHERE) == pytest.approx(free / 4)
    assert pn.pump_flow(120e3, 1.0, 5e-5, 120e3, ATMOSPHERE) == pn.pump_flow(150e3, 1.0, 5e-5, 120e3, ATMOSPHERE) == 0.0


OPENING, CLOSING = 1.2e-3, 1.0e-3


def windows(intervals, opening=OPENING, closing=CLOSING):
    """The open spans, in absolute seconds, of a valve that rests at first; `intervals` are (dt, on)."""
    state, now, spans = (False, False, 0.0), 0.0, []
    for dt, on in intervals:
        start, stop, *state = pn.valve_window(*state, on, dt, opening, closing)
        assert 0.0 <= start <= dt
        assert 0.0 <= stop <= dt
        if stop > start:
            if spans and now + start == pytest.approx(spans[-1][1], abs=1e-12):
                spans[-1][1] = now + stop
            else:
                spans.append([now + start, now + stop])
        now += dt
    return spans


@pytest.mark.parametrize(
    ("intervals", "spans"),
    [
        ([(5e-3, 0.0)], []),
        ([(5e-3, 1.1e-3)], []),  # shorter than the dead time
        ([(5e-3, 1.2e-3), (5e-3, 0.0)], []),  # not energised any more when it would open
        ([(5e-3, 3e-3)], [[1.2e-3, 4e-3]]),
        ([(5e-3, 4.5e-3), (5e-3, 0.0)], [[1.2e-3, 5.5e-3]]),  # closes in the next interval
        ([(5e-3, 5e-3), (5e-3, 5e-3), (5e-3, 1e-3)], [[1.2e-3, 12e-3]]),  # seamless
        ([(1e-3, 1e-3), (1e-3, 1e-3), (5e-3, 0.0)], [[1.2e-3, 3e-3]]),  # opens in the second
        ([(1e-3, 1e-3), (1e-3, 0.1e-3), (5e-3, 0.0)], []),
        ([(3e-3, 2.5e-3), (5e-3, 1e-3), (5e-3, 0)], [[1.2e-3, 5e-3]]),  # energised again before it closed
        ([(5e-3, 3e-3), (5e-3, 3e-3)], [[1.2e-3, 4e-3], [6.2e-3, 9e-3]]),
        ([(5e-3, 9e-3), (5e-3, -1.0)], [[1.2e-3, 6e-3]]),  # on is held to the interval
    ],
)
def test_when_a_valve_is_open(intervals, spans):
    assert [pytest.approx(span, abs=1e-12) for span in spans] == windows(intervals)


def test_windows_agree_with_a_valve_watched_every_microsecond():
    rng = np.random.default_rng(0)
    opening, closing = 1233, 1071  # never just the length of a pulse, which may go either way
    for _ in range(10):
        dts = rng.integers(1, 60, 12) * 100
        ons = np.minimum(rng.integers(-20, 60, 12).clip(0) * 100 + 7 * (rng.random(12) < 0.5), dts)
        coil = np.concatenate([np.arange(dt) < on for dt, on in zip(dts, ons, strict=True)]).tolist()
        watched, is_open, since = 0, False, 0
        for k, energised in enumerate(coil):
            since = 0 if k and energised != coil[k - 1] else since
            if since == (opening if energised else closing):
                is_open = energised
            watched += is_open
            since += 1
        intervals = [(dt * 1e-6, on * 1e-6) for dt, on in zip(dts, ons, strict=True)]
        spans = windows(intervals, opening * 1e-6, closing * 1e-6)
        assert sum(stop - start for start, stop in spans) == pytest.approx(watched * 1e-6, abs=1e-9)


def test_open_fractions_add_up_to_the_window_on_any_grid():
    for steps in (1, 3, 100):
        h = 5e-3 / steps
        total = sum(h * pn.open_fraction(1.237e-3, 4.011e-3, k * h, h) for k in range(steps))
        assert total == pytest.approx(4.011e-3 - 1.237e-3)


def test_sensor_counts_round_and_clip():
    assert pn.sensor_counts(0.0, 0.0, 17.0) == 160
    assert pn.sensor_counts(20e3, 0.0, 17.0) == 160 + round(20e3 / 17)
    assert pn.sensor_counts(8.0, 0.0, 17.0) == 160
    assert pn.sensor_counts(8.0, 1.0, 17.0) == 161
    assert pn.sensor_counts(-10e3, 0.0, 17.0) == 0
    assert pn.sensor_counts(100e3, 0.0, 17.0) == 4095
