"""Patterns: what the words mean, what is done to them, and the sequences that they become."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bubbleskin as bs
from bubbleskin.patterns import WORDS, level, noise, parse, pulse, ripple, seq, wave
from bubbleskin.patterns.typed import METHODS

LAYOUTS = {
    "hexagon 7": bs.Layout.hexagon(1),
    "hexagon 37": bs.Layout.hexagon(3),
    "grid": bs.Layout.grid(4, 5),
    "one": bs.Layout.hexagon(0),
}
SEVEN, NINETEEN = bs.Layout.hexagon(1), bs.Layout.hexagon(2)
MADE = {"ripple": ripple(), "wave": wave(), "pulse": pulse(), "noise": noise(), "seq": seq(0, wave(), 1)}

factors = st.floats(0.125, 8, width=16)
words = st.sampled_from(list(MADE.values()))
shifts = st.floats(-2, 2, width=16)


def changed(patterns):
    """A pattern of which something is changed, or two of them as one."""
    return st.one_of(
        st.builds(lambda one, factor: one.slow(factor), patterns, factors),
        st.builds(lambda one, factor: one.fast(factor), patterns, factors),
        st.builds(lambda one, degrees: one.rotate(degrees), patterns, st.floats(-400, 400, width=16)),
        st.builds(lambda one: one.mirror(), patterns),
        st.builds(lambda one, *by: one.shift(*by), patterns, shifts, shifts, shifts),
        st.builds(lambda one, other: one + other, patterns, patterns),
        st.builds(lambda one, share: share * one, patterns, st.floats(0, 1, width=16)),
        st.builds(
            lambda one, other, each: seq(one, 0.5, other, each=each), patterns, patterns, st.floats(1, 9, width=16)
        ),
    )


composed = st.recursive(words, changed, max_leaves=4)


def test_a_ripple_runs_outwards_at_its_speed():
    """Two radii in four seconds: a crest that is in the middle is a bubble further out after each half second."""
    row = bs.Layout.grid(1, 9, 5.0)  # radius 20 mm, a bubble each quarter of it
    pattern = ripple(wavelength=2, period=4)
    for quarters in range(5):
        heights = pattern.heights(row, 1.0 + 0.5 * quarters)
        assert heights[4 + quarters] == pytest.approx(12)
        assert heights[4 - quarters] == pytest.approx(12)


def test_a_wave_runs_to_the_right_and_where_it_is_turned():
    row = bs.Layout.grid(1, 9, 5.0)
    assert [int(wave(4, 8).heights(row, 2.0 + t).argmax()) for t in range(3)] == [4, 6, 8]
    assert [int(wave(4, 8).rotate(180).heights(row, 2.0 + t).argmax()) for t in range(3)] == [4, 2, 0]
    column = bs.Layout.grid(9, 1, 5.0)
    assert [int(wave(4, 8).rotate(90).heights(column, 2.0 + t).argmax()) for t in range(3)] == [4, 6, 8]


@pytest.mark.parametrize("rings", [1, 2, 3])
def test_the_pulse_is_the_papers(rings):
    """Inner bubbles together, then the framing ring one after the other, counterclockwise; then the ring alone."""
    layout = bs.Layout.hexagon(rings)
    outer = np.arange(len(layout) - 6 * rings, len(layout))
    inner = np.arange(len(layout) - 6 * rings)
    heights = pulse(period=10).heights(layout, np.arange(0, 10, 0.01))
    assert np.ptp(heights[:, inner], axis=1).max() < 0.15, "together"
    at_two = heights[200]
    assert at_two[inner].min() > 11.9
    assert at_two[outer].max() < 5.6
    begun = (heights[200:, outer] > 8.75).argmax(axis=0)
    assert (np.diff(begun) > 0).all(), "one after the other"
    assert heights[990, inner].max() < 5.6
    assert heights[990, outer].min() > 11.9


def test_noise_comes_again_and_differs_by_its_seed():
    times = np.linspace(0, 8, 50)
    one = noise().heights(NINETEEN, times)
    np.testing.assert_allclose(one, noise().heights(NINETEEN, times + 8), atol=1e-9)
    assert np.abs(one - noise(seed=1).heights(NINETEEN, times)).max() > 2
    assert np.ptp(one) > 5
    wide = np.ptp(noise(size=200).heights(NINETEEN, times), axis=1).max()
    assert wide < 0.5 < np.ptp(one, axis=1).min(), "hills far wider than the wristband are a level that moves"


def test_a_seq_plays_one_after_the_other():
    pattern = seq(0, 1, 0.5, each=2, fade=0.5)
    heights = pattern.heights(SEVEN, [0, 1, 1.5, 1.75, 2, 3, 4, 5, 6, 7])[:, 3]
    assert heights.tolist() == pytest.approx([5.5, 5.5, 5.5, 8.75, 12, 12, 8.75, 8.75, 5.5, 5.5])
    inner = seq(wave().shift(seconds=9), ripple(), each=3)
    np.testing.assert_allclose(inner.heights(SEVEN, 3.7), ripple().heights(SEVEN, 0.7)), "each begins at its beginning"


def test_what_is_done_to_a_pattern():
    t = np.linspace(0, 6, 40)
    np.testing.assert_allclose(wave().slow(3).heights(SEVEN, t), wave(period=6).heights(SEVEN, t))
    np.testing.assert_allclose(wave().fast(2).heights(SEVEN, t), wave(period=1).heights(SEVEN, t))
    np.testing.assert_allclose(wave().shift(seconds=1).heights(SEVEN, t + 1), wave().heights(SEVEN, t))
    mirrored = noise().mirror().heights(SEVEN, t)
    np.testing.assert_allclose(mirrored[:, [2, 1, 6]], mirrored[:, [3, 4, 5]])
    np.testing.assert_allclose(mirrored[:, [1, 2, 6]], noise().heights(SEVEN, t)[:, [1, 2, 6]])
    beside = ripple(wavelength=4, period=4).shift(x=1, y=0).heights(SEVEN, 1)
    assert beside.argmax() == 1, "the middle of the rings is where the bubble on the right is"
    half = (0.5 * ripple()).heights(SEVEN, t)
    np.testing.assert_allclose(half - 5.5, (ripple().heights(SEVEN, t) - 5.5) / 2)
    assert (ripple() + 1).heights(SEVEN, t).min() == 12, "up to the highest"


def test_patterns_do_not_change():
    before = ripple()
    after = before.slow(2).rotate(30)
    assert before == ripple() != after
    assert len({before, ripple(), after}) == 2
    with pytest.raises(FrozenInstanceError):
        before.period = 3


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("name", MADE)
def test_every_word_fits_every_layout_and_the_range(layout, name):
    heights = MADE[name].heights(layout, np.linspace(0, 20, 300), low_mm=6, high_mm=9)
    assert heights.shape == (300, len(layout))
    assert heights.min() >= 6
    assert heights.max() <= 9


@given(composed)
def test_the_typed_form_means_the_same(pattern):
    assert parse(repr(pattern)) == pattern
    t = np.linspace(0, 3, 7)
    np.testing.assert_array_equal(parse(repr(pattern)).heights(SEVEN, t), pattern.heights(SEVEN, t))


@given(composed, st.floats(0.05, 6), st.sampled_from([0.02, 0.1, 0.5]))
def test_a_sequence_stays_as_close_as_it_says(pattern, seconds, within):
    """Held against the sequence's own account of what it asks, every 10 ms: no ramp is shorter, whichever the wristband."""
    sequence = pattern.sequence(SEVEN, seconds, within_mm=within)
    ticks = np.arange(round(seconds / 0.01) + 1) * 0.01
    asked = sequence.targets_at(ticks + 1)
    assert np.abs(asked - pattern.heights(SEVEN, ticks)).max() <= within + 1e-6
    assert min(step.ramp for step in sequence.each) >= 0.01


def test_a_sequence_repeats_whole_periods_without_a_jump():
    sequence = ripple().sequence(SEVEN, 2, loops=3, within_mm=0.1)
    t = np.arange(0, 6, 0.005)
    assert sequence.duration == pytest.approx(7)
    assert np.abs(sequence.targets_at(t + 1) - ripple().heights(SEVEN, t)).max() <= 0.1 + 1e-6
    assert level(0.5).sequence(SEVEN, 300).duration == pytest.approx(301), "longer than one ramp may be"
    assert bs.Sequence.from_json(sequence.to_json()) == sequence


@pytest.mark.medium
def test_a_wristband_plays_it():
    """The plant's true heights against the pattern at that moment."""
    with bs.connect("sim://wristband7?contact=0") as skin:
        pattern = bs.patterns.parse("wave.slow(2) * 0.8 + 0.1")
        skin.play(pattern.sequence(skin.layout, 4), wait=False)
        begin = skin.simulated.time + 1
        skin.sleep(1)
        off = []
        while (elapsed := skin.simulated.time - begin) < 4:
            off.append(skin.simulated.height_mm - pattern.heights(skin.layout, elapsed))
            skin.sleep(0.05)
        assert np.sqrt(np.mean(np.square(off))) < 0.2


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("riple", r"no pattern 'riple'; there are ripple, wave, pulse, noise and seq\. Is ripple meant\?"),
        ("ripple.slwo(2)", r"there are \.slow\(\), .*Is slow meant"),
        ("slow(2)", r"write ripple\.slow"),
        ("ripple(speed=2)", "ripple takes wavelength=1, period=2; .*'speed'"),
        ("ripple.slow()", r"\.slow takes factor; "),
        ("ripple.slow(", "never closed at character 12"),
        ("ripple.slow(0)", "must be above zero"),
        ("ripple.rotate(wave)", "must be a number"),
        ("-ripple", "signs stand before numbers"),
        ("2", "A level is 2; 0 to 1"),
        ("seq(wave)", "two or more"),
        ("seq(wave, pulse, fade=3)", "up to 1 s"),
        ("", "is no pattern"),
        ("ripple - wave", "means nothing in a pattern; it is made of"),
        ("9" * 400, "beyond every number"),
        ("ripple\0", "no pattern"),
        ("(" * 400, "is no pattern"),
        ("x" * 501, "500 at most"),
    ],
)
def test_what_is_not_understood_is_answered_with_the_words(typed, words):
    with pytest.raises(bs.InvalidInput, match=words):
        parse(typed)


@pytest.mark.parametrize(
    "typed",
    [
        "__import__('os').system('true')",
        "ripple.__class__",
        "ripple.__init__.__globals__",
        "ripple.at(0, 0, 0)",
        "ripple.sequence(1, 1)",
        "(lambda: ripple)()",
        "[ripple for i in noise]",
        "ripple if 1 else wave",
        "ripple(**{})",
        "seq(*noise)",
        "ripple := 3",
        "f'{ripple}'",
        "True",
        "ripple[0]",
        "2 ** 9",
        "parse('ripple')",
        "ripple; wave",
        "ripple\nwave",
    ],
)
def test_nothing_but_patterns_is_understood(typed):
    with pytest.raises(bs.InvalidInput):
        parse(typed)


@pytest.mark.medium
@given(st.text(st.sampled_from("rwpns()., *+-019eE_lowx=\"'\\\n\t[]{}:#@é"), max_size=40) | st.text(max_size=40))
def test_whatever_is_typed_is_a_pattern_or_a_sentence(typed):
    try:
        said = repr(parse(typed))
    except bs.InvalidInput as error:
        said = str(error)
    assert said


def test_what_cannot_be_meant_is_refused():
    for make, words in (
        (lambda: ripple(0), "wavelength of ripple is 0"),
        (lambda: noise(seed=-1), "seed of noise"),
        (lambda: ripple() * 2, "A level is 2"),
        (lambda: ripple() + "wave", "must be a number"),
        (lambda: ripple(1e-320).heights(SEVEN, 1), "beyond every number"),
        (lambda: ripple().heights(7, 1), "give a Layout"),
        (lambda: ripple().heights(SEVEN, np.nan), "finite"),
        (lambda: ripple().sequence(SEVEN, 0), "0.01 to 600 s"),
        (lambda: ripple().sequence(SEVEN, 2.5, loops=2), "a repeat would jump"),
        (lambda: ripple().sequence(SEVEN, 4, low_mm=9, high_mm=8), "9 mm or more"),
        (lambda: ripple().sequence(SEVEN, 4, within_mm=0), "0.002 mm or more"),
    ):
        with pytest.raises(bs.InvalidInput, match=words):
            pytest.fail(f"not refused: {make()}")


def test_the_words_and_methods_are_those_of_the_page():
    assert set(MADE) == set(WORDS)
    assert all(callable(getattr(ripple(), method)) for method in METHODS)
