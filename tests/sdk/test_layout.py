import json

import numpy as np
import pytest

import bubbleskin as bs


@pytest.mark.parametrize(("rings", "bubbles"), [(0, 1), (1, 7), (2, 19), (3, 37)])
def test_hexagons_have_their_bubbles(rings, bubbles):
    layout = bs.Layout.hexagon(rings)
    assert len(layout) == bubbles == len(layout.positions_mm) == len(layout.neighbours)


def test_a_hexagon_goes_ring_by_ring_counterclockwise_from_the_right():
    layout = bs.Layout.hexagon(2, pitch_mm=12.0)
    x, y = layout.positions_mm.T
    radius, angle = np.hypot(x, y) / 12, np.arctan2(y, x) % (2 * np.pi)
    assert radius[0] == 0
    assert radius[1:7] == pytest.approx(1)
    assert radius[7:] == pytest.approx([2, np.sqrt(3)] * 6)
    for ring in (angle[1:7], angle[7:]):
        assert ring == pytest.approx(np.arange(len(ring)) * 2 * np.pi / len(ring), abs=1e-6)


@pytest.mark.parametrize("pitch_mm", [10.0, 7.5])
def test_neighbours_are_a_pitch_apart_and_all_that_are(pitch_mm):
    layout = bs.Layout.hexagon(2, pitch_mm)
    for bubble, near in enumerate(layout.neighbours):
        gaps = np.linalg.norm(layout.positions_mm - layout.positions_mm[bubble], axis=1)
        assert gaps[list(near)] == pytest.approx(pitch_mm)
        assert near == tuple(sorted(near))
        assert len(near) == (np.abs(gaps - pitch_mm) < 1e-3).sum()
        assert all(bubble in layout.neighbours[other] for other in near)
    assert [len(near) for near in layout.neighbours] == [6] * 7 + [3, 4] * 6


def test_the_centre_touches_the_whole_first_ring():
    assert bs.Layout.hexagon(1).neighbours[0] == (1, 2, 3, 4, 5, 6)
    assert bs.Layout.hexagon(1).neighbours[1] == (0, 2, 6)


def test_a_sixth_of_a_turn_maps_a_hexagon_onto_itself():
    layout = bs.Layout.hexagon(2)
    turn = np.deg2rad(60)
    turned = layout.positions_mm @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    assert turned[1:7] == pytest.approx(np.roll(layout.positions_mm[1:7], -1, axis=0), abs=1e-5)
    assert turned[7:] == pytest.approx(np.roll(layout.positions_mm[7:], -2, axis=0), abs=1e-5)


def test_a_grid_goes_row_by_row_from_the_lowest_left():
    layout = bs.Layout.grid(2, 3, pitch_mm=4.0)
    assert layout.positions_mm.tolist() == [[-4, -2], [0, -2], [4, -2], [-4, 2], [0, 2], [4, 2]]
    assert layout.neighbours == ((1, 3), (0, 2, 4), (1, 5), (0, 4), (1, 3, 5), (2, 4))


def test_layouts_are_equal_by_their_places_and_cannot_be_changed():
    layout = bs.Layout.hexagon()
    assert layout == bs.Layout.hexagon()
    assert layout != bs.Layout.hexagon(pitch_mm=11)
    with pytest.raises(ValueError, match="read-only"):
        layout.positions_mm[0, 0] = 1


def test_a_layout_does_not_follow_the_array_it_was_made_of():
    places = np.zeros((1, 2))
    layout = bs.Layout(places, 10.0)
    places[0, 0] = 5
    assert layout.positions_mm[0, 0] == 0


def test_a_file_gives_its_layout(tmp_path):
    path = tmp_path / "layout.json"
    layout = bs.Layout.grid(2, 2, pitch_mm=8.0)
    path.write_text(json.dumps({"pitch_mm": 8, "positions_mm": layout.positions_mm.tolist()}))
    for given in (path, str(path)):
        read = bs.Layout.from_file(given)
        assert read == layout
        assert read.neighbours == layout.neighbours


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "is not a layout"),
        ("not json", "is not a layout"),
        ("[]", "is not a layout"),
        ('{"pitch_mm": 10}', "positions_mm"),
        ('{"positions_mm": [[0, 0]]}', "pitch_mm"),
        ('{"pitch_mm": "wide", "positions_mm": [[0, 0]]}', "wide"),
        ('{"pitch_mm": 0, "positions_mm": [[0, 0]]}', "The pitch is 0 mm; it must be above zero"),
        ('{"pitch_mm": NaN, "positions_mm": [[0, 0]]}', "NaN is no number of JSON"),
        ('{"pitch_mm": 10, "positions_mm": []}', "positions"),
        ('{"pitch_mm": 10, "positions_mm": [[0, 0, 0]]}', "(1, 3)"),
        ('{"pitch_mm": 10, "positions_mm": [[0, 0], [1]]}', "is not a layout"),
        ('{"pitch_mm": 10, "positions_mm": [[0, Infinity]]}', "Infinity is no number"),
        ("\udcff", "is not a layout"),
    ],
)
def test_what_is_not_a_layout_is_refused_in_a_sentence(tmp_path, content, words):
    path = tmp_path / "bad.json"
    path.write_bytes(content.encode(errors="surrogateescape"))
    with pytest.raises(bs.InvalidInput) as caught:
        bs.Layout.from_file(path)
    text = str(caught.value)
    assert "bad.json" in text
    assert words in text
    assert text.endswith(".")
    assert "\n" not in text


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(bs.InvalidInput, match=r"Cannot read the layout .*none.json: No such file or directory\."):
        bs.Layout.from_file(tmp_path / "none.json")
    with pytest.raises(bs.InvalidInput, match="Cannot read the layout"):
        bs.Layout.from_file(tmp_path)


@pytest.mark.parametrize(
    "make",
    [
        lambda: bs.Layout.hexagon(-1),
        lambda: bs.Layout.hexagon(1, pitch_mm=0),
        lambda: bs.Layout.hexagon(1, pitch_mm=float("nan")),
        lambda: bs.Layout.grid(0, 3),
        lambda: bs.Layout.grid(3, 0),
        lambda: bs.Layout([[0, 0, 0]], 10),
        lambda: bs.Layout([], 10),
    ],
)
def test_what_cannot_be_meant_is_refused(make):
    with pytest.raises(bs.InvalidInput, match=r"\.$"):
        make()


def test_a_board_is_not_guessed():
    with pytest.raises(bs.InvalidInput, match="There is no board 'bench rig'"):
        bs.Layout.of_board("bench rig")


def test_layouts_are_equal_to_the_micrometre():
    assert bs.Layout.hexagon(2) == bs.Layout.from_um(np.rint(1000 * bs.Layout.hexagon(2).positions_mm), 10000)
    assert bs.Layout.from_um([(0, 0), (10000, 0)], 10000) != bs.Layout.from_um([(0, 0), (10002, 0)], 10000)


def test_bubbles_are_named_in_words():
    layout = bs.Layout.hexagon()
    assert layout.names([3]) == "bubble 3"
    assert layout.names([1, 4]) == "bubbles 1 and 4"
    assert layout.names([1, 4, 5]) == "bubbles 1, 4 and 5"
