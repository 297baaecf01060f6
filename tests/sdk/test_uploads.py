"""Tables and trims that cannot be true are refused with a sentence before a byte is sent; `anyway` leaves it to the device."""

import dataclasses

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.membrane.presets import PRESETS, preset


@pytest.fixture
def skin():
    with bs.connect("sim://wristband7?contact=0") as skin:
        yield skin


def scaled(share):
    return bs.build_table(bs.YeohBalloon(mu=share * 39.62e3, c2=share * 417.3, c3=share * 60.65))


def in_use(skin):
    return skin.health().tables_crc


STRAIGHT = bs.Table([5000, 14000], [0, 36000])


@pytest.mark.promise("no-false-rubber")
def test_a_table_that_is_none_of_rubber_is_refused(skin):
    before = in_use(skin)
    with pytest.raises(
        bs.InvalidInput, match=r"bubble 0 is not one of rubber: .* 0\.2\d at 6 mm and 1\.\d\d at .*anyway=True"
    ):
        skin.upload_tables(STRAIGHT)
    with pytest.raises(bs.InvalidInput, match="table of bubble 4 is not one of rubber"):
        skin.upload_tables([scaled(1.0)] * 4 + [STRAIGHT] + [scaled(1.0)] * 2)
    assert in_use(skin) == before
    skin.upload_tables(STRAIGHT, anyway=True)
    assert in_use(skin) != before


@pytest.mark.promise("no-false-rubber")
def test_tables_that_contradict_each_other_are_refused(skin):
    with pytest.raises(bs.InvalidInput, match=r"contradict each other: bubble 6 has .* factor of 1\.5"):
        skin.upload_tables([scaled(1.0)] * 6 + [scaled(0.6)])
    skin.upload_tables([scaled(1.0)] * 6 + [scaled(0.7)])


@pytest.mark.parametrize("name", PRESETS)
def test_tables_of_every_known_material_are_taken(name, skin):
    table = bs.build_table(preset(name))
    skin.upload_tables(table)
    assert skin.read_tables() == [table] * 7


@pytest.mark.promise("uploads-raise-no-limit")
def test_what_the_device_bounds_is_bounded_anyway(skin):
    before = in_use(skin)
    with pytest.raises(bs.DeviceRefused, match="greatest height, where pressure may be"):
        skin.upload_tables(bs.Table([5000, 14000], [0, 42000]), anyway=True)
    assert in_use(skin) == before


@pytest.mark.promise("no-false-rubber")
def test_a_trim_that_contradicts_itself_is_refused(skin):
    trim = skin.trim()
    for share in (0.25, 0.7, 1.4):
        flow = trim.flow_gain.copy()
        flow[3] = round(flow[3] * share)
        with pytest.raises(bs.InvalidInput, match=rf"flow_gain of bubble 3 is {flow[3]} and the middle one is"):
            skin.upload_trim(dataclasses.replace(trim, flow_gain=flow))
    assert np.array_equal(skin.trim().flow_gain, trim.flow_gain)


def test_what_a_trim_leaves_out(skin):
    """The vent valve's figures are the fill valve's then; how well flows and tables are known, and the leak, stay."""
    before = skin.trim()
    told = np.arange(100, 107)
    skin.upload_trim(dataclasses.replace(before, flow_sd=told, leak=told + 5, vent_opens_us=before.opens_us + 40))
    skin.upload_trim(bs.Trim(before.zero, before.opens_us + 7, before.closes_us, before.flow_gain))
    now = skin.trim()
    assert np.array_equal(now.vent_opens_us, before.opens_us + 7)
    assert np.array_equal(now.vent_flow_gain, before.flow_gain)
    assert np.array_equal(now.curve_sd, before.curve_sd)
    assert (now.flow_sd.tolist(), now.leak.tolist()) == (told.tolist(), (told + 5).tolist())


def test_a_flow_that_no_restrictor_has_is_refused_by_the_device(skin):
    trim = skin.trim()
    with pytest.raises(bs.DeviceRefused, match=r"fill_gain .* is allowed"):
        skin.upload_trim(dataclasses.replace(trim, flow_gain=trim.flow_gain // 4))
    flow = trim.flow_gain.copy()
    flow[3] = flow[3] * 4 // 5
    skin.upload_trim(dataclasses.replace(trim, flow_gain=flow))
    assert np.array_equal(skin.trim().flow_gain, flow)
