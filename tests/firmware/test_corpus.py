"""Every input that the coverage-guided fuzz has kept does no harm; `make fuzz` looks for more."""

import importlib.util
from pathlib import Path

import pytest

CORPUS = (Path(__file__).parent / "corpus.txt").read_text().split()


@pytest.fixture(scope="module")
def target():
    path = Path(__file__).parents[2] / "tools/stress/fuzz_target.py"
    spec = importlib.util.spec_from_file_location("fuzz_target", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_corpus_reaches_every_request(target):
    seen = {bytes.fromhex(line)[0] for line in CORPUS}
    assert seen >= {4, 8, 9, 10, 11, 12}


def test_no_input_of_the_corpus_does_harm(target):
    for line in CORPUS:
        target.one_input(bytes.fromhex(line))
