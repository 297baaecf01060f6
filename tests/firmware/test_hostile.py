"""No request, whatever stands in it, costs the firmware memory or makes it fail; `tools/stress/hostile.py` takes 100,000."""

import importlib.util
import sys
from pathlib import Path

import pytest

PATH = Path(__file__).parents[2] / "tools/stress/hostile.py"


@pytest.fixture(scope="module")
def hostile():
    spec = importlib.util.spec_from_file_location(PATH.stem, PATH)
    tool = sys.modules[PATH.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool


@pytest.mark.promise("memory", "hostile")
@pytest.mark.medium
@pytest.mark.parametrize("inputs", [300, pytest.param(10_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
def test_hostile_requests_cost_nothing(board, inputs, hostile, micropython):
    outcome = hostile.attack(board, inputs)
    assert outcome.harmless, outcome
    assert outcome.used < 100, outcome
    assert outcome.frames[0] > inputs // 2, "frames were taken"
    assert sum(outcome.ticks[1:3]) > inputs, "valves were at work"
