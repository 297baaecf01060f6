"""The file of a calibration: the same again, and every file that is none of it is refused in a sentence."""

import contextlib
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bubbleskin as bs
from bubbleskin.calibrate import archive
from bubbleskin.calibrate.measure import Measured

pytestmark = pytest.mark.medium  # for the calibration that they share


@pytest.fixture(scope="session")
def path(done, tmp_path_factory):
    path = tmp_path_factory.mktemp("calibration") / "sheet.json"
    done.calibration.save(path)
    return path


@pytest.fixture(scope="session")
def small(done, tmp_path_factory):
    """The tree of a file with one short trace."""
    c = done.calibration
    first = c.measured.traces[0]
    cut = {name: getattr(first, name)[:30] for name in ("pressure_pa", "fill_us", "vent_us", "supply_pa")}
    trace = type(first)(**vars(first) | cut)
    measured = Measured((trace,), c.measured.zero_pa, c.measured.device_s)
    return json.loads(
        archive.text(c.board, c.nominal, c.atmosphere_kpa, c.zero_counts, measured, {2: (1.01, 0.004)}, [])
    )


def test_raw_data_comes_back(done, path):
    read = archive.read(path)
    assert read.board == "wristband7"
    assert read.nominal == done.calibration.nominal
    assert read.zero_counts == done.calibration.zero_counts
    for trace, before in zip(read.measured.traces, done.calibration.measured.traces, strict=True):
        assert trace.bubbles == before.bubbles
        assert trace.fitted_from == before.fitted_from
        assert trace.pressure_pa == pytest.approx(before.pressure_pa, abs=0.51)
        assert trace.fill_us == pytest.approx(before.fill_us, abs=0.51)


@pytest.mark.slow
def test_a_file_is_fitted_again(done, path):
    again = bs.SelfCalibration.load(path)
    assert again.accepted == done.calibration.accepted
    for one, before in zip(again.bubbles, done.calibration.bubbles, strict=True):
        # Pressures that were interpolated are rounded in the file, and zeros to a thousandth.
        assert (np.abs(one.estimate.values - before.estimate.values) < 0.1 * before.estimate.sd).all()


def test_people_can_read_what_was_found(path):
    found = json.loads(path.read_text(encoding="utf-8"))["found"]
    assert found[2]["parameters"]["line_mm3"]["unit"] == "mm³"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("bubbleskin_calibration", 2, "none of this version"),
        ("board", 3, "board"),
        ("atmosphere_kpa", 3.0, "atmosphere_kpa"),
        ("zero_counts", [1.5] * 7, "zero_counts"),
        ("zero_pa", [0.0], "shape"),
        ("nominal", {}, "nominal"),
        ("traces", [3], "a trace"),
        ("sizes", {"2": [1.0]}, "sizes"),
        ("sizes", {"9": [1.0, 0.01]}, "names the bubble"),
        ("device_s", "long", "device_s"),
    ],
)
def test_a_wrong_value_is_named(small, tmp_path, name, value, said):
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(small | {name: value}), encoding="utf-8")
    with pytest.raises(bs.InvalidInput, match=said):
        archive.read(path)


@pytest.mark.parametrize("name", ["board", "nominal", "traces", "zero_pa"])
def test_what_is_missing_is_named(small, tmp_path, name):
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps({key: value for key, value in small.items() if key != name}), encoding="utf-8")
    with pytest.raises(bs.InvalidInput, match=f"has no {name}"):
        archive.read(path)


def test_a_bubble_stands_in_one_trace(small, tmp_path):
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(small | {"traces": small["traces"] * 2}), encoding="utf-8")
    with pytest.raises(bs.InvalidInput, match="stands in two traces"):
        archive.read(path)


_ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.just([]),
    st.just({}),
    st.just([[1, 2], [3]]),
)


@given(st.data())
def test_no_file_is_a_traceback(small, tmp_path_factory, data):
    tree = json.loads(json.dumps(small))
    place = tree
    while True:
        key = data.draw(st.sampled_from(sorted(place)) if isinstance(place, dict) else st.integers(0, len(place) - 1))
        deeper = place[key]
        if not (isinstance(deeper, dict | list) and deeper and data.draw(st.booleans())):
            break
        place = deeper
    place[key] = data.draw(_ODD)
    path = tmp_path_factory.getbasetemp() / "fuzzed.json"
    path.write_text(json.dumps(tree, allow_nan=False) if _plain(place[key]) else "{", encoding="utf-8")
    with contextlib.suppress(bs.InvalidInput):
        bs.SelfCalibration.load(path)


def _plain(value):
    return not isinstance(value, float) or value - value == 0.0


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_half_a_file_is_refused(path, tmp_path, share):
    half = tmp_path / "half.json"
    text = path.read_text(encoding="utf-8")
    half.write_text(text[: int(share * len(text))], encoding="utf-8")
    with pytest.raises(bs.InvalidInput):
        bs.SelfCalibration.load(half)
