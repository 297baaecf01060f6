"""The library's sequences, on any layout."""

from itertools import pairwise

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.sequence.library import HIGH_MM, LIBRARY, LOW_MM, rings

LAYOUTS = {
    "hexagon 7": bs.Layout.hexagon(1),
    "hexagon 19": bs.Layout.hexagon(2),
    "hexagon 61": bs.Layout.hexagon(4),
    "grid": bs.Layout.grid(4, 5),
    "row": bs.Layout.grid(1, 6, 8.0),
    "one": bs.Layout.hexagon(0),
    "two": bs.Layout.grid(1, 2),
    "scattered": bs.Layout(np.array([[0, 0], [30, 0], [0, 45.0]]), 10.0),
}
every_layout = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)


def test_rings_of_a_hexagon_are_its_rings():
    for count in range(5):
        found = rings(bs.Layout.hexagon(count))
        assert [len(ring) for ring in found] == [1, *(6 * ring for ring in range(1, count + 1))]
        assert np.concatenate(found).tolist() == list(range(1 + 3 * count * (count + 1))), "the layout's own order"


@every_layout
def test_rings_hold_every_bubble_once(layout):
    assert sorted(np.concatenate(rings(layout)).tolist()) == list(range(len(layout)))


@every_layout
@pytest.mark.parametrize("name", LIBRARY)
def test_every_layout_can_be_played_on(layout, name):
    sequence = LIBRARY[name](layout, loops=2)
    assert sequence.bubbles == len(layout)
    assert sequence.loops == 2
    assert bs.Sequence.from_json(sequence.to_json()) == sequence
    heights = sequence.targets_at(np.linspace(0, sequence.duration, 200))
    assert heights.max() <= HIGH_MM + 1e-9
    assert heights.max() > HIGH_MM - 0.5
    asked = [t for step in sequence.each if step.targets_mm for t in step.targets_mm]
    assert min(asked) >= (0 if name in ("pop-up", "flat-twin") else LOW_MM)


def test_the_pulse_is_the_papers():
    """Inner bubbles together, then the framing ring one after the other; it oscillates between the two."""
    layout = bs.Layout.hexagon(2)
    inner, outer = np.arange(7), np.arange(7, 19)
    pulse = bs.sequences.pulse(layout)
    shapes = np.array([step.targets_mm for step in pulse.each])
    assert (shapes[0][inner] == HIGH_MM).all()
    assert (shapes[0][outer] == LOW_MM).all()
    for before, after in pairwise(shapes[:13]):
        assert np.sum(before != after) == 1, "one bubble of the ring at a time"
    assert (shapes[12] == HIGH_MM).all()
    assert (shapes[13][inner] == LOW_MM).all()
    assert (shapes[13][outer] == HIGH_MM).all()


def test_pop_up_and_its_flat_twin_ask_for_the_same_in_opposite_orders():
    layout = bs.Layout.hexagon(1)
    up, flat = (
        np.array([step.targets_mm for step in make(layout).each if step.targets_mm])
        for make in (bs.sequences.pop_up, bs.sequences.flat_twin)
    )
    assert (up[-1] == flat[-1]).all()
    assert up[1].tolist() == [HIGH_MM, *[0.0] * 6]
    assert flat[1].tolist() == [0.0, *[HIGH_MM] * 6]


def test_a_wave_travels_and_a_ripple_runs_outwards():
    layout = bs.Layout.grid(1, 9)
    for make, moved in ((bs.sequences.wave, slice(None)), (bs.sequences.ripple, slice(4, None))):
        sequence = make(layout, wavelength_mm=40.0, period=2.0, loops=3)
        here, later = sequence.targets_at([2.0, 2.5])  # a quarter of a period: a quarter of a wave, one bubble
        assert later[moved][1:] == pytest.approx(here[moved][:-1], abs=0.01)


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({"low_mm": 12.0}, "from 12.0 to 12.0"),
        ({"low_mm": -1.0}, "low"),
        ({"high_mm": np.nan}, "high_mm is nan"),
    ],
)
@pytest.mark.parametrize("name", ["pulse", "wave", "ripple", "breathing"])
def test_impossible_heights_are_refused(name, how, sentence):
    with pytest.raises(bs.InvalidInput, match=sentence):
        LIBRARY[name](bs.Layout.hexagon(), **how)


@pytest.mark.parametrize(
    ("name", "how"), [("wave", {"period": 0}), ("breathing", {"period": -1}), ("ripple", {"wavelength_mm": 0})]
)
def test_impossible_times_are_refused(name, how):
    with pytest.raises(bs.InvalidInput, match="it must be above zero"):
        LIBRARY[name](bs.Layout.hexagon(), **how)
