"""The paper's Eq. 8."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bubbleskin as bs
from bubbleskin.errors import InvalidInput

RIGID = bs.RigidContact(bs.Layout.hexagon(1))
radii = st.lists(st.floats(2.5, 8.0), min_size=7, max_size=7).map(np.array)


@pytest.mark.medium
@given(radii, st.permutations(range(7)), st.integers(0, 6))
def test_nobody_overlaps_and_nobody_gets_more_than_asked(wanted, order, cut):
    found = RIGID.inflate(wanted, [*order[:cut], order[cut:]])
    gap = bs.Layout.hexagon(1).positions_mm
    distance = np.linalg.norm(gap[:, None] - gap[None], axis=2) + 1e9 * np.eye(7)
    assert (found.radius_mm[:, None] + found.radius_mm[None] <= distance + 1e-6).all()
    assert (found.radius_mm <= wanted + 1e-9).all()
    short = found.radius_mm < wanted - 1e-6
    assert (found.limited_by[short] >= 0).all()
    for bubble in np.flatnonzero(found.limited_by >= 0):  # and whoever is said to be in the way touches it
        other = found.limited_by[bubble]
        assert found.radius_mm[bubble] + found.radius_mm[other] == pytest.approx(distance[bubble, other], abs=1e-6)


def test_first_come_takes_the_room():
    ring = [1, 2, 3, 4, 5, 6]
    first = RIGID.inflate(6.0, [0, ring])
    assert first.height_mm[0] == pytest.approx(12)
    np.testing.assert_allclose(first.height_mm[1:], 8, atol=1e-6)
    assert (first.limited_by[1:] == 0).all()
    np.testing.assert_allclose(RIGID.inflate(6.0, [ring, 0]).height_mm, 10, atol=1e-6)
    np.testing.assert_allclose(RIGID.inflate(6.0).height_mm, 10, atol=1e-6)


def test_no_order_lifts_the_centre_above_what_it_is_alone():
    """Why Eq. 8 cannot explain the paper's 14 mm."""
    rng = np.random.default_rng(0)
    assert max(RIGID.inflate(6.0, rng.permutation(7)).height_mm[0] for _ in range(50)) <= 12 + 1e-9


def test_limits_name_the_neighbour():
    limits = RIGID.limits([2.5, 7, 2.5, 2.5, 2.5, 2.5, 2.5])
    assert limits.radius_mm[0] == pytest.approx(3)
    assert limits.neighbour[0] == 1
    assert bs.RigidContact(bs.Layout.hexagon(0)).limits([3]).radius_mm[0] == np.inf


def test_who_shrinks_makes_room():
    start = RIGID.inflate(6.0, [0]).radius_mm
    found = RIGID.inflate([2.5, 6, 2.5, 2.5, 6, 2.5, 2.5], [0, [1, 4]], start)
    np.testing.assert_allclose(found.radius_mm[[0, 1, 4]], [2.5, 6, 6], atol=1e-6)


def test_nonsense_is_refused():
    with pytest.raises(InvalidInput, match="6 radii for 7"):
        RIGID.inflate(np.ones(6))
    with pytest.raises(InvalidInput, match="bubbles are 0 to 6"):
        RIGID.inflate(6.0, [7])
    with pytest.raises(InvalidInput, match="even at rest"):
        bs.RigidContact(bs.Layout.hexagon(1, pitch_mm=4))
