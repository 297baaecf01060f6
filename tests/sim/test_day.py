"""The tool that lets a day pass, for some minutes of it."""

import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools/stress/day.py"


@pytest.mark.slow
@pytest.mark.usefixtures("micropython")
def test_some_minutes_of_the_day():
    run = subprocess.run([sys.executable, str(TOOL), "--hours", "0.1"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "none missed" in run.stdout
