"""Tables: their bound at every single µm, and the integers that the firmware repeats."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import Table, YeohBalloon, build_table


def exceeds(table: Table, balloon: YeohBalloon) -> float:
    """Worst error as a share of the looser of 2 Pa and 5 µm, by plain differences, at every µm."""
    h = np.arange(max(5000, round(balloon.rest_height * 1e6)), 14001)
    metres = np.maximum(h * 1e-6, balloon.rest_height)
    exact = balloon.pressure_at_height(metres)
    five_um = np.abs(balloon.pressure_at_height(metres + 5e-6) - exact)
    return float(np.max(np.abs(table.pressure_at(h) - exact) / np.maximum(2.0, five_um * 1.001)))


@pytest.mark.parametrize("mu", [15e3, 30e3, 39.62e3, 45.9e3, 46.5e3, 52e3, 60e3, 79.24e3])
@pytest.mark.parametrize("knots", [60, 64])
def test_holds_the_looser_of_2_pa_and_5_um(mu, knots):
    balloon = YeohBalloon(mu=mu)
    table = build_table(balloon, knots=knots)
    assert len(table) == knots
    assert exceeds(table, balloon) <= 1.0
    assert table.max_error().held


def test_knots_off_the_curve_leave_almost_half_of_the_tolerance():
    assert build_table(YeohBalloon()).max_error().share < 0.56


def test_nominal_table_holds_with_48_knots():
    assert exceeds(build_table(YeohBalloon(), knots=48), YeohBalloon()) <= 1.0


def test_thick_walls_start_at_their_own_rest_height():
    for surface, rest in (("mid", 6000), ("inner", 7000)):
        balloon = YeohBalloon(wall="thick", surface=surface)
        table = build_table(balloon)
        assert table.height_um[0] == rest
        assert exceeds(table, balloon) <= 1.0


def test_snap_through_table_falls_and_rises():
    table = build_table(YeohBalloon(mu=79.24e3))
    steps = np.diff(table.pressure_pa)
    assert (steps[:5] > 0).all()
    assert (steps < 0).any()
    assert (steps[-5:] > 0).all()


def test_starts_at_rest_without_pressure_and_ends_on_time():
    table = build_table(YeohBalloon())
    assert (table.height_um[0], table.pressure_pa[0]) == (5000, 0)
    assert table.height_um[-1] == 14000
    assert np.all(np.diff(table.height_um) > 0)


def test_reported_bound_is_the_achieved_one():
    balloon = YeohBalloon(mu=50e3)
    table = build_table(balloon)
    error = table.max_error()
    h = np.arange(5000, 14001)
    off = np.abs(table.pressure_at(h) - balloon.pressure_at_height(h * 1e-6))
    slope = np.abs(1e-6 / balloon.compliance(balloon.stretch_at_height(h * 1e-6)))
    within = (off <= error.pressure_pa + 1e-9) | (off / slope <= error.height_um + 1e-9)
    assert within.all()
    assert error.share == pytest.approx(max(error.pressure_pa / 2, error.height_um / 5))
    # A knot moved by 60 Pa is noticed.
    moved = table.pressure_pa.copy()
    moved[30] += 60
    assert not Table(table.height_um, moved).max_error(balloon).held


def test_evaluation_is_the_firmwares_floor_division():
    table = Table([5000, 6000, 6003], [0, 1001, 990])
    assert table.pressure_at(4000) == 0
    assert table.pressure_at(5999) == 1001 * 999 // 1000
    assert table.pressure_at(6001) == 1001 + -11 // 3 == 997
    assert table.pressure_at(7000) == 990
    assert table.slope_at([4000, 5500, 5999, 6000, 6003, 7000]).tolist() == [0, 1001, 1001, -3667, -3667, 0]
    h = np.arange(4990, 6010)
    expected = []
    for one in h.tolist():
        one = min(max(one, 5000), 6003)
        (h0, p0), (h1, p1) = ((5000, 0), (6000, 1001)) if one < 6000 else ((6000, 1001), (6003, 990))
        expected.append(p0 + (p1 - p0) * (one - h0) // (h1 - h0))
    assert table.pressure_at(h).tolist() == expected
    assert table.pressure_at(h).dtype == np.int64


heights = st.lists(st.integers(0, 65535), min_size=2, max_size=64, unique=True).map(sorted)


@given(heights, st.integers(0, 2**32))
def test_bytes_there_and_back(height, seed):
    pressure = np.random.default_rng(seed).integers(0, 32768, len(height))  # never too steep for 32 bits
    table = Table(height, pressure)
    again = Table.from_bytes(table.to_bytes())
    assert again == table
    assert hash(again) == table.crc32 == zlib.crc32(table.to_bytes())
    assert len(table.to_bytes()) == 4 * len(table)


def test_bytes_are_little_endian_pairs():
    assert Table([0x1234, 0x5678], [0x9ABC, 0xDEF0]).to_bytes() == bytes.fromhex("3412bc9a7856f0de")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Table([5000, 5000], [0, 1]), "heights must rise"),
        (lambda: Table([5000], [0]), "2 to 64 knots, not 1"),
        (lambda: Table(range(65), range(65)), "not 65"),
        (lambda: Table([5000, 6000], [0, 70000]), "16-bit"),
        (lambda: Table([5000, 6000], [-1, 7]), "16-bit"),
        (lambda: Table([5000, 6000.5], [0, 7]), "whole numbers"),
        (lambda: Table([5000, 6000, 7000], [0, 7]), "as many pressures"),
        (lambda: Table([0, 65535], [0, 65535]), "overflow"),
        (lambda: Table.from_bytes(b"123"), "4 bytes per knot"),
        (lambda: Table([5000, 6000], [0, 7]).max_error(), "without a balloon"),
        (lambda: build_table(YeohBalloon(), knots=65), "knots is 65"),
        (lambda: build_table(YeohBalloon(), height_mm=(5, 5.01)), "must span"),
        (lambda: build_table(YeohBalloon(mu=200e3)), "kPa, but a table ends at 65.535 kPa"),
    ],
)
def test_impossible_tables_are_refused_in_a_sentence(make, says):
    with pytest.raises(InvalidInput, match=says) as refusal:
        make()
    assert str(refusal.value).endswith(".")
