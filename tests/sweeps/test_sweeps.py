"""A sweep: every wristband once, the same rows however it is run, and none lost where it is stopped."""

import json
import sys
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from pathlib import Path

import pandas as pd
import pytest

import bubbleskin as bs
from bubbleskin.sweeps.study import Study

HERE = Path(__file__).parent
RISE = {"task": "tasks:rise", "seeds": 2, "plant": {"contact": 0, "spread": [0.0, 0.1]}, "name": "rise"}


@pytest.fixture(autouse=True)
def _tasks(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("PYTHONPATH", str(HERE), prepend=":")
    yield
    sys.modules.pop("tasks", None)


class Here(Executor):
    """An executor that runs everything at once, in this process."""

    def submit(self, work, /, *args, **kwargs):
        future = Future()
        future.set_result(work(*args, **kwargs))
        return future


def test_every_combination_is_there_with_every_seed():
    points = Study.of(RISE).points()
    assert [point.varied for point in points] == [
        {"spread": 0.0, "seed": 0},
        {"spread": 0.0, "seed": 1},
        {"spread": 0.1, "seed": 0},
        {"spread": 0.1, "seed": 1},
    ]
    assert points[3].url == "sim://wristband7?contact=0&spread=0.1&seed=1"


@pytest.mark.medium
def test_rows_are_of_the_wristbands_asked_for():
    rows = bs.sweep(RISE, Here())
    assert [row["point"] for row in rows] == [0, 1, 2, 3]
    assert all(row["error"] == "" for row in rows)
    assert rows[0]["height_mm"] == pytest.approx(8.0, abs=0.1)
    assert rows[0]["drawn"] == rows[2]["drawn"] != rows[1]["drawn"], "the same seed draws the same"
    assert rows[2]["height_mm"] != rows[3]["height_mm"]


@pytest.mark.slow
def test_processes_give_the_same_rows():
    with ProcessPoolExecutor(2) as two:
        assert bs.sweep(RISE, two) == bs.sweep(RISE, Here())


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_dask_cluster_gives_the_same_rows():
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, protocol="tcp") as cluster,
        Client(cluster) as client,
    ):
        assert bs.sweep(RISE, client.get_executor()) == bs.sweep(RISE, Here())


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_one_that_is_stopped_goes_on_where_it_was(tmp_path, suffix):
    study = RISE | {"task": "tasks:fails", "seeds": 40, "plant": {}}
    path = tmp_path / f"rows{suffix}"
    whole = bs.sweep(study, Here())

    def stop(done, all_):
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bs.sweep(study, Here(), out=path, progress=stop)
    partial = path.with_suffix(".partial.jsonl")
    kept = partial.read_text(encoding="utf-8")
    assert len(kept.splitlines()) == 2, "the study and a row"
    partial.write_text(kept + '{"point": 1, "se', encoding="utf-8")  # killed in the middle of a line
    told = []
    assert bs.sweep(study, Here(), out=path, progress=lambda done, all_: told.append((done, all_))) == whole
    assert told[0] == (1, 40)
    assert told[-1] == (40, 40)
    assert not partial.exists()
    read = pd.read_csv(path) if suffix == ".csv" else pd.read_parquet(path)
    assert len(read) == 40
    assert set(read["error"].fillna("")) == {"", "This one does not want to."}


def test_rows_of_another_study_are_not_taken_for_its_own(tmp_path):
    (tmp_path / "rows.partial.jsonl").write_text(json.dumps({"study": "another"}) + "\n", encoding="utf-8")
    with pytest.raises(bs.InvalidInput, match="rows of another study"):
        bs.sweep(RISE, Here(), out=tmp_path / "rows.csv")


@pytest.mark.parametrize(
    ("task", "said"),
    [
        ("raises", "ZeroDivisionError: division by zero"),
        ("no_number", "must be a number"),
    ],
)
def test_a_task_that_fails_is_a_row_that_says_so(task, said):
    (row,) = bs.sweep({"task": f"tasks:{task}"}, Here())
    assert said in row["error"]


@pytest.mark.slow
def test_a_worker_that_is_killed_is_a_sentence(tmp_path):
    with ProcessPoolExecutor(1) as one, pytest.raises(bs.BubbleskinError, match="was killed"):
        bs.sweep({"task": "tasks:dies"}, one, out=tmp_path / "rows.csv")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({}, "names no task"),
        ({"task": "fly"}, "There is no task 'fly'; there are reach, step"),
        ({"task": "nowhere:rise"}, "cannot be imported"),
        ({"task": "tasks:fly"}, "has no 'fly'"),
        ({"task": "reach", "tusk": 1}, "'tusk'; known are"),
        ({"task": "reach", "seeds": 0}, "1 to 100000 is allowed"),
        ({"task": "reach", "plant": {"spread": []}}, "no value for spread"),
        ({"task": "reach", "plant": {"seed": [1]}}, "say how many"),
        ({"task": "reach", "plant": 3}, "it is a section"),
        ({"task": "reach", "board": "wristband8"}, "wristband8"),
        ({"task": "reach", "target": "/dev/ttyACM0"}, "sim"),
        ({"task": "reach", "seeds": 100000, "plant": {"spread": [0.01 * k for k in range(11)]}}, "1000000 at most"),
    ],
)
def test_what_is_no_study_is_refused_in_a_sentence(wrong, said):
    with pytest.raises(bs.InvalidInput, match=said):
        bs.sweep(wrong, Here())


def test_an_option_that_no_plant_has_is_a_row_that_says_so():
    (row,) = bs.sweep({"task": "tasks:rise", "plant": {"colour": "red"}}, Here())
    assert "'colour'" in row["error"]


STUDY = 'name = "rise"\ntask = "tasks:rise"\nseeds = 2\n[plant]\ncontact = 0\nspread = [0.0, 0.1]\n'


@pytest.mark.slow
def test_the_command_writes_rows_and_a_picture(command, tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    out, picture = tmp_path / "rows.parquet", tmp_path / "rows.png"
    status, said, err = command("sweep", tmp_path / "study.toml", "-o", out, "--picture", picture, "--workers", 1)
    assert status == 0, err
    assert "4 wristbands" in said
    assert len(pd.read_parquet(out)) == 4
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_command_says_what_is_wrong(command, tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    status, _, err = command("sweep", tmp_path / "no.toml")
    assert (status, err.count("\n")) == (2, 1)
    status, _, err = command("sweep", tmp_path / "study.toml", "-o", "rows.xls")
    assert (status, "end it in .csv or .parquet" in err) == (2, True)
    status, _, err = command("sweep", tmp_path / "study.toml", "--workers", 1, "--scheduler", "tcp://127.0.0.1:1")
    assert (status, "give one of them" in err) == (2, True)
