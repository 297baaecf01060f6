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
