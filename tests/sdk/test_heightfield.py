import math

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.shape.heightfield import sample

HEX = bs.Layout.hexagon(2)
MAX_MM = 14.0


def test_one_height_per_bubble_is_taken_as_it_is():
    heights = np.linspace(0, MAX_MM, len(HEX))
    for given in (heights, heights.tolist(), tuple(heights), heights.astype(np.float32), np.arange(len(HEX)) % 9):
        taken = sample(given, HEX, MAX_MM)
        assert taken.dtype == float
        assert np.array_equal(taken, np.asarray(given, dtype=float))


def test_what_is_taken_is_a_copy():
    heights = np.full(len(HEX), 6.0)
    taken = sample(heights, HEX, MAX_MM)
    taken[0] = 1
    assert heights[0] == 6


@pytest.mark.parametrize("shape", [(2, 2), (3, 3), (5, 9), (40, 30)])
@pytest.mark.parametrize("layout", [HEX, bs.Layout.grid(3, 5), bs.Layout.hexagon(1, 7.0)], ids=["19", "grid", "7"])
def test_a_plane_is_sampled_exactly(layout, shape):
    """Linear interpolation of a plane is the plane: rows rise with y, columns with x, edges on the outermost centres."""
    low, high = layout.positions_mm.min(axis=0), layout.positions_mm.max(axis=0)

    def plane(x, y):
        return 8 + 0.11 * x - 0.07 * y

    x = np.linspace(low[0], high[0], shape[1])
    y = np.linspace(low[1], high[1], shape[0])
    field = plane(x[None, :], y[:, None])
    assert sample(field, layout, MAX_MM) == pytest.approx(plane(*layout.positions_mm.T), abs=1e-9)


def test_a_field_is_read_between_its_entries():
    layout = bs.Layout.grid(1, 5)
    assert sample([[6, 10, 7]], layout, MAX_MM) == pytest.approx([6, 8, 10, 8.5, 7])


def test_a_field_of_one_entry_or_one_line():
    assert (sample([[6.5]], HEX, MAX_MM) == 6.5).all()
    x = HEX.positions_mm[:, 0]
    assert sample([[6, 10]], HEX, MAX_MM) == pytest.approx(6 + 4 * (x - x.min()) / np.ptp(x))


def test_one_bubble_is_a_layout_too():
    one = bs.Layout.hexagon(0)
    assert sample([[7.0, 9.0]], one, MAX_MM).tolist() == [7.0]
    assert sample(lambda x, y: 6 + x + y, one, MAX_MM).tolist() == [6.0]


@pytest.mark.parametrize("limit", [0.0, MAX_MM])
def test_a_flat_field_at_a_limit_is_within_it(limit):
    """Interpolation between equal entries can be off in the last digit."""
    for rows in range(1, 12):
        for columns in range(1, 30):
            taken = sample(np.full((rows, columns), limit), bs.Layout.hexagon(3), MAX_MM)
            assert (taken >= 0).all()
            assert (taken <= MAX_MM).all()


def test_a_function_of_arrays_is_called_once():
    calls = []

    def dome(x, y):
        calls.append(np.shape(x))
        return 12 - (x**2 + y**2) / 100

    x, y = HEX.positions_mm.T
    assert sample(dome, HEX, MAX_MM) == pytest.approx(12 - (x**2 + y**2) / 100)
    assert calls == [(len(HEX),)]


@pytest.mark.parametrize(
    "function",
    [
        lambda x, y: 6.0 if x < 0 else 9.0,
        lambda x, y: 6 + math.hypot(x, y) / 10,
        lambda x, y: max(x, 5.5) / 2,
    ],
    ids=["branch", "math", "max"],
)
def test_a_function_of_numbers_is_called_for_each_bubble(function):
    expected = [function(float(x), float(y)) for x, y in HEX.positions_mm]
    assert sample(function, HEX, MAX_MM) == pytest.approx(expected)


def test_a_function_may_return_one_height_for_all():
    assert (sample(lambda x, y: 7, HEX, MAX_MM) == 7).all()


def test_an_error_in_a_function_is_the_functions():
    def broken(x, y):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        sample(broken, HEX, MAX_MM)


@pytest.mark.parametrize(
    ("heights", "sentence"),
    [
        (np.full(18, 6.0), "18 heights for 19 bubbles: give one height in mm per bubble"),
        ([], "0 heights for 19 bubbles"),
        (6.0, r"One height for 19 bubbles: .* write \[6\] \* 19"),
        (np.zeros((2, 2, 2)), r"An array of shape \(2, 2, 2\) for 19 bubbles"),
        (np.zeros((0, 3)), "at least one entry"),
        ([[6, 7], [8]], r"not \[\[6, 7\], \[8\]\] \(its rows differ in length\)"),
        (["a"] * 19, "an array of numbers, not texts"),
        ({"height": 6}, "is a dict; give one height per bubble"),
        ("dome", r"shapes\.dome\(skin\.layout\)"),
        ([0.012] * 19, "metres, give them times 1000"),
        ([12000] * 19, "µm, give them divided by 1000"),
        (np.full((4, 4), 200, np.uint8), "image / 255 \\* 14"),
        (np.zeros((4, 4, 3)), r"image\.mean\(axis=2\)"),
        ([True] * 19, "not yes or no"),
        ([1j] * 19, "not complex"),
        ([np.timedelta64(1, "s")] * 19, "not spans of time"),
        ([10**400] * 19, "beyond every number"),
        (np.ma.masked_equal([[9.0, 0.0], [8.0, 9.0]], 0.0), r"is masked at \(0, 1\)"),
        (None, "for 19 bubbles"),
        (np.full(19, -1.0), "bubble 0, -1 mm, is negative; heights are 0 to 14 mm"),
        (np.where(np.arange(19) == 4, np.nan, 6), "bubble 4, nan mm, is not a number"),
        (np.where(np.arange(19) == 18, -np.inf, 6), "bubble 18, -inf mm, is not a number"),
        (np.where(np.arange(19) == 3, 14.001, 6), "bubble 3, .* is above the limit of 14 mm"),
        (np.full((4, 4), 14.1), "above the limit of 14 mm"),
        ([[6, math.nan], [6, 6]], r"is nan at \(0, 1\): nothing is known there. .* fill='nearest'"),
        (lambda x, y: x, "bubble .* is negative"),
        (lambda x, y: [6, 6], "at bubble 0 must be one number, not 2"),
        (lambda x, y: "high", "at bubble 0 .* not texts"),
        (lambda x, y: None, "at bubble 0 is nan"),
    ],
)
def test_what_cannot_be_meant_is_one_clear_sentence(heights, sentence):
    with pytest.raises(bs.InvalidInput, match=sentence) as caught:
        sample(heights, HEX, MAX_MM)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_what_is_not_known_is_filled_from_the_nearest_when_asked():
    layout = bs.Layout.grid(2, 2)
    masked = np.ma.masked_equal([[9.0, 0.0], [8.0, 7.0]], 0.0)
    unknown = [[9.0, math.nan], [8.0, 7.0]]
    for field in (masked, unknown):
        taken = sample(field, layout, MAX_MM, "nearest")
        assert taken[[0, 2, 3]].tolist() == [9, 8, 7]
        assert taken[1] in (9, 7), "the nearest: never the 0 that stood under the mask"
    with pytest.raises(bs.InvalidInput, match="nothing to fill it with"):
        sample([[math.nan]], layout, MAX_MM, "nearest")
    with pytest.raises(bs.InvalidInput, match="must be one of 'nearest'"):
        sample(unknown, layout, MAX_MM, "linear")


def test_show_fills_when_asked():
    with bs.connect("sim://wristband7?contact=0") as skin:
        assert skin.show([[9.0, math.nan], [9.0, 9.0]], fill="nearest").target_mm.tolist() == [9.0] * 7
