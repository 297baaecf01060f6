"""The supply: kept within its limits by the plant's truth, whatever its sensor says; lost, it is named and everything vents."""

import pytest

from bubble_firmware.control.supply import DIP_US, PATIENCE_US, PUMP_MAX_US
from bubble_protocol.schema import errors, faults


def low(rig, pascals=20000):
    rig.hal.counts[-1] = rig.board.SUPPLY_ZERO + pascals // rig.board.SUPPLY_PA_PER_COUNT


def full(rig):
    low(rig, rig.board.SUPPLY_PA)


def ticks_until_lost(rig, most, rises=0):
    """Ticks, with a host that lives, until the board vents by itself; its sensor `rises` by so many Pa in every second."""
    at = rig.hal.counts[-1]
    for tick in range(most):
        if rig.app.faults.board & faults.SUPPLY_LOST:
            return tick
        rig.hal.counts[-1] = at + int(seconds(rig, tick) * rises / rig.board.SUPPLY_PA_PER_COUNT)
        rig.tick()
    raise AssertionError("never lost")


def seconds(rig, ticks):
    return ticks * rig.board.TICK_US * 1e-6


@pytest.mark.promise("supply-lost")
def test_a_supply_that_is_lost_vents_everything_within_the_tick(rig):
    rig.tick(5)
    rig.show(9000)
    rig.tick(3)
    rig.supply(20000)
    assert seconds(rig, ticks_until_lost(rig, 2000, rises=4000)) == pytest.approx(DIP_US * 1e-6, abs=0.1)
    assert rig.hal.safe or all(rig.pulse(bubble) == (0, rig.board.TICK_US) for bubble in range(rig.board.BUBBLES))
    assert rig.ask("INFO")["board_faults"] & faults.SUPPLY_LOST
    error, *_ = rig.refused("SHOW", (0,), [(9000,)] * rig.board.BUBBLES)
    assert error == errors.BOARD_FAULT


@pytest.mark.promise("supply-lost")
def test_while_the_supply_is_lost_the_pump_stands_and_the_reservoir_is_emptied(rig):
    rig.tick(5)
    rig.hal.counts[-1] = 9
    ticks_until_lost(rig, 100)
    for _ in range(600):
        assert (rig.hal.pump, rig.hal.dump) == (0, 1)
        rig.tick()
    full(rig)
    rig.tick(40)
    assert (rig.hal.pump, rig.hal.dump) == (0, 1), "a sensor that is well again changes nothing"
    rig.clear()
    rig.tick(20)
    assert not rig.app.faults.board
    assert not rig.hal.dump


def test_a_dip_is_no_loss(rig):
    rig.tick(5)
    for _ in range(5):
        rig.supply(20000)
        for tick in range(900000 // rig.board.TICK_US):
            low(rig, 20000 + 10 * tick * rig.board.TICK_US // 1000)
            rig.tick()
        for pascals in range(29000, 61000, 4000):
            low(rig, pascals)
            rig.tick()
    assert not rig.app.faults.board & faults.SUPPLY_LOST


def test_an_empty_reservoir_has_time_to_fill_at_boot_and_after_clear(rig):
    low(rig, 0)
    assert seconds(rig, ticks_until_lost(rig, 4000, rises=4000)) == pytest.approx(PATIENCE_US * 1e-6, abs=0.1)
    rig.clear()
    assert not rig.app.faults.board & faults.SUPPLY_LOST
    assert seconds(rig, ticks_until_lost(rig, 4000, rises=4000)) == pytest.approx(PATIENCE_US * 1e-6, abs=0.1)


WRONG = [
    pytest.param(lambda rig, tick: 0, 4, id="at the end of its range"),
    pytest.param(lambda rig, tick: 4095, 4, id="at the other end"),
    pytest.param(lambda rig, tick: rig.hal.counts[-1] if tick else 2560 - 800, 4, id="a leap down"),
    pytest.param(lambda rig, tick: rig.hal.counts[-1] if tick else 2560 + 400, 4, id="a leap up"),
]


@pytest.mark.promise("supply-lost")
@pytest.mark.parametrize(("count", "most"), WRONG)
def test_what_the_supply_sensor_cannot_say_is_not_believed(rig, count, most):
    rig.tick(5)
    for tick in range(most):
        assert not rig.app.faults.board
        rig.hal.counts[-1] = count(rig, tick)
        rig.tick()
    assert rig.app.faults.board == faults.SUPPLY_LOST


def test_a_few_wrong_readings_are_noise(rig):
    rig.tick(5)
    for count in (0, 4095, 1500, 3500):
        for _ in range(3):
            rig.hal.counts[-1] = count
            rig.tick()
            assert rig.hal.pump == 0
        full(rig)
        rig.tick(3)
    assert not rig.app.faults.board


def test_a_supply_sensor_that_repeats_itself_is_not_believed(rig):
    rig.tick(5)
    rig.hal.noisy = False
    rig.tick(2)
    assert rig.board.FROZEN_US - ticks_until_lost(rig, 1000) * rig.board.TICK_US in range(10 * rig.board.TICK_US)


@pytest.mark.promise("supply-lost")
def test_a_pump_whose_work_does_not_show_is_stopped(rig):
    rig.tick(5)
    rig.supply(50000)
    assert 0.4 < seconds(rig, ticks_until_lost(rig, 1000)) < 0.7
    assert rig.hal.pump == 0


def test_a_pump_may_not_work_at_its_utmost_for_ever(rig7):
    """Its work shows, yet the reservoir gets no further: up and down, between what is needed and what is wanted."""
    rig7.tick(5)
    rig7.supply(50000)
    ticks = 0
    while not rig7.app.faults.board:
        low(rig7, 50000 + 100 * abs(ticks % 60 - 30))
        rig7.tick()
        ticks += 1
    assert seconds(rig7, ticks) == pytest.approx(PUMP_MAX_US * 1e-6, abs=0.5)
    assert (rig7.app.faults.board, rig7.hal.pump) == (faults.SUPPLY_LOST, 0)


# By the plant's truth.

RELIEF_MARGIN = 1000.0  # Pa, above what the relief valve opens at
LIES = [
    ("supply_stuck", 2160.0),  # 50 kPa
    ("supply_stuck", 2560.0),  # 60 kPa
    ("supply_stuck", 9.0),  # just inside its range
    ("supply_stuck", 4086.0),
    ("supply_absent", 1.0),
    ("supply_bias", -20e3),
    ("supply_bias", -8e3),
]
SUBTLE = [("supply_bias", -5e3), ("supply_flat", 50e3), ("supply_flat", 59e3), ("supply_flat", 60e3)]


def lied_to(attack, fault, value, pace, relief):
    attacked = attack(pace, (9000, 14000))
    attacked.board.inject("relief_stuck", 0, 0.0 if relief else 1.0)
    attacked.run(0.7)
    attacked.board.inject(fault, 0, value)
    attacked.run(5.0)
    return attacked


@pytest.mark.promise("reservoir-limit")
@pytest.mark.medium
@pytest.mark.parametrize("pace", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(("fault", "value"), LIES)
def test_a_supply_sensor_that_lies_moves_no_pressure_beyond_the_dump_limit(attack, fault, value, pace, record_property):
    attacked = lied_to(attack, fault, value, pace, relief=False)
    limits = attacked.board.data
    record_property("true pressure of the reservoir, kPa (at most 75)", attacked.supply_pa / 1e3)
    assert attacked.supply_pa <= limits.SUPPLY_MAX_PA
    assert attacked.pressure_pa.max() <= limits.PRESSURE_MAX_PA
    assert attacked.app.faults.log.newest > 0


@pytest.mark.promise("relief-valve")
@pytest.mark.medium
@pytest.mark.parametrize(("relief", "most"), [(True, 80e3 + RELIEF_MARGIN), (False, 90e3)])
@pytest.mark.parametrize(("fault", "value"), SUBTLE)
def test_a_lie_that_nothing_tells_from_the_truth_is_what_the_relief_valve_is_for(
    attack, fault, value, relief, most, record_property
):
    attacked = lied_to(attack, fault, value, 1.0, relief)
    record_property(
        f"reservoir with{'' if relief else 'out'} relief valve, kPa (at most {most / 1e3:g})", attacked.supply_pa / 1e3
    )
    assert attacked.supply_pa <= most
    assert attacked.pressure_pa.max() <= attacked.board.data.PRESSURE_MAX_PA
