"""Springs found again from shapes made with them."""

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.errors import InvalidInput

LAYOUT = bs.Layout.grid(1, 3)
PATHS = (
    [[0, 26e3, 0], [25e3, 26e3, 25e3]],
    [[26e3, 0, 25e3], [26e3, 25e3, 25e3]],
    [[27e3, 27e3, 0]],
    [[29e3, 0, 0], [29e3, 24e3, 0]],
)


def made(kz, kxy, kc, rng=None):
    model = bs.CompliantContact(LAYOUT, kz=kz, kxy=kxy, kc=kc)
    for path in PATHS:
        height = model.settle(path).height_mm
        yield bs.Measured(path, height if rng is None else height + rng.normal(0, 0.02, 3))


@pytest.mark.medium
@pytest.mark.parametrize("true", [(10, 50, 300), (14, 60, 220)])
def test_known_springs_are_recovered(true):
    fit = bs.fit_contact(made(*true), LAYOUT, sd_mm=0.005)
    np.testing.assert_allclose([fit.kz, fit.kxy, fit.kc], true, rtol=0.02)
    assert np.abs(fit.residual_mm).max() < 0.01
    assert fit.contact.kc == fit.kc


@pytest.mark.slow
def test_noise_stays_within_what_is_said_of_it():
    true = np.array([14, 60, 220])
    fit = bs.fit_contact(made(*true, np.random.default_rng(1)), LAYOUT, sd_mm=0.02)
    off = np.abs(np.log([fit.kz, fit.kxy, fit.kc] / true))
    assert (off < 3 * np.log(fit.factor)).all()


def test_a_bubble_alone_says_nothing_of_springs():
    path = [[25e3, 0, 0]]
    alone = bs.CompliantContact(LAYOUT).settle(path).height_mm
    fit = bs.fit_contact([bs.Measured(path, alone)], LAYOUT)
    assert fit.open == ("kz", "kxy", "kc")
    assert fit.kz == pytest.approx(10, rel=0.01)


def test_nonsense_is_refused():
    with pytest.raises(InvalidInput, match="at least one shape"):
        bs.fit_contact([], LAYOUT)
    with pytest.raises(InvalidInput, match="has 2 and 3"):
        bs.fit_contact([bs.Measured([[1, 1]], [5, 5, 5])], LAYOUT)
    with pytest.raises(InvalidInput, match="at least one height"):
        bs.fit_contact([bs.Measured([[1, 1, 1]], [np.nan] * 3)], LAYOUT)
