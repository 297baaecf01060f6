"""The pictures of a calibration: every bubble has its panel, one that was not fitted too."""

from dataclasses import replace

import pytest

from bubbleskin.calibrate.result import BubbleCalibration
from bubbleskin.calibrate.verdict import Verdict
from bubbleskin.plot import calibration as pictures

pytestmark = pytest.mark.medium  # for the calibration that they share


def test_every_bubble_has_a_panel(done, tmp_path):
    figure = pictures.draw(done.calibration)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[:7] == [f"bubble {k}" for k in range(7)]
    assert len(titles) == 7 + 4
    pictures.save(figure, tmp_path / "sheet.svg")
    assert (tmp_path / "sheet.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_what_is_wrong_stands_above_its_panel(done):
    lost = BubbleCalibration(2, Verdict("redo", ("too little data",)), None, None)
    bubbles = tuple(lost if each.bubble == 2 else each for each in done.calibration.bubbles)
    figure = pictures.draw(replace(done.calibration, bubbles=bubbles))
    assert figure.axes[2].get_title() == "bubble 2: too little data"
    nothing = replace(done.calibration, bubbles=(lost,))
    assert len(pictures.draw(nothing).axes) == 5
