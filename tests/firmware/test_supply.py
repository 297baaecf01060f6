"""A supply that is lost: named, and everything vents in the tick in which it is called lost."""

import pytest

from bubble_protocol.schema import errors, faults


def low(rig, pascals=20000):
    rig.hal.counts[-1] = rig.board.SUPPLY_ZERO + pascals // rig.board.SUPPLY_PA_PER_COUNT


def full(rig):
    low(rig, rig.board.SUPPLY_PA)


def ticks_until_lost(rig, most):
    """Ticks, a living host's PING every few of them, until the board vents by itself."""
    for tick in range(most):
        if rig.app.faults.board & faults.SUPPLY_LOST:
            return tick
        if tick % 5:
            rig.tick()
        else:
            rig.ask("PING", (1,))
    raise AssertionError("never lost")


def seconds(rig, ticks):
    return ticks * rig.board.TICK_US * 1e-6


def test_a_supply_that_is_lost_vents_everything_within_the_tick(rig):
    rig.tick(5)
    rig.show(9000)
    rig.tick(3)
    low(rig)
    assert seconds(rig, ticks_until_lost(rig, 2000)) == pytest.approx(2.0, abs=0.1)
    assert rig.hal.safe or all(rig.pulse(bubble) == (0, rig.board.TICK_US) for bubble in range(rig.board.BUBBLES))
    assert rig.ask("INFO")["board_faults"] & faults.SUPPLY_LOST
    error, *_ = rig.refused("SHOW", (0,), [(9000,)] * rig.board.BUBBLES)
    assert error == errors.BOARD_FAULT


def test_a_dip_is_no_loss(rig):
    rig.tick(5)
    for _ in range(5):
        low(rig)
        rig.tick(900000 // rig.board.TICK_US)
        full(rig)
        rig.tick(10)
    assert not rig.app.faults.board & faults.SUPPLY_LOST


def test_an_empty_reservoir_has_time_to_fill_at_boot_and_after_clear(rig):
    low(rig, 0)
    assert seconds(rig, ticks_until_lost(rig, 4000)) == pytest.approx(5.0, abs=0.1)
    rig.clear()
    assert not rig.app.faults.board & faults.SUPPLY_LOST
    assert seconds(rig, ticks_until_lost(rig, 4000)) == pytest.approx(5.0, abs=0.1)


def test_a_supply_sensor_that_is_gone_is_a_supply_that_is_lost(rig):
    rig.tick(5)
    rig.hal.counts[-1] = 0
    assert seconds(rig, ticks_until_lost(rig, 2000)) == pytest.approx(2.0, abs=0.1)
