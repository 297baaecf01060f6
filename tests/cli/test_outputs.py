"""A disk that is full, wherever something is written: one sentence, and what was written before is readable."""

import resource
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import bubbleskin as bs
from bubbleskin.files import write_text
from bubbleskin.membrane import Calibration, YeohBalloon, build_table, simulate_sheet, write_csv

RUN = [sys.executable, "-m", "bubbleskin"]
SIM = ["--device", "sim://wristband7?contact=0"]
FULL = Path("/dev/full")

pytestmark = pytest.mark.skipif(not FULL.exists(), reason="a full disk is simulated by Linux")


VERBS = ("info", "info --json", "show --all 8", "monitor --json --seconds 0.2", "play pulse --loops 1")


@pytest.mark.medium
@pytest.mark.parametrize("verb", VERBS)
def test_a_full_standard_output(verb):
    with FULL.open("w") as full:
        done = subprocess.run([*RUN, *verb.split(), *SIM], stdout=full, stderr=subprocess.PIPE, text=True, timeout=100)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    assert "The output cannot be written: No space left on device." in done.stderr


@pytest.mark.parametrize(
    "write",
    [
        lambda path: bs.sequences.pulse(bs.Layout.hexagon()).to_json(path),
        lambda path: Calibration("wristband7", (build_table(YeohBalloon(), knots=3),)).save(path),
        lambda path: write_csv(path, simulate_sheet(1, seed=0)[0]),
        lambda path: write_text(path, "heights", "the heights"),
    ],
    ids=["sequence", "calibration", "measurements", "text"],
)
def test_a_full_disk(write, tmp_path):
    with pytest.raises(bs.InvalidInput, match=r"^The .* /dev/full cannot be written: No space left on device\.$"):
        write(FULL)
    with pytest.raises(bs.InvalidInput, match=r"cannot be written: No such file"):
        write(tmp_path / "nowhere" / "x")
    path = tmp_path / "x"
    path.write_text("what was there")
    write(path)
    assert path.read_text() != "what was there"
    assert [other.name for other in tmp_path.iterdir()] == ["x"], "nothing else is left"


@pytest.mark.medium
def test_a_file_that_was_there_stays_when_the_disk_is_full(tmp_path):
    path = tmp_path / "x.txt"
    path.write_text("what was there")
    script = f"""
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
from bubbleskin.files import write_text
write_text({str(path)!r}, "x" * 5000, "the text")
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert "The text" in done.stderr
    assert "cannot be written: File too large." in done.stderr
    assert path.read_text() == "what was there"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.medium
def test_a_recording_on_a_disk_that_fills_ends_with_a_whole_row(tmp_path):
    path = tmp_path / "x.csv"
    done = subprocess.run(
        [*RUN, "monitor", "--seconds", "5", "--record", path, *SIM],
        capture_output=True,
        text=True,
        timeout=100,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, resource.RLIM_INFINITY)),
    )
    assert done.returncode == 2
    assert "File too large." in done.stderr
    assert "Traceback" not in done.stderr
    rows = pd.read_csv(path, comment="#")
    assert len(rows) > 10
    assert not rows.isna().to_numpy()[:, 0].any()
    assert path.read_text().endswith("\n")
