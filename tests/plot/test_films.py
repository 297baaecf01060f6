"""Films of sequences: every frame shows its bubbles and nothing of the frame before, and the film keeps the time."""

import numpy as np
import pytest
from PIL import Image

import bubbleskin as bs
from bubbleskin.cli.command import main
from bubbleskin.errors import InvalidInput
from bubbleskin.plot import contact
from bubbleskin.plot.sequence import Frame, animate

LAYOUT = bs.Layout.hexagon(rings=1)
LOW, HIGH = np.full(7, 5.5), np.array([14.0, 8, 9, 10, 11, 12, 13])


TITLE = 30
"""Rows of pixels that the title has."""
NEAR = 80
"""Of 255: a GIF has 256 colours for all shades of an edge."""


def frame(time: float, height_mm: np.ndarray) -> Frame:
    """Bubbles that stand each by itself."""
    radius = height_mm / 2e3
    return Frame(time, height_mm, np.column_stack([LAYOUT.positions_mm / 1e3, radius]), radius)


def pictures(path) -> tuple[list[np.ndarray], list[int]]:
    """The film's frames as pixels (RGB), and how long each stays in ms."""
    frames, durations = [], []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
            durations.append(film.info["duration"])
    return frames, durations


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "film.gif"
    done = []
    animate(LAYOUT, [frame(0, HIGH), frame(0.07, LOW), frame(0.14, HIGH)], path, title="two", progress=done.append)
    assert done == [1, 2, 3]
    return pictures(path)


@pytest.mark.medium
def test_a_film_plays_at_the_pace_at_which_it_was_watched(film):
    assert film[1] == [70, 70, 70]


@pytest.mark.medium
def test_a_frame_is_the_same_whatever_was_drawn_before_it(film, tmp_path):
    high, low, again = (one[TITLE:] for one in film[0])
    path = animate(LAYOUT, [frame(0, LOW), frame(0.07, HIGH)], tmp_path / "film.gif")
    low_first, high_second = (one[TITLE:] for one in pictures(path)[0])
    assert np.abs(high - low).max() > 200
    for one, other in ((again, high), (low_first, low), (high_second, high)):
        assert np.abs(one - other).max() < NEAR


def test_a_bubble_has_the_colour_and_size_of_its_height(film):
    above = film[0][0][TITLE:270, :275]
    colour = 0.9 * 255 * np.array(contact.colours().to_rgba(HIGH[0])[:3]) + 0.1 * 255
    across = (np.abs(above - colour).max(axis=2) < 30).any(axis=1).sum()
    assert across == pytest.approx(235 * HIGH[0] / 40, abs=4)  # the axes are 235 pixels and 40 mm high


def test_the_time_in_the_title_goes_on(film):
    first, _, again = (one[:TITLE] for one in film[0])
    assert np.abs(again - first).max() > 100


def test_a_film_needs_two_frames_and_an_ending(tmp_path):
    with pytest.raises(InvalidInput, match="at least two frames"):
        animate(LAYOUT, [frame(0, LOW)], tmp_path / "film.gif")
    with pytest.raises(InvalidInput, match=r"ends in \.avi; a film is a \.gif or an \.mp4"):
        animate(LAYOUT, [frame(0, LOW), frame(1, LOW)], tmp_path / "film.avi")


@pytest.mark.medium
def test_a_film_that_cannot_be_written_is_one_sentence(tmp_path):
    with pytest.raises(InvalidInput, match=r"The film .* cannot be written: No such file or directory"):
        animate(LAYOUT, [frame(0, LOW), frame(1, LOW)], tmp_path / "nowhere" / "film.gif")


@pytest.mark.medium
def test_the_command_films_a_sequence(tmp_path, capsys):
    path = tmp_path / "pulse.gif"
    with pytest.raises(SystemExit) as end:
        main(["plot", "sequence", "pulse", "--seconds", "0.5", "--rate", "10", "-o", str(path)])
    assert not end.value.code
    assert f"wrote {path} (5 pictures of a simulated wristband7)" in capsys.readouterr().err
    frames, durations = pictures(path)
    assert durations == [100] * 5
    assert np.abs(frames[0] - frames[-1]).max() > 100
