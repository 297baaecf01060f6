"""One calibration of a sheet of real rubber that differs in everything: what most tests here look at."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim import SimulatedBoard, SimulatedTransport
from bubbleskin.sim.recipe import make_parameters
from bubbleskin.sim.tolerances import SPREAD

BOARD = "wristband7"


def skin_of(parameters, seed=0, contact=False):
    """A skin on a simulated board with such a plant."""
    board = SimulatedBoard(BOARD, seed=seed, contact=contact, parameters=parameters)
    transport = SimulatedTransport(board, f"sim://{BOARD}")
    skin = bs.Skin(run_sync(AsyncSkin.open(transport, 2.0, simulated=board)))
    skin.sleep(1.0)
    return skin


def real(seed=5, spread=SPREAD, **changed):
    """Parameters of seven real bubbles; `changed`: a figure's name to {bubble: what it is multiplied by}."""
    parameters = make_parameters(7, seed, spread, rubber="real")
    for name, by_bubble in changed.items():
        column = getattr(parameters, name).copy()
        for bubble, factor in by_bubble.items():
            column[bubble] *= factor
        parameters = replace(parameters, **{name: column})
    return parameters


def errors_mm(skin, shows=4, seconds=2.0, seed=3):
    """True heights less those asked, of random shapes, (shows, n)."""
    rng = np.random.default_rng(seed)
    off = []
    for _ in range(shows):
        target = rng.uniform(5.5, 13.0, skin.info.bubbles)
        skin.show(target, wait=False)
        skin.sleep(seconds)
        off.append(skin.simulated.alone_mm - target)
    return np.array(off)


def rms(values):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="session")
def sheets():
    """What makes and looks at sheets: `skin_of`, `real`, `errors_mm`, `rms`."""
    return SimpleNamespace(skin_of=skin_of, real=real, errors_mm=errors_mm, rms=rms)


@dataclass
class Done:
    """A sheet that has been calibrated."""

    calibration: bs.SelfCalibration
    parameters: object
    progress: list
    trim: bs.Trim
    tables: list
    saved: object
    before_mm: np.ndarray
    after_mm: np.ndarray


@pytest.fixture(scope="session")
def done():
    """Seven bubbles, everything ± 10 %, before and after."""
    parameters = real()
    with skin_of(parameters) as skin:
        before = errors_mm(skin, shows=2)
        skin.vent()
        skin.sleep(2.0)
        progress = []
        found = skin.calibrate(progress=progress.append)
        facts = skin.trim(), skin.read_tables(), skin.stored()
        return Done(found, parameters, progress, *facts, before, errors_mm(skin))
