"""`bubbleskin doctor`: what is ready, and what is compiled ahead."""

import json
import os
import subprocess
import sys

import pytest

from bubbleskin.native.said import COMPILING

RUN = [sys.executable, "-m", "bubbleskin"]


def run(folder, *arguments):
    """The command with caches of its own in `folder`."""
    environment = os.environ | {"XDG_CACHE_HOME": str(folder), "NUMBA_CACHE_DIR": str(folder / "numba")}
    return subprocess.run([*RUN, *arguments], env=environment, capture_output=True, text=True, timeout=500)


@pytest.mark.medium
def test_it_says_what_is_ready(tmp_path):
    done = run(tmp_path, "doctor", "--json")
    assert done.returncode == 0
    findings = {finding["what"]: finding for finding in json.loads(done.stdout)["findings"]}
    assert findings["bubbleskin"]["found"].startswith("0.1.0 on Python 3.")
    assert all(bool(finding["remedy"]) == (finding["found"] in ("none", "not there")) for finding in findings.values())
    assert not list(tmp_path.rglob("*.o")), "nothing is compiled unasked"


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_what_is_compiled_ahead_is_not_compiled_again(tmp_path):
    done = run(tmp_path, "doctor", "--warm")
    assert done.returncode == 0, done.stderr
    assert "parts are compiled" in done.stderr + done.stdout
    assert COMPILING not in done.stderr
    sequence = ["play", "pulse", "--loops", "1"]
    for verb in (["show", "--all", "8"], sequence, ["table", "--upload"], ["store", "--save"], ["info"]):
        for options in ("", "?rubber=real"):
            said = run(tmp_path, *verb, "--device", f"sim://wristband7{options}")
            assert "ompil" not in said.stderr, (verb, said.stderr)
    for verb in (["plan", "--shape", "dome"], ["plan", "--shape", "dome", "--board", "wristband19"]):
        said = run(tmp_path, *verb)
        assert (said.returncode, "ompil" in said.stderr) == (0, False), said.stderr
    before = sorted(tmp_path.rglob("*"))
    again = json.loads(run(tmp_path, "doctor", "--warm", "--json").stdout)["compiled_seconds"]
    assert len(again) >= 15
    assert sorted(tmp_path.rglob("*")) == before, "all was there"


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_where_nothing_can_be_kept_that_is_a_failure(tmp_path):
    (tmp_path / "file").write_text("")
    done = run(tmp_path / "file", "doctor", "--warm")
    assert done.returncode == 1
    assert "cannot be kept" in done.stderr.splitlines()[-1]
    assert "XDG_CACHE_HOME" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def findings(command, *arguments):
    status, out, err = command("doctor", "--json", *arguments)
    assert status == 0, err
    return {finding["what"]: finding for finding in json.loads(out)["findings"]}


def test_a_wristband_is_asked_and_nothing_moves(command):
    found = findings(command, "--device", "sim://wristband7")
    assert found["wristband"]["found"].startswith("wristband7, firmware 0.1.0")
    assert found["its fault log"]["found"] == "nothing that is not acknowledged"
    assert not any(name.startswith("the line") for name in found)


def test_a_good_line_gets_no_advice(command):
    found = findings(command, "--device", "sim://wristband7", "--link", "2")
    assert found["the line: damaged frames"]["found"] == "0"
    assert " 0 lost" in found["the line: telemetry"]["found"]
    assert found["the line: round trips"]["remedy"] == ""


def test_a_bad_line_gets_some(command):
    found = findings(command, "--device", "sim://wristband7?loss=0.05&seed=2", "--link", "3")
    assert " 0 lost" not in found["the line: telemetry"]["found"]
    assert "cable" in found["the line: round trips"]["remedy"]


@pytest.mark.parametrize("seconds", ["0", "nan", "1e9", "long"])
def test_how_long_has_limits(command, seconds):
    status, _, err = command("doctor", "--device", "sim://wristband7", "--link", seconds)
    assert status == 2
    assert "--link is" in err


def test_the_rule_for_linux_is_printed_alone(command):
    status, out, _ = command("doctor", "--udev")
    assert status == 0
    lines = out.splitlines()
    assert lines[0].startswith("# ")
    assert lines[1:] == [
        'SUBSYSTEM=="tty", ATTRS{idVendor}=="2e8a", ATTRS{idProduct}=="0005", MODE="0660", TAG+="uaccess"'
    ]
