"""What the editor foresees: as `play` would have it, and the same whatever was reckoned before. No page."""

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.sequence.library import LIBRARY
from bubbleskin.studio import edits
from bubbleskin.studio.foresight import Foresight, played_order

RING = [10.0] * 6
LIFTED = bs.Sequence([bs.Step([8.0, *RING], 0.5, name="ring"), bs.Step([11.0, *[None] * 6], 0.5, name="middle")])


@pytest.fixture(scope="module")
def skin():
    with bs.connect("sim://wristband7") as one:
        yield one


@pytest.fixture
def foresight(skin):
    return Foresight(skin.layout, skin.info, touch=True)


def tops(forecast):
    return {step: np.round(played.tops, 9).tolist() for step, played in forecast.first.items()}


@pytest.mark.medium
def test_what_was_reckoned_before_makes_no_difference(skin, foresight):
    wave = LIBRARY["wave"](skin.layout)
    variants = [
        wave,
        edits.with_step(wave, 2, ramp=0.9),
        edits.with_targets(wave, 5, [2], 7.0),
        edits.without_step(wave, 0),
        edits.repeated(wave, 1, 3, 2),
        wave,
    ]
    for sequence in variants:
        kept, fresh = foresight.follow(sequence), Foresight(skin.layout, skin.info, touch=True).follow(sequence)
        assert tops(kept) == tops(fresh)
        assert (kept.cut_mm, kept.passes, kept.off()) == (fresh.cut_mm, fresh.passes, fresh.off())


def test_it_is_cut_where_play_cuts_it(skin, foresight, caplog):
    forecast = foresight.follow(LIBRARY["breathing"](skin.layout, loops=1))
    skin.vent()
    skin.sleep(1.5)
    skin.play(LIBRARY["breathing"](skin.layout, loops=1), wait=False)
    assert f"its targets are cut at {forecast.cut_mm:g} mm" in caplog.text
    assert f"are cut at {forecast.cut_mm:g} mm" in forecast.sentences(1)[0]
    assert max(forecast.tops_at(time_ms) or [0] for time_ms in range(0, 4000, 50))[0] <= 14.0


def test_a_lifted_bubble_is_told_at_every_moment(foresight):
    forecast = foresight.follow(LIFTED)
    assert forecast.cut_mm is None
    assert forecast.off() == [(1, 0)]
    assert forecast.sentences(5) == [
        f"Step 1 (middle): bubble 0 would stand {forecast.first[1].tops[0]:.1f} mm high, not 11.0 mm."
    ]
    assert forecast.tops_at(500) == [8.0, *RING]
    assert forecast.tops_at(1000)[0] == pytest.approx(forecast.first[1].tops[0], abs=0.01)
    assert 8.0 < forecast.tops_at(750)[0] < forecast.tops_at(1000)[0]


def test_bubbles_that_cannot_touch_are_as_high_as_they_are_asked(skin):
    apart = Foresight(skin.layout, skin.info, touch=False)
    assert apart.follow(LIFTED).off() == []


def test_repeats_are_followed_twice_and_nothing_after_one_without_end():
    one, two, three = (bs.Step([height], 0.5) for height in (6.0, 7.0, 8.0))
    assert played_order(bs.Sequence([bs.Repeat([one, two], 9), three])) == ([0, 1, 0, 1, 2], [])
    assert played_order(bs.Sequence([one, bs.Repeat([two], 0), three])) == ([0, 1, 1], [2])
    assert played_order(bs.Sequence([bs.Repeat([one, bs.Repeat([two], 0)], 3), three])) == ([0, 1, 1], [2])


def test_what_play_would_refuse_is_said_with_its_reason(skin, foresight):
    other = LIBRARY["wave"](bs.Layout.hexagon(rings=2))
    assert foresight.follow(other).sentences(1) == ["The sequence is for 19 bubbles; this wristband7 has 7."]
    assert foresight.follow(other).tops_at(0) is None
    high = bs.Sequence([bs.Step([20.0, *RING], 0.5)])
    assert "above the limit of 14 mm" in foresight.follow(high).sentences(1)[0]


def test_what_is_not_wanted_any_more_is_left(foresight):
    breathing = LIBRARY["breathing"](bs.Layout.hexagon())
    for looks in (0, 1, 3, 9):
        left = iter([True] * looks)
        assert foresight.follow(breathing, lambda left=left: next(left, False)) is None
    assert foresight.follow(LIFTED).off() == [(1, 0)]
