"""`bubbleskin calibrate` as its user meets it."""

import json
from functools import partial

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.calibrate import archive
from bubbleskin.calibrate.measure import Measured

pytestmark = pytest.mark.medium  # for the calibration that they share

URL = "sim://wristband7?spread=0.1&rubber=real&contact=0&seed=3"


@pytest.fixture
def run(command):
    """Run the verb; returns exit status, standard output and standard error."""
    return partial(command, "calibrate")


@pytest.fixture(scope="session")
def of_one(done, tmp_path_factory):
    """The file of bubble 0 alone, which is fitted quickly, and its path."""
    path = tmp_path_factory.mktemp("verb") / "one.json"
    c = done.calibration
    measured = Measured(c.measured.traces[:1], c.measured.zero_pa, c.measured.device_s)
    text = archive.text(c.board, c.nominal, c.atmosphere_kpa, c.zero_counts, measured, {}, [])
    path.write_text(text, encoding="utf-8")
    return path


def test_a_bubble_is_measured_and_written(run, tmp_path):
    output, picture = tmp_path / "two.json", tmp_path / "two.png"
    code, out, err = run("--bubbles", 2, "--no-save", "--device", URL, "-o", output, "--picture", picture)
    assert code == 0
    assert out.startswith("wristband7: 1 of 1 bubbles accepted")
    assert err.splitlines() == [f"wrote {output}", f"wrote {picture}"]
    assert bs.SelfCalibration.load(output).accepted == (2,)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_file_is_fitted_for_a_script(run, of_one):
    code, out, err = run("--load", of_one, "--json")
    assert code == 0
    assert not err
    (found,) = json.loads(out)["bubbles"]
    assert found["verdict"] == "accepted"
    assert found["parameters"]["vent_flow"]["sd"] < 0.1


def test_one_that_is_not_accepted_is_status_1(run, of_one, tmp_path):
    path = tmp_path / "faulted.json"
    tree = json.loads(of_one.read_text(encoding="utf-8"))
    tree["traces"][0]["faults"] = {"0": ["valve_stuck"]}
    path.write_text(json.dumps(tree), encoding="utf-8")
    code, out, _ = run("--load", path)
    assert code == 1
    assert "bubble 0: redo" in out
    assert "faulted: It reported valve_stuck" in out


def test_heights_refine_a_file_and_go_up(run, of_one, tmp_path):
    heights, better = tmp_path / "heights.csv", tmp_path / "better.json"
    heights.write_text("bubble,told [mm],measured [mm]\n0,11.0,11.22\n", encoding="utf-8")
    code, _, _ = run("--load", of_one, "--heights", heights, "--upload", "--device", "sim://wristband7", "-o", better)
    assert code == 0
    one, other = (bs.SelfCalibration.load(path)[0].estimate.curve(np.array([11.0])) for path in (of_one, better))
    assert other < one  # it is larger than was thought, so this pressure is that of a greater height
    assert json.loads(better.read_text(encoding="utf-8"))["sizes"]["0"][0] == pytest.approx(1.02)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("bubble,told,measured\n0,11,11\n", "first row must be"),
        ("bubble,told [mm],measured [mm]\n", "no heights"),
        ("bubble,told [mm],measured [mm]\n0,11\n", "line 2"),
        ("bubble,told [mm],measured [mm]\n0.5,11,11\n", "count from 0"),
        ("bubble,told [mm],measured [mm]\n0,high,11\n", "not a number"),
        ("bubble,told [mm],measured [mm]\n3,11,11\n", "Bubble 3 was not calibrated"),
    ],
)
def test_a_table_that_is_none(run, of_one, tmp_path, text, said):
    heights = tmp_path / "heights.csv"
    heights.write_text(text, encoding="utf-8")
    code, out, err = run("--load", of_one, "--heights", heights)
    assert (code, out) == (2, "")
    assert said in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--load", "nowhere.json"], "Cannot read the calibration"),
        (["--load", "x.json", "--bubbles", "2"], "leave --bubbles out"),
        (["--upload"], "go with --load"),
        (["--bubbles", "7", "--device", "sim://wristband7"], "bubbles is 7"),
        (["--board", "nowhere.py", "--device", "sim://wristband7"], "nowhere.py"),
    ],
)
def test_a_mistake_is_one_sentence(run, arguments, said):
    code, out, err = run(*arguments)
    assert code == 2
    assert not out
    assert said in err
    assert err.count("\n") == 1
