"""The parts of the model, each against something that was derived apart from it."""

import numpy as np
import pytest

from bubbleskin import boards
from bubbleskin.calibrate import rubber, yardstick
from bubbleskin.calibrate.metering import Line, meter
from bubbleskin.calibrate.nominal import Nominal, height_mm, sphere_mm3
from bubbleskin.calibrate.rubber import Wall
from bubbleskin.membrane import YeohBalloon

NOMINAL = Nominal.of(boards.load("wristband7"))
ATMOSPHERE = 101_325.0


def wall(**changed):
    return Wall(39.62e3, 417.3, 60.65, 2.5, 0.0, 0.0, 0.0)._replace(**changed)


def test_rubber_without_a_memory_is_the_membranes():
    heights = np.linspace(5.2, 14.0, 50)
    expected = YeohBalloon().pressure_at_height(heights * 1e-3)
    assert rubber.relaxed(heights, 0.0, wall()) == pytest.approx(expected, rel=1e-9)


def test_rubber_softens_below_where_it_has_been():
    heights = np.array([7.0, 10.0, 13.0])
    share = rubber.relaxed(heights, 13.0, wall(softening=0.1)) / rubber.relaxed(heights, 0.0, wall())
    assert share[2] == pytest.approx(1.0)
    assert (np.diff(share) > 0).all()
    assert share[0] == pytest.approx(0.9, abs=0.002)


def test_rubber_forgets_by_its_time():
    stretch = np.concatenate([np.ones(10), np.full(2000, 2.0)])
    pressure = rubber.history(stretch, 0.005, wall(slow=0.05))
    last = rubber.history(np.full(4, 2.0), 0.005, wall())[0]
    assert pressure[10] / last == pytest.approx(1.05, abs=0.001)
    assert pressure[10 + 600] / last == pytest.approx(1.0 + 0.05 / np.e, abs=0.001)


def test_gain_is_that_of_iso_6358():
    # C in m³/(s Pa) times 1e5 Pa times the root, in W: choked at b = 1/2 it is C 1e5 p1.
    p1 = 160e3
    choked = NOMINAL.gain * np.sqrt((p1 - p1 / 2) * (p1 / 2))
    assert choked == pytest.approx(3.8e-11 * 1e5 * p1 * 1e3, rel=1e-6)


def line(fill_us, vent_us, pressure):
    shape = np.zeros(len(fill_us))
    return Line(5.0, shape + pressure, shape + 60e3, np.array(fill_us, float), np.array(vent_us, float), ATMOSPHERE)


def test_air_is_flow_times_open_time():
    fill, vent, lift = meter(line([0, 0, 5000, 5000, 2000, 0, 0, 0, 0, 0], [0] * 10, 20e3), NOMINAL)
    assert lift == 0.0 or vent.air[-1] == 0.0
    rate = NOMINAL.gain * np.sqrt((60e3 - 20e3) * (20e3 + ATMOSPHERE))
    assert fill.air[-1] == pytest.approx(rate * (12.0 - 1.2 + 1.0), rel=0.02)
    assert fill.late[-1] == pytest.approx(rate, rel=0.05)  # one pulse
    assert fill.air[3] == 0.0  # what telemetry says comes one period later
    assert fill.air[4] > 0.0


def test_each_pulse_loses_what_a_late_valve_takes():
    two, _, _ = meter(line([2000, 0, 2000, 0, 0, 0, 0], [0] * 7, 20e3), NOMINAL)
    one, _, _ = meter(line([2000, 0, 0, 0, 0, 0, 0], [0] * 7, 20e3), NOMINAL)
    assert two.late[-1] == pytest.approx(2 * one.late[-1])
    assert two.air[-1] == pytest.approx(2 * one.air[-1])


def test_heights_and_volumes():
    heights = np.array([5.0, 9.0, 14.0])
    assert height_mm(sphere_mm3(heights)) == pytest.approx(heights)


def test_flows_are_compared_by_the_reservoir():
    rng = np.random.default_rng(1)
    factors = np.array([1.08, 0.93, 1.0])
    draws = []
    for group in ((0, 1), (2,)):
        taken = {bubble: np.where(rng.random(1200) < 0.08, rng.uniform(200, 2500, 1200), 0.0) for bubble in group}
        pressure = np.empty(1200)
        filtered = np.empty(1200)
        air = heat = 0.0
        now = low = worked = 60.4e3
        worked = 0.0
        for k in range(1200):
            now = 60.4e3 + air + heat
            pressure[k] = now + rng.normal(0.0, 50.0)
            low += (pressure[k] - low) / 4
            filtered[k] = low
            flow = worked - sum(factors[b] * taken[b][k] for b in group) / 50.0
            air += flow
            heat = heat * np.exp(-0.005) + 0.4 * flow
            worked = 0.12 * max(60.5e3 - low, 0.0)
        draws.append(yardstick.Draw(0.005, pressure, filtered, taken))
    found = yardstick.compare(draws)
    shares = found.value / factors
    sd = np.sqrt(np.diag(found.covariance)) / found.value
    assert found.bubbles == (0, 1, 2)
    assert (np.abs(shares / shares.mean() - 1.0) < 4.0 * sd).all()
    assert sd.max() < 0.03
