"""A sheet that differs in everything, calibrated: what it is worth, what the wristband has then, what is said of it."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.calibrate import device, excite
from bubbleskin.calibrate.fit import FILL, NAMES, VENT

pytestmark = pytest.mark.medium  # for the calibration that they share

BOARD = "wristband7"


@pytest.mark.promise("calibrated")
def test_heights_are_true_afterwards(done, sheets):
    assert sheets.rms(done.before_mm) > 0.25
    assert sheets.rms(done.after_mm) < 0.12
    assert np.abs(done.after_mm).max() < 0.3


def test_all_are_accepted_in_time(done):
    assert done.calibration.accepted == tuple(range(7))
    assert done.calibration.device_s <= 20.0
    assert all(each.chi < 2.0 for each in done.calibration.bubbles)


def test_figures_are_the_plants(done):
    plant = done.parameters
    for each in done.calibration.bubbles:
        values, sd = each.estimate.values, each.estimate.sd
        for at, conductance in ((FILL, plant.fill_conductance), (VENT, plant.vent_conductance)):
            true = conductance[each.bubble] / 3.8e-11  # of a critical ratio of 1/2; another makes 3 % more
            assert abs(values[at] - true) < 3.0 * sd[at] + 0.04
        line, line_sd = each.parameters["line_mm3"]
        assert abs(line - 1e9 * (plant.node_volume + plant.tube_volume)[each.bubble]) < 3.0 * line_sd
        leak, leak_sd = each.parameters["leak"]
        assert abs(leak - 1e9 * plant.leak[each.bubble]) < 3.0 * leak_sd
        low, high = each.interval("leak")
        assert (low + high) / 2 == pytest.approx(leak)
        assert high - low == pytest.approx(2 * 1.96 * leak_sd)
    assert set(done.calibration[0].parameters) == set(NAMES)


def test_the_wristband_has_them_and_keeps_them(done):
    for each in done.calibration.bubbles:
        assert done.tables[each.bubble] == each.figures.table
        for name in device.Figures._fields[:-1]:
            assert getattr(done.trim, name)[each.bubble] == getattr(each.figures, name)
    assert done.saved.tables_crc != 0
    assert done.saved.source in ("slot_a", "slot_b")


def test_deviations_are_what_was_found(done):
    assert (done.trim.flow_sd > 0.005 * 65536).all()
    assert (done.trim.flow_sd < 0.05 * 65536).all()
    assert (done.trim.curve_sd > 0.03 * 65536).all()  # rubber with a memory
    assert (done.trim.leak == 0).all()  # none of these leaks, and none is said to


def test_progress_rises_to_the_end(done):
    shares = [each.done for each in done.progress]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert {each.what for each in done.progress} == {"zeros, at rest", "stretching and stepping", "fitting"}
    assert {bubble for each in done.progress[:-1] for bubble in each.bubbles} == set(range(7))
    assert np.diff(shares).max() < 0.1


def test_a_line_for_each(done):
    said = done.calibration.report().splitlines()
    assert len(said) == 8
    assert "7 of 7 bubbles accepted" in said[0]
    assert repr(done.calibration) == f"<SelfCalibration of a {BOARD}: 7 of 7 bubbles accepted>"
    assert "accepted" in repr(done.calibration[3])
    with pytest.raises(KeyError, match="bubble 9 was not measured"):
        done.calibration[9]


def test_one_bubble_is_changed_and_the_others_keep_theirs(sheets):
    with sheets.skin_of(sheets.real(seed=8)) as skin:
        before = skin.trim(), skin.read_tables()
        found = skin.calibrate(2, save=False)
        trim, tables = skin.trim(), skin.read_tables()
        assert found.accepted == (2,)
        assert found.device_s <= 8.0
        others = [0, 1, 3, 4, 5, 6]
        assert (trim.flow_gain[others] == before[0].flow_gain[others]).all()
        assert trim.flow_gain[2] != before[0].flow_gain[2]
        assert [table == old for table, old in zip(tables, before[1], strict=True)] == [b != 2 for b in range(7)]
        assert sheets.rms(sheets.errors_mm(skin)[:, 2]) < 0.3


def test_a_shape_that_stood_is_not_taken_for_a_sensors_zero(sheets):
    with sheets.skin_of(sheets.real(seed=8)) as skin:
        skin.show([12.0] * 7)
        found = skin.calibrate(2, save=False)
        assert found[2].verdict.verdict == "accepted", found[2].verdict
        assert abs(found.measured.zero_pa[2]) < 900  # Pa: three times what sensors of a sheet are off


def test_what_is_not_uploaded_changes_nothing_until_a_part_of_it_is(sheets):
    with sheets.skin_of(sheets.real(seed=9)) as skin:
        before, tables = skin.trim().flow_gain, skin.read_tables()
        found = skin.calibrate([1, 3], upload=False)
        assert found.accepted == (1, 3)
        assert (skin.trim().flow_gain == before).all()
        assert skin.read_tables() == tables
        skin.upload_calibration(found.only([3]))
        assert np.flatnonzero(skin.trim().flow_gain != before).tolist() == [3]
        with pytest.raises(KeyError, match="bubble 2 was not measured"):
            found.only([2])


def test_in_a_notebook_which_has_an_event_loop_it_fits_too(sheets):
    async def cell():
        with sheets.skin_of(sheets.real(seed=9)) as skin:
            return skin.calibrate([5], upload=False).accepted

    with ThreadPoolExecutor(1) as pool:  # where a test before has left a loop in this thread
        assert pool.submit(asyncio.run, cell()).result() == (5,)


@pytest.mark.parametrize("wrong", ["[]", "[7]", "'2'", "[1.5]"])
def test_bubbles_that_are_none(wrong):
    with bs.connect(f"sim://{BOARD}") as skin, pytest.raises(bs.InvalidInput, match="bubbles"):
        skin.calibrate(eval(wrong))


def test_progress_is_a_function():
    with bs.connect(f"sim://{BOARD}") as skin, pytest.raises(bs.InvalidInput, match="CalibrationProgress"):
        skin.calibrate(progress=3)


class EnoughError(Exception):
    """Somebody stops it."""


def test_what_ends_it_leaves_the_old_set_and_vents(sheets):
    with sheets.skin_of(sheets.real()) as skin:
        before = skin.trim(), skin.read_tables(), skin.stored()

        def stop(now):
            if now.done > 0.3:
                raise EnoughError

        with pytest.raises(EnoughError):
            skin.calibrate(progress=stop)
        skin.sleep(2.0)
        assert skin.state().pressure_kpa.max() < 1.0
        assert (skin.trim().flow_gain == before[0].flow_gain).all()
        assert skin.read_tables() == before[1]
        assert skin.stored() == before[2]


def test_groups_do_not_touch_and_are_few():
    for rings, count in ((1, 7), (2, 19)):
        layout = bs.Layout.hexagon(rings)
        groups = excite.groups(layout, range(count))
        assert sorted(bubble for group in groups for bubble in group) == list(range(count))
        assert len(groups) == 3
        for group in groups:
            assert not any(other in layout.neighbours[one] for one in group for other in group)


@pytest.mark.parametrize(
    ("groups", "tick", "most"), [(3, 0.005, 20.0), (3, 0.010, 40.0), (1, 0.005, 8.0), (1, 0.010, 14.0)]
)
def test_time_that_it_takes(groups, tick, most):
    assert excite.device_seconds(groups, tick) < most


def test_a_calibration_of_another_board_is_refused(done):
    with (
        bs.connect("sim://wristband19") as skin,
        pytest.raises(bs.InvalidInput, match="is of a wristband7 with 7 bubbles"),
    ):
        skin.upload_calibration(done.calibration)


@pytest.mark.slow
def test_measured_heights_tell_sizes(sheets):
    with sheets.skin_of(sheets.real(seed=6)) as skin:
        found = skin.calibrate(save=False)
        skin.show(np.full(7, 11.0), wait=False)
        skin.sleep(3.0)
        told, true = skin.state().height_mm, skin.simulated.alone_mm
        skin.vent()
        skin.sleep(2.0)
        better = found.refined({bubble: [(told[bubble], true[bubble])] for bubble in range(7)}, sd_mm=0.02)
        skin.upload_calibration(better)
        assert sheets.rms(sheets.errors_mm(skin)) < 0.05
        assert better[3].parameters["fill_flow"][1] < found[3].parameters["fill_flow"][1]


@pytest.mark.parametrize(
    ("heights", "said"),
    [({9: [(8.0, 8.0)]}, "was not calibrated"), ({2: [8.0]}, "pairs"), ({2: [(8.0, 80.0)]}, "times as high")],
)
def test_heights_that_are_none(done, heights, said):
    with pytest.raises(bs.InvalidInput, match=said):
        done.calibration.refined(heights)
