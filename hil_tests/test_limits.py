"""What cannot be meant is refused in a sentence before a byte is sent, and changes nothing."""

import math

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(60)


def with_entry(value):
    def heights(info):
        values = np.full(info.bubbles, 6.0)
        values[2] = value
        return values

    return heights


WRONG_HEIGHTS = {
    "one too few": (lambda info: np.full(info.bubbles - 1, 6.0), "heights for .* bubbles"),
    "one too many": (lambda info: np.full(info.bubbles + 1, 6.0), "heights for .* bubbles"),
    "none": (lambda info: [], "0 heights for"),
    "a single number": (lambda info: 6.0, "One height for .* bubbles: for the same everywhere"),
    "three dimensions": (lambda info: np.zeros((2, 2, 2)), "shape"),
    "words": (lambda info: ["high"] * info.bubbles, "must be .* numbers, not texts"),
    "NaN": (with_entry(math.nan), "bubble 2, nan mm, is not a number"),
    "infinity": (with_entry(math.inf), "bubble 2, inf mm, is not a number"),
    "negative": (with_entry(-0.5), "bubble 2, -0.5 mm, is negative"),
    "above the limit": (lambda info: with_entry(info.height_max_mm + 0.01)(info), "bubble 2, .* is above the limit"),
    "a callable above the limit": (lambda info: lambda x, y: info.height_max_mm + x * x, "is above the limit"),
    "a field with NaN": (lambda info: np.full((3, 3), math.nan), "nan at .*: nothing is known there"),
}


@pytest.fixture
def unsent(skin):
    """Checks that nothing was sent and nothing has changed: the counted frames are the questions' own.

    On a real board the link is kept alive in the background, some ten times a second.
    """
    skin.show(np.full(skin.info.bubbles, 6.0))
    before = skin.health()
    yield
    after = skin.health()
    assert after.frames_good <= before.frames_good + (1 if skin.simulated else 1 + 20 * (after.time - before.time))
    assert after.frames_bad == before.frames_bad
    state = skin.state()
    assert state.mode == "active"
    assert state.target_mm == pytest.approx(6.0)


@pytest.mark.promise("refused-unsent")
@pytest.mark.long
@pytest.mark.usefixtures("unsent")
@pytest.mark.parametrize("wrong", WRONG_HEIGHTS)
def test_heights(skin, wrong):
    make, sentence = WRONG_HEIGHTS[wrong]
    with pytest.raises(bs.InvalidInput, match=sentence) as caught:
        skin.show(make(skin.info))
    assert str(caught.value).endswith(".")
    assert isinstance(caught.value, ValueError)


@pytest.mark.promise("refused-unsent")
@pytest.mark.long
@pytest.mark.usefixtures("unsent")
@pytest.mark.parametrize("over", [-0.1, 60.1, math.inf, math.nan])
def test_over(skin, over):
    with pytest.raises(bs.InvalidInput, match=r"over is .* 0 to 60 s"):
        skin.show(np.full(skin.info.bubbles, 7.0), over=over)


@pytest.mark.promise("refused-unsent")
@pytest.mark.long
@pytest.mark.usefixtures("unsent")
@pytest.mark.parametrize("rate_hz", [0, -1, math.nan, 1e4])
def test_telemetry_rate(skin, rate_hz):
    with pytest.raises(bs.InvalidInput, match="rate_hz is"):
        next(skin.telemetry(rate_hz))


@pytest.mark.promise("refused-unsent")
@pytest.mark.usefixtures("unsent")
def test_number_of_tables(skin):
    table = bs.build_table(bs.YeohBalloon())
    with pytest.raises(bs.InvalidInput, match=r"2 tables for .* bubbles"):
        skin.upload_tables([table, table])


def test_the_limits_themselves_are_allowed(skin):
    n = skin.info.bubbles
    skin.show(np.zeros(n), over=60.0, wait=False)
    skin.show(np.full(n, skin.info.height_max_mm), wait=False, plan=False)
    assert skin.state().target_mm == pytest.approx(skin.info.height_max_mm)
    skin.show(np.zeros(n), wait=False)


@pytest.mark.promise("height-held")
@pytest.mark.long
def test_the_highest_shape_holds(skin):
    """The board's own limit must not trip over the overshoot of its highest heights."""
    n = skin.info.bubbles
    for _ in range(3):
        state = skin.show(np.full(n, skin.info.height_max_mm), plan=False)
        assert state.alone_mm == pytest.approx(skin.info.height_max_mm, abs=0.2)
        skin.sleep(2.0)
        assert skin.faults() == {}
        skin.show(np.zeros(n))
