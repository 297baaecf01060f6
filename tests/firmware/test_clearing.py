"""A host that acknowledges faults all the time, at whatever pace, disarms nothing: judged by the plant's truth."""

import pytest

from bubble_protocol.schema import faults, modes

PACES = (0.0, 0.1, 0.3, 1.0)  # s between two CLEARs; 0: one in every tick
SECONDS = 8.0

PRESSURE_MARGIN = 1000.0  # Pa, above the board's limit
HEIGHT_MARGIN = 0.3  # mm


FAILURES = [
    pytest.param("pop_off", 1.0, faults.LEAK, id="leak"),
    pytest.param("vent_stuck", 1.0, faults.LEAK, id="vent open"),
    pytest.param("fill_stuck", -1.0, faults.NO_AIR, id="no_air"),
    pytest.param("fill_stuck", 1.0, faults.VALVE_STUCK, id="valve_stuck, overfilled"),
    pytest.param("vent_stuck", -1.0, faults.VALVE_STUCK, id="vent shut"),
    pytest.param("sensor_stuck", 700.0, faults.SENSOR_STUCK, id="sensor_stuck low"),
    pytest.param("sensor_stuck", 1460.0, faults.SENSOR_STUCK, id="sensor_stuck"),
    pytest.param("sensor_absent", 1.0, faults.SENSOR_LOST, id="sensor_lost"),
]


@pytest.mark.promise("pressure-limit", "height-limit", "clearing-disarms-nothing", "isolation")
@pytest.mark.medium
@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize(("failure", "value", "fault"), FAILURES)
def test_clearing_at_any_pace_keeps_true_pressure_and_height_within_their_limits(
    attack, failure, value, fault, pace, record_property
):
    attacked = attack(pace, (9000, 14000))
    attacked.board.inject(failure, attacked.ILL, value)
    attacked.run(SECONDS)
    limits = attacked.board.data
    record_property("true pressure, kPa (at most 43)", attacked.pressure_pa.max() / 1e3)
    record_property("true height, mm (at most 14.3)", attacked.height_mm.max())
    assert attacked.seen & fault
    assert attacked.pressure_pa.max() <= limits.PRESSURE_MAX_PA + PRESSURE_MARGIN
    assert attacked.height_mm.max() <= limits.HEIGHT_MAX_UM * 1e-3 + HEIGHT_MARGIN
    assert attacked.supply_pa <= limits.SUPPLY_MAX_PA
    assert attacked.app.stats.exceptions == 0


@pytest.mark.promise("budget", "clearing-disarms-nothing")
@pytest.mark.medium
@pytest.mark.parametrize("pace", PACES)
def test_clearing_at_any_pace_leaves_the_budget_what_it_is(attack, pace):
    attacked = attack(pace, (13000,), budget=10)
    attacked.run(SECONDS)
    assert attacked.seen & faults.BUDGET
    assert attacked.most_above_pa_s <= 11000, "its vent takes 0.1 s to bring it below the threshold"


@pytest.mark.promise("stuck-fill-valve")
@pytest.mark.parametrize("pace", PACES)
def test_a_fill_valve_stuck_open_is_overfilled_at_any_pace(attack, pace):
    attacked = attack(pace, (10000,))
    attacked.board.inject("fill_stuck", attacked.ILL, 1.0)
    attacked.run(1.0)
    assert attacked.app.faults.board == faults.OVERFILLED
    assert attacked.app.safety.mode == modes.FAULTED
