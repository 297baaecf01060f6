"""A calibration that is killed, or whose line is lost: the wristband has what it had, and is empty."""

import json
import signal
import subprocess
import sys
import time

import pytest

import bubbleskin as bs

pytestmark = pytest.mark.medium  # for the calibration that they share

pytestmark = pytest.mark.slow


@pytest.fixture
def served():
    """A simulated wristband that is served in a process of its own: its URL, and that process."""
    command = [sys.executable, "-m", "bubbleskin", "sim", "wristband7", "--port", "0", "--json", "--spread", "0.1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        try:
            yield json.loads(process.stdout.readline())["device"], process
        finally:
            process.kill()


def has(url):
    with bs.connect(url) as skin:
        return skin.read_tables(), skin.trim().flow_gain.tolist(), skin.stored()


def test_killed(served):
    url, _ = served
    before = has(url)
    command = [sys.executable, "-m", "bubbleskin", "calibrate", "--device", url]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as killed:
        time.sleep(6.0)
        assert killed.poll() is None
        killed.send_signal(signal.SIGKILL)
    time.sleep(2.0)  # by then it has vented
    assert has(url) == before
    with bs.connect(url) as skin:
        assert skin.state().pressure_kpa.max() < 1.0


def test_lost(served):
    url, process = served

    def lose(now):
        if now.done > 0.1:
            process.kill()

    with bs.connect(url) as skin, pytest.raises(bs.LinkError):
        skin.calibrate(progress=lose)
