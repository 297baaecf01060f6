"""Pictures in notebooks: of what has one, of the right thing, and not before it is asked for."""

import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import bubbleskin as bs
from bubbleskin.pictured import Pictured
from bubbleskin.plot.notebook import figure_of

ASKED_BY_IPYTHON = "_repr_png_"


def picture(shown):
    """The pixels that IPython would get; None where it would show the `repr`."""
    drawn = getattr(shown, ASKED_BY_IPYTHON)()
    return None if drawn is None else np.asarray(Image.open(io.BytesIO(drawn)).convert("RGB")).astype(int)


def colours(pixels):
    """How many colours a picture has: one that is blank has one."""
    return len(np.unique(pixels.reshape(-1, 3), axis=0))


def test_everything_that_has_a_picture_is_drawn():
    """And the other way round: the classes that IPython finds it in are those of the issue."""
    named = {"Skin", "State", "Plan", "Sequence", "YeohFit", "Calibration", "SelfCalibration"}
    assert {kind.__name__ for kind in Pictured.__subclasses__()} == named
    assert {kind.__name__ for kind in figure_of.registry} == named | {"object"}
    assert all(issubclass(getattr(bs, name), Pictured) for name in named)


@pytest.mark.medium
def test_a_skin_shows_what_it_is_now():
    with bs.connect("sim://wristband7") as skin:
        flat = picture(skin)
        skin.show([12, 7, 7, 7, 7, 7, 7])
        dome = picture(skin)
        state = picture(skin.state())
    assert colours(flat) > 50
    assert flat.shape == dome.shape
    assert np.abs(flat - dome).mean() > 1
    assert colours(state) > 20
    assert picture(skin) is None, "closed: the notebook shows its repr"


@pytest.mark.medium
def test_sequences_fits_and_calibrations_are_drawn(tmp_path):
    layout, balloon = bs.Layout.hexagon(1), bs.YeohBalloon()
    height = np.linspace(5.5e-3, 12e-3, 12)
    noisy = balloon.pressure_at_height(height) + np.random.default_rng(1).normal(0, 100, 12)
    shown = [
        bs.sequences.pulse(layout),
        bs.sequences.ripple(layout, loops=0),
        bs.fit_yeoh(height, noisy, radius=2.5e-3, thickness=1e-3, wall="thin"),
        bs.Calibration.build("wristband7", [balloon] * 7, source="a test"),
    ]
    drawn = [picture(one) for one in shown]
    assert min(colours(pixels) for pixels in drawn) > 20


@pytest.mark.slow
def test_a_plan_is_drawn():
    plan = bs.plan(np.array([13.9] + [11.88] * 6), bs.Layout.hexagon(1))
    assert colours(picture(plan)) > 50


@pytest.mark.medium
def test_nobody_waits_for_matplotlib_who_asks_for_no_picture():
    script = (
        "import sys, bubbleskin as bs; skin = bs.connect('sim://wristband7'); skin.state(); "
        "loaded = 'matplotlib' in sys.modules; skin._repr_png_(); print(loaded, 'matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "False True\n"
