"""Every input that the coverage-guided fuzz has kept does no harm; `make fuzz` looks for more."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

CORPUS = (Path(__file__).parent / "corpus.txt").read_text().split()
TOOLS = Path(__file__).parents[2] / "tools/stress"


def tool(name):
    spec = importlib.util.spec_from_file_location(name, TOOLS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def target():
    return tool("fuzz_target")


def test_the_corpus_reaches_every_request(target):
    seen = {bytes.fromhex(line)[0] for line in CORPUS}
    assert seen >= {4, 8, 9, 10, 11, 12}


@pytest.mark.medium
def test_no_input_of_the_corpus_does_harm(target):
    for line in CORPUS:
        target.one_input(bytes.fromhex(line))


@pytest.mark.slow
def test_the_fuzz_sees_what_it_watches():
    pytest.importorskip("atheris")
    command = [sys.executable, TOOLS / "fuzz.py", "--worker", "-runs=3", "-seed=1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Done 3 runs" in done.stderr


def test_a_module_that_the_fuzz_does_not_see_is_named():
    """Renamed, or loaded by nobody who counts its branches."""
    assert tool("fuzz").unwatched(["bubble_firmware.session", "bubble_protocol.frame"]) == [
        "bubble_firmware.session",
        "bubble_protocol.frame",
    ]
