"""Recordings: simulated boards that go through much, with all that has reached their firmware in a file."""

import contextlib

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.errors import DeviceRefused, DeviceRestarted


def shapes(skin, times, seed):
    """So many shapes and some telemetry; what a board with a fault refuses is left out."""
    rng = np.random.default_rng(seed)
    for _ in range(times):
        with contextlib.suppress(DeviceRefused):
            skin.show(rng.uniform(5.0, 10.5, skin.info.bubbles), over=0.2, wait=False)
        skin.sleep(0.3)
        for _, _ in zip(range(10), skin.telemetry(50), strict=False):
            pass


def live(skin, seconds):
    """Shapes, faults and their end, settings, tables, flash, power that fails, a restart, a sequence: `seconds` at least."""
    board = skin.simulated
    skin.health()
    skin.configure(rezero_mm=0.8)
    shapes(skin, 1, 1)
    board.inject("leak", 1, 4e-7)
    shapes(skin, 1, 2)
    board.inject("leak", 1, 0.0)
    skin.sleep(0.6)
    skin.clear_faults()
    skin.fault_log()
    skin.vent()
    skin.sleep(0.6)
    skin.upload_tables(bs.build_table(bs.YeohBalloon(mu=41e3)), save=True, anyway=True)
    board.reset()
    with pytest.raises(DeviceRestarted):
        skin.state()
    assert skin.stored().source.startswith("slot")
    shapes(skin, 1, 3)
    skin.restart()
    skin.health()
    skin.tick_histogram()
    skin.play(bs.sequences.pulse(skin.layout), wait=False)
    skin.sleep(0.5)
    board.inject("sensor_stuck", 2, 1900.0)
    shapes(skin, 2, 4)
    board.inject("sensor_stuck", 2, 0.0)
    while board.time < seconds:
        shapes(skin, 1, round(1000 * board.time))


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """`recorded(url, seconds=0)`: the full recording of a board at `url` that has lived through all of `live`; made once."""
    made = {}

    def record(url, seconds=0.0):
        if (url, seconds) not in made:
            path = tmp_path_factory.mktemp("recorded") / "trouble.jsonl"
            with bs.connect(url) as skin, skin.record(path, full=True):
                live(skin, seconds)
            made[url, seconds] = path
        return made[url, seconds]

    return record


@pytest.fixture(scope="session")
def trouble(recorded):
    """A recording of some seconds, with a line that loses frames."""
    return recorded("sim://wristband7?seed=2&spread=0.1&loss=0.03")
