"""INJECT: nothing fails on purpose without permission; with it what is asked for, and never so that more air comes in."""

from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.hal.base import ABSENT, Hal
from bubble_firmware.hal.failing import FailingHal
from bubble_protocol.schema import errors
from bubble_protocol.schema.faults import SENSOR_LOST, SENSOR_STUCK, SUPPLY_LOST
from bubble_protocol.schema.messages import INJECT, REPLY

PERMIT, MISSING, STUCK, HIGH, FILL_SHUT, VENT_OPEN, SUPPLY_MISSING, SUPPLY_EMPTY, PUMP_OFF = range(9)


def inject(rig, failure, bubble=0, on=1):
    assert rig.ask("INJECT", (failure, bubble, on)).id == INJECT | REPLY


def faults(rig, bubble):
    return rig.app.bubbles.faults(bubble)


@pytest.mark.promise("failure-on-request")
def test_without_permission_nothing_fails(rig):
    for failure in range(1, 9):
        assert rig.refused("INJECT", (failure, 0, 1)) == (errors.NOT_PERMITTED, 0, 255, failure, 0, 0)
    assert rig.app.hal is rig.hal
    inject(rig, PERMIT, on=0)
    assert rig.app.hal is rig.hal


@pytest.mark.promise("failure-on-request")
def test_it_is_permitted_only_while_all_is_vented(rig):
    rig.show(8000)
    error, field, *_ = rig.refused("INJECT", (PERMIT, 0, 1))
    assert (error, field) == (errors.NOT_VENTED, 0)
    assert rig.app.hal is rig.hal
    rig.ask("VENT")
    inject(rig, PERMIT)
    assert rig.app.hal is not rig.hal


@pytest.mark.promise("failure-on-request")
def test_it_ends_with_the_next_start_and_when_it_is_forbidden(rig):
    inject(rig, PERMIT)
    inject(rig, MISSING, 1)
    rig.tick(40)
    assert faults(rig, 1) & SENSOR_LOST
    inject(rig, PERMIT, on=0)
    assert rig.app.hal is rig.hal
    assert rig.refused("INJECT", (MISSING, 1, 1))[0] == errors.NOT_PERMITTED
    rig.clear()
    assert not faults(rig, 1)
    inject(rig, PERMIT)
    rig.tick(40)
    assert not faults(rig, 1), "what failed before has been mended"
    assert App(rig.board, rig.hal).hal is rig.hal


def test_a_bubble_that_is_not_there_is_refused(rig):
    inject(rig, PERMIT)
    n = rig.board.BUBBLES
    assert rig.refused("INJECT", (MISSING, n, 1)) == (errors.OUT_OF_RANGE, 1, 255, n, 0, n - 1)
    assert rig.refused("INJECT", (9, 0, 1))[0] == errors.OUT_OF_RANGE
    assert rig.refused("INJECT", (MISSING, 0, 2))[0] == errors.OUT_OF_RANGE


@pytest.mark.parametrize(("failure", "found"), [(MISSING, SENSOR_LOST), (STUCK, SENSOR_STUCK)])
def test_a_sensor_that_fails_is_found_and_only_that(rig, failure, found):
    inject(rig, PERMIT)
    last = rig.board.BUBBLES - 1
    inject(rig, failure, last)
    rig.tick(400)
    assert faults(rig, last) & found
    assert not any(faults(rig, bubble) for bubble in range(last))
    inject(rig, failure, last, on=0)
    rig.tick(100)
    rig.clear()
    rig.tick(100)
    assert not faults(rig, last)


def test_a_sensor_that_says_too_much_says_3_kpa_more(rig):
    rig.sense(2, 5000)
    rig.tick(3)
    before = rig.state()["pressure_pa"][2]
    inject(rig, PERMIT)
    inject(rig, HIGH, 2)
    rig.tick(3)
    assert abs(rig.state()["pressure_pa"][2] - before - 3000) <= 2 * rig.board.SENSOR_PA_PER_COUNT


def test_a_reservoir_without_a_sensor_is_lost(rig):
    inject(rig, PERMIT)
    inject(rig, SUPPLY_MISSING)
    rig.tick(400)
    assert rig.app.faults.board & SUPPLY_LOST


def test_valves_that_fail_do_something_else_than_was_decided(rig):
    inject(rig, PERMIT)
    inject(rig, FILL_SHUT, 2)
    inject(rig, VENT_OPEN, 3)
    rig.show(12000)
    opened = 0
    for _ in range(5):
        rig.tick()
        decided, done = rig.app.bubbles.pulses.tolist(), rig.hal.pulses
        opened += decided[4] > 0
        assert (done[4], done[7]) == (0, rig.board.TICK_US)
        assert [*done[:4], *done[8:]] == [*decided[:4], *decided[8:]]
    assert opened, "the firmware goes on from what it has decided"


def test_pump_and_reservoir(rig):
    inject(rig, PERMIT)
    rig.supply(40000)
    rig.tick(3)
    assert rig.hal.pump
    inject(rig, PUMP_OFF)
    rig.tick()
    assert (rig.hal.pump, rig.hal.dump) == (0, 0)
    inject(rig, SUPPLY_EMPTY)
    rig.tick()
    assert (rig.hal.pump, rig.hal.dump) == (0, 1)


class Inner(Hal):
    """What was really sensed and done."""

    def read_sensors(self, counts):
        counts[:] = self.counts

    def write_outputs(self, pulses, pump, dump):
        self.done = (pulses.tolist(), pump, dump)


_counts = st.sampled_from([0, 100, 168, 2000, 4095, ABSENT])


@pytest.mark.promise("failure-on-request")
@given(st.data())
def test_no_failure_lets_more_air_in_or_keeps_any(data):
    board = boards.load(data.draw(st.sampled_from(["wristband7", "wristband19"])))
    n, tick_us = board.BUBBLES, board.TICK_US
    inner = Inner(board)
    failing = FailingHal(board, inner)
    for _ in range(3):
        for failure, bubble, on in data.draw(
            st.lists(st.tuples(st.integers(1, 8), st.integers(0, n - 1), st.sampled_from([1, 1, 0])), max_size=6)
        ):
            failing.fail(failure, bubble, on)
        inner.counts = array("H", data.draw(st.lists(_counts, min_size=n + 1, max_size=n + 1)))
        inner.active_faults = data.draw(st.integers(0, 7))
        read = array("H", [7] * (n + 1))
        failing.read_sensors(read)
        assert failing.active_faults == inner.active_faults
        assert all(count <= 4095 or count == ABSENT for count in read)
        pulses = array("H", data.draw(st.lists(st.integers(0, tick_us), min_size=2 * n, max_size=2 * n)))
        asked = pulses.tolist()
        pump, dump = data.draw(st.tuples(st.integers(0, 65535), st.integers(0, 1)))
        failing.write_outputs(pulses, pump, dump)
        done, pumped, dumped = inner.done
        assert pulses.tolist() == asked
        assert all(is_done <= was for is_done, was in zip(done[::2], asked[::2], strict=True))
        assert all(was <= is_done <= tick_us for is_done, was in zip(done[1::2], asked[1::2], strict=True))
        assert pumped <= pump
        assert dumped >= dump
