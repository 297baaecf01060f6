"""A sweep: every wristband once, the same rows however it is run, and none lost where it is stopped."""

import json
import signal
import subprocess
import sys
import time
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
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
        ("nothing", "returned None; it returns numbers by their names"),
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
    ("raised", "said"),
    [
        (CancelledError(), "the scheduler does not answer"),
        (ModuleNotFoundError("No module"), "ModuleNotFoundError: No module"),
    ],
)
def test_workers_that_go_are_a_sentence(raised, said):
    class Gone(Executor):
        def submit(self, work, /, *args, **kwargs):
            future = Future()
            future.set_exception(raised)
            return future

    with pytest.raises(bs.BubbleskinError, match=said):
        bs.sweep(RISE, Gone())


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
        ({"task": "reach", "plant": {"colour": "red"}}, r"\[plant\] of the study has the option 'colour'"),
        ({"task": "reach", "plant": {"rubber": ["real", "wood"]}}, "rubber is 'wood'"),
        ({"task": "reach", "options": {"shaps": 2}}, "unexpected keyword argument 'shaps'"),
        ({"task": 3}, "The task of the study is 3"),
        ({"task": "broken:rise"}, "cannot be imported"),
        ({"task": "reach", "target": "/dev/ttyACM0"}, "sim"),
        ({"task": "reach", "seeds": 100000, "plant": {"spread": [0.01 * k for k in range(11)]}}, "1000000 at most"),
    ],
)
def test_what_is_no_study_is_refused_in_a_sentence(wrong, said):
    with pytest.raises(bs.InvalidInput, match=said):
        bs.sweep(wrong, Here())


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


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="who started whom is told by Linux")
@pytest.mark.parametrize("how", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_however_it_ends_no_process_is_left_and_rows_are_kept(start, tmp_path, how):
    (tmp_path / "study.toml").write_text(STUDY.replace("seeds = 2", "seeds = 400"), encoding="utf-8")
    partial = tmp_path / "rows.partial.jsonl"
    with start("sweep", tmp_path / "study.toml", "-o", tmp_path / "rows.csv", "--workers", 2) as process:
        wait_until(lambda: partial.exists() and len(partial.read_text("utf-8").splitlines()) > 4)
        workers = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        assert len(workers) == 2
        process.send_signal(getattr(signal, how))
        _, err = process.communicate(timeout=60)
    wait_until(lambda: not any(is_running(worker) for worker in workers))
    assert "Traceback" not in err
    assert len(partial.read_text("utf-8").splitlines()) > 4


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"  # that, nobody has waited for
    except OSError:
        return False


def wait_until(there):
    until = time.monotonic() + 60
    while not there():
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.medium
def test_the_command_finds_a_task_in_the_folder_that_one_is_in(tmp_path):
    """As an installed script, which has its own folder before all others and not that."""
    (tmp_path / "mine.py").write_text("def one(skin, random):\n    return {'one': 1}\n", encoding="utf-8")
    (tmp_path / "study.toml").write_text('task = "mine:one"\n', encoding="utf-8")
    script = "import sys; sys.path.remove(''); from bubbleskin.cli import main; main(['sweep', 'study.toml', '--workers', '1'])"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, "sweep: 1 wristband" in done.stdout) == (0, True), done.stderr


def test_the_command_says_what_is_wrong(command, tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    status, _, err = command("sweep", tmp_path / "no.toml")
    assert (status, err.count("\n")) == (2, 1)
    status, _, err = command("sweep", tmp_path / "study.toml", "-o", "rows.xls")
    assert (status, "end it in .csv or .parquet" in err) == (2, True)
    status, _, err = command("sweep", tmp_path / "study.toml", "--workers", 1, "--scheduler", "tcp://127.0.0.1:1")
    assert (status, "give one of them" in err) == (2, True)
