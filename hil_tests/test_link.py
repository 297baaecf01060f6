"""The link: who is there, how it is, states one by one and as telemetry, tables there and back."""

import zlib
from itertools import islice, pairwise

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(60)


def crc(tables):
    return zlib.crc32(b"".join(table.to_bytes() for table in tables))


def softer(share):
    """A table for bubbles of `share` of the paper's stiffness."""
    return bs.build_table(bs.YeohBalloon(mu=share * 39.62e3, c2=share * 417.3, c3=share * 60.65))


@pytest.fixture
def kept_tables(skin):
    """The board's tables; put back in the end, because a real board would keep the test's."""
    tables = skin.read_tables()
    yield tables
    skin.upload_tables(tables)


def test_info_says_what_is_there(skin, target):
    info = skin.info
    assert info.bubbles == len(skin.layout)
    assert 0.001 <= info.tick <= 0.02
    assert 0 < info.height_rest_mm < info.height_max_mm
    assert info.pressure_max_kpa > 0
    assert info.protocol[0] <= 2 <= info.protocol[1]
    assert info.same_schema
    assert len(info.firmware.split(".")) == 3
    if "://wristband" in target:
        assert info.board in target
        assert skin.simulated is not None


def test_health_of_a_board_at_rest(skin):
    before = skin.health()
    skin.sleep(0.5)
    health = skin.health()
    assert health.time - before.time == pytest.approx(0.5, abs=0.1)
    assert health.mode == "idle"
    assert health.exceptions == 0
    assert health.frames_bad == before.frames_bad
    assert 1 <= health.frames_good - before.frames_good <= 20, "and what keeps the link alive"
    assert health.late_ticks == before.late_ticks
    assert 55 < health.supply_kpa < 65
    assert skin.faults() == {}


@pytest.mark.long
def test_states_follow_each_other(skin):
    states = [skin.state() for _ in range(100)]
    assert all(0 < later.time - sooner.time < 0.2 for sooner, later in pairwise(states))
    for state in states:
        assert state.height_mm.shape == state.pressure_kpa.shape == state.target_mm.shape == (skin.info.bubbles,)
        assert len(state.status) == len(state.faults) == skin.info.bubbles
        assert state.mode == "idle"
        assert set(state.status) == {"resting"}


@pytest.mark.parametrize("rate_hz", [pytest.param(5, marks=pytest.mark.long), 20, 100])
def test_telemetry_keeps_its_rate_by_the_devices_clock(skin, rate_hz):
    dropped = skin.health().telemetry_dropped
    times = [state.time for state in islice(skin.telemetry(rate_hz), 20)]
    assert np.diff(times) == pytest.approx(1 / rate_hz, abs=1e-6)
    assert skin.health().telemetry_dropped == dropped


@pytest.mark.long
def test_telemetry_and_requests_share_the_link(skin):
    times, asked = [], []
    for number, state in enumerate(skin.telemetry(50)):
        times.append(state.time)
        if number < 20:
            skin.sleep(0.03)  # some telemetry waits while a request has its reply
            asked.append(skin.state().time)
        if number == 5:
            skin.show(np.full(skin.info.bubbles, 10.0), wait=False)
        if number == 60:
            break
    assert np.diff(times) == pytest.approx(0.02, abs=1e-6)
    assert np.diff(asked).min() >= 0.03
    assert state.mode == "active"
    assert state.height_mm == pytest.approx(10, abs=0.3)


@pytest.mark.long
def test_a_second_connection_finds_the_same_device(target, skin):
    first = skin.info
    skin.show(np.full(first.bubbles, 6.0))
    skin.close()
    with pytest.raises(bs.LinkError):
        skin.state()
    with bs.connect(target) as again:
        assert again.info == first
        again.show(np.full(first.bubbles, 6.0))
        assert again.state().height_mm == pytest.approx(6, abs=0.3)
        again.vent()


def test_tables_come_back_as_they_were_sent(skin, kept_tables):
    assert crc(kept_tables) == skin.info.tables_crc == skin.health().tables_crc
    sent = [softer(0.8 + 0.02 * bubble) for bubble in range(skin.info.bubbles)]
    skin.upload_tables(sent)
    read = skin.read_tables()
    assert [table.to_bytes() for table in read] == [table.to_bytes() for table in sent]
    assert skin.health().tables_crc == crc(sent) != crc(kept_tables)


@pytest.mark.promise("air-not-tables")
@pytest.mark.long
def test_a_table_that_is_wrong_does_not_lead_the_height_astray(skin, kept_tables):
    """Air is metered: a bubble takes the pressure that its rubber has at this height, whatever its table says."""
    table = softer(0.93)
    skin.upload_tables(table)
    skin.show(np.full(skin.info.bubbles, 12.0), plan=False)
    skin.sleep(0.5)
    wanted, nominal = table.pressure_at(12000) / 1000, kept_tables[0].pressure_at(12000) / 1000
    assert nominal - wanted > 1.5
    pressure = skin.state().pressure_kpa
    assert (np.abs(pressure - nominal) < np.abs(pressure - wanted)).all()


@pytest.mark.promise("refused-not-applied")
def test_tables_that_end_too_low_are_refused_and_not_used(skin, kept_tables):
    low = bs.build_table(bs.YeohBalloon(), height_mm=(5.0, 10.0))
    with pytest.raises(bs.DeviceRefused, match="greatest height"):
        skin.upload_tables(low)
    assert skin.health().tables_crc == crc(kept_tables)
    assert crc(skin.read_tables()) == crc(kept_tables)


@pytest.mark.promise("no-false-rubber")
def test_a_table_that_is_none_of_rubber_is_refused_before_it_is_sent(skin, kept_tables):
    straight = bs.Table([5000, round(skin.info.height_max_mm * 1000)], [0, 36000])
    with pytest.raises(bs.InvalidInput, match="not one of rubber"):
        skin.upload_tables(straight)
    assert skin.health().tables_crc == crc(kept_tables)


@pytest.mark.promise("uploads-raise-no-limit")
def test_a_table_of_more_air_than_the_board_allows_is_refused_whoever_asks(skin, kept_tables):
    stiff = bs.Table([5000, round(skin.info.height_max_mm * 1000)], [0, round(skin.info.pressure_max_kpa * 1000)])
    with pytest.raises(bs.DeviceRefused, match="greatest height"):
        skin.upload_tables(stiff, anyway=True)
    assert skin.health().tables_crc == crc(kept_tables)
