"""Bubbles of which something is wrong: what is said of each, and that the others are none the worse."""

import numpy as np
import pytest

from bubbleskin import boards
from bubbleskin.calibrate import verdict
from bubbleskin.calibrate.nominal import Nominal
from bubbleskin.calibrate.trace import Trace

pytestmark = pytest.mark.medium  # for the calibration that they share

NOMINAL = Nominal.of(boards.load("wristband7"))
ODD = 3


def said(done, trace_changed=(), lift=7.0, zero=0.0):
    """The verdict on bubble 3 of the sheet, its trace changed."""
    trace = next(trace for trace in done.calibration.measured.traces if ODD in trace.bubbles)
    trace = Trace(**vars(trace) | dict(trace_changed))
    lifts = dict.fromkeys(range(7), 7.0) | {ODD: lift}
    estimates = {each.bubble: each.estimate for each in done.calibration.bubbles}
    return verdict.judge(ODD, trace, lifts, zero, estimates, NOMINAL)


def test_nothing_is_wrong(done):
    assert said(done) == verdict.Verdict("accepted")


@pytest.mark.parametrize(
    ("changed", "name", "then"),
    [
        ({"lost": 3}, "lost telemetry", "redo"),
        ({"faults": {ODD: ("valve_stuck",)}}, "faulted", "redo"),
        ({"faults": {ODD: ("leak",)}}, "leaking", "redo"),
        ({"faults": {ODD: ("overpressure",)}}, "kinked tube", "redo"),
    ],
)
def test_what_a_trace_tells(done, changed, name, then):
    found = said(done, changed)
    assert found.verdict == then
    assert name in found.reasons
    assert found.advice.endswith(".")


def test_what_a_line_and_a_sensor_tell(done):
    assert said(done, lift=20.0).reasons == ("kinked tube",)
    assert said(done, zero=1600.0).reasons == ("sensor zero",)


def test_swapped_sensors(done):
    trace = next(trace for trace in done.calibration.measured.traces if ODD in trace.bubbles)
    pressure = np.where(np.arange(len(trace.bubbles)) == trace.column(ODD), 0.0, trace.pressure_pa)
    found = said(done, {"pressure_pa": pressure, "others_pa": {5: 21e3}})
    assert "swapped" in found.reasons
    assert "bubble 5" in found.advice


def test_a_rubber_that_no_table_is_for(done):
    trace = Trace(**vars(done.calibration.measured.traces[1]) | {"faults": {ODD: ("valve_stuck",)}})
    assert verdict.of_other_rubber(ODD, trace, 2, 7) is None
    found = verdict.of_other_rubber(ODD, trace, 5, 7)
    assert found.reasons == ("other rubber",)
    assert "valve_stuck" in found.advice


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"tube_resistance": {ODD: 16.0}}, "kinked tube"),
        ({"tube_resistance": {ODD: 4.0}}, "kinked tube"),
        ({"fill_conductance": {ODD: 0.6}}, "restrictor"),
        ({"mu": {ODD: 0.5}}, "wrong bubble"),
        ({"leak": 5.3e-8}, "leaking"),
        ({"leak": 1.6e-7}, "leaking"),
    ],
)
def test_a_plant_with_something_wrong(sheets, changed, reason):
    if "leak" in changed:  # what is 0 has no multiple
        parameters = sheets.real(seed=3)
        parameters.leak[ODD] = changed["leak"]
    else:
        parameters = sheets.real(seed=3, **changed)
    with sheets.skin_of(parameters) as skin:
        before = skin.trim().flow_gain[ODD]
        found = skin.calibrate(save=False)
        assert reason in found[ODD].verdict.reasons
        assert found.accepted == (0, 1, 2, 4, 5, 6)
        assert skin.trim().flow_gain[ODD] == before
        if skin.faults():
            skin.clear_faults()
        others = np.delete(sheets.errors_mm(skin), ODD, axis=1)
        assert sheets.rms(others) < 0.15
