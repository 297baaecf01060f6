"""Fits: does the stated uncertainty cover the truth, and are doubts spoken?"""

import warnings

import numpy as np
import pytest

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import (
    IdentifiabilityWarning,
    LackOfFitWarning,
    Noise,
    YeohBalloon,
    fit_measurements,
    fit_sheet,
    fit_yeoh,
    simulate_sheet,
)

SHEETS = 200
noisy = pytest.mark.filterwarnings("ignore::bubbleskin.membrane.IdentifiabilityWarning")


def truth(balloon: YeohBalloon) -> np.ndarray:
    """The constants that a fit with the nominal 1 mm wall should find."""
    return np.array([balloon.mu, balloon.c2, balloon.c3]) * balloon.thickness / 1e-3


def one_bubble(seed: int, balloon: YeohBalloon | None = None, **options):
    measured, (true,) = simulate_sheet(1, balloon=balloon, spread=0.0, seed=seed, **options)
    return measured, true


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["each bubble", "shared prior"])
def test_intervals_cover_the_truth(kind):
    """200 sheets of seven bubbles, 0.15 kPa and 0.05 mm of noise: at least 93 % for every constant."""
    inside = []
    for seed in range(SHEETS):
        measured, true = simulate_sheet(7, heights_mm=np.linspace(5.4, 13.0, 12), repeats=2, seed=seed)
        if kind == "shared prior":
            fits = list(fit_sheet(measured.bubble, measured.height, measured.pressure).values())
        else:
            ones = [measured.of(n) for n in range(7)]
            fits = [fit_yeoh(one.height, one.pressure) for one in ones]
        for fit, balloon in zip(fits, true, strict=True):
            low, high = fit.interval().T
            inside.append((low <= truth(balloon)) & (truth(balloon) <= high))
    covered = np.mean(inside, axis=0)
    print(f"{kind}: mu {covered[0]:.1%}, C2 {covered[1]:.1%}, C3 {covered[2]:.1%} of {len(inside)} fits")
    assert covered.min() >= 0.93


@pytest.mark.medium
def test_intervals_are_not_just_wide():
    measured, true = one_bubble(1, heights_mm=np.linspace(5.4, 13.0, 14), repeats=3)
    low, high = fit_yeoh(measured.height, measured.pressure).interval().T
    assert np.all((high - low) / 2 / truth(true) < [0.02, 0.2, 0.08])


@pytest.mark.parametrize("wall", ["thin", "thick"])
@pytest.mark.parametrize("mu", [15e3, 39.62e3, 79.24e3])
def test_exact_points_give_the_exact_constants(wall, mu):
    balloon = YeohBalloon(mu=mu, wall=wall)
    h = np.linspace(1.05, 2.7, 20) * balloon.rest_height
    fit = fit_yeoh(h, balloon.pressure_at_height(h), wall=wall)
    np.testing.assert_allclose(fit.parameters, [mu, balloon.c2, balloon.c3], rtol=1e-6)
    assert np.max(np.abs(fit.residuals)) < 0.01


@noisy
@pytest.mark.parametrize("surface", ["inner", "mid", "outer"])
def test_noise_below_rest_is_no_trouble(surface):
    balloon = YeohBalloon(wall="thick", surface=surface)
    h = np.linspace(0.999, 2.6, 30) * balloon.rest_height
    exact = balloon.pressure_at_height(np.maximum(h, balloon.rest_height))
    h[0] *= 0.91  # an outer surface that low would have closed the bubble
    fit = fit_yeoh(h, exact, wall="thick", surface=surface)
    assert np.isfinite(fit.residuals).all()
    assert fit.parameters.mu == pytest.approx(balloon.mu, rel=0.02)


@pytest.mark.slow
@noisy
def test_noise_in_height_does_not_bias():
    """Height noise alone, ten times the usual: regression of P on h would tilt the steep part."""
    errors = []
    for seed in range(60):
        measured, true = one_bubble(seed, noise=Noise(0.3e-3, 10.0), heights_mm=np.linspace(5.4, 13.0, 40), repeats=1)
        fit = fit_yeoh(measured.height, measured.pressure, noise=Noise(0.3e-3, 10.0))
        errors.append((fit.parameters - truth(true)) / np.sqrt(np.diag(fit.covariance)))
    assert np.all(np.abs(np.mean(errors, axis=0)) < 3.5 / np.sqrt(60))


@noisy
def test_outliers_are_ignored_and_named():
    measured, true = one_bubble(2)
    clean = fit_yeoh(measured.height, measured.pressure)
    pressure, height = measured.pressure.copy(), measured.height.copy()
    pressure[[3, 17, 30]] += [8e3, -6e3, 5e3]  # a regulator that slipped
    height[[8, 36]] += [2.5e-3, 3e-3]  # a bubble that slid off its barb
    fit = fit_yeoh(height, pressure)
    assert np.flatnonzero(fit.outliers).tolist() == [3, 8, 17, 30, 36]
    moved = np.abs(np.subtract(fit.parameters, clean.parameters)) / np.sqrt(np.diag(clean.covariance))
    assert moved.max() < 1
    naive = fit_yeoh(height, pressure, noise=Noise(outliers=False))
    assert np.max(np.abs(np.subtract(naive.parameters, truth(true)) / np.sqrt(np.diag(clean.covariance)))) > 5


def test_a_fifth_of_outliers_is_survived():
    rng = np.random.default_rng(0)
    measured, true = one_bubble(5, repeats=4)
    pressure = measured.pressure.copy()
    wrong = rng.choice(pressure.size, pressure.size // 5, replace=False)
    pressure[wrong] *= rng.uniform(0.3, 0.8, wrong.size)
    fit = fit_yeoh(measured.height, pressure)
    assert np.all(np.abs(np.subtract(fit.parameters, truth(true))) < 4 * np.sqrt(np.diag(fit.covariance)))


def test_c3_is_never_negative():
    """The published uniaxial fit has C3 = -3 Pa; free regression on such a curve goes below zero."""
    h = np.linspace(5.2, 12, 40) * 1e-3
    shape = YeohBalloon(mu=15.58e3, c2=127.0, c3=0.0)
    stiff = YeohBalloon(mu=15.58e3, c2=127.0, c3=3.1)
    pressure = 2 * shape.pressure_at_height(h) - stiff.pressure_at_height(h)  # C3 = -3.1
    fit = fit_yeoh(h, pressure)
    assert fit.parameters.c3 == 0.0
    assert fit.interval()[2, 0] == 0.0
    assert fit.balloon.pressure(6.0) > 0


@pytest.mark.slow
def test_bands_cover_the_curve():
    h = np.linspace(5.5, 13.5, 33) * 1e-3
    inside_p, inside_h = [], []
    for seed in range(150):
        measured, true = one_bubble(seed, heights_mm=np.linspace(5.4, 13.0, 12), repeats=2)
        fit = fit_yeoh(measured.height, measured.pressure)
        exact = true.pressure_at_height(h)
        low, high = fit.pressure_band(h)
        inside_p.append((low <= exact) & (exact <= high))
        low, high = fit.height_band(exact)
        inside_h.append((low <= h) & (h <= high))
    assert np.mean(inside_p) >= 0.93
    assert np.mean(inside_h) >= 0.93


def test_height_band_is_wide_on_the_plateau_and_narrow_off_it():
    measured, _ = one_bubble(0)
    fit = fit_yeoh(measured.height, measured.pressure)
    widths = np.diff(fit.height_band(np.array([17e3, 21.3e3, 27e3])), axis=0)[0]
    assert widths[1] > 4 * widths[0]
    assert widths[1] > 4 * widths[2]
    low, high = fit.height_band(21.3e3)
    assert type(low) is type(high) is float


def test_plateau_alone_is_doubted():
    measured, _ = one_bubble(0, heights_mm=np.linspace(7.0, 9.0, 14))
    with pytest.warns(IdentifiabilityWarning, match=r"Measure below 6\.5 mm and above 10\.5 mm"):
        fit = fit_yeoh(measured.height, measured.pressure)
    assert "do not determine all three constants" in fit.notes[0]
    assert fit.notes[0] in fit.report()


def test_a_range_too_short_for_its_noise_is_doubted():
    measured, _ = one_bubble(0, heights_mm=np.linspace(5.5, 8.8, 10), repeats=1)
    with pytest.warns(IdentifiabilityWarning, match=r"Measure above 10\.5 mm"):
        fit_yeoh(measured.height, measured.pressure)
    measured, _ = simulate_sheet(3, heights_mm=np.linspace(7.0, 9.0, 5), repeats=1)
    with pytest.warns(IdentifiabilityWarning, match="bubbles 0, 1, 2: the heights measured"):
        sheet = fit_sheet(measured.bubble, measured.height, measured.pressure)
    assert all(fit.notes for fit in sheet.values())
    assert sheet.report().count("note: bubble") == 3


@pytest.mark.medium
def test_good_data_is_not_doubted():
    for seed in range(20):
        measured, _ = one_bubble(seed, heights_mm=np.linspace(5.4, 13.0, 12), repeats=1)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert fit_yeoh(measured.height, measured.pressure).notes == ()


@noisy
def test_triplicates_tell_noise_from_a_wrong_model():
    measured, _ = one_bubble(0, heights_mm=np.linspace(5.4, 13.0, 15))
    right = fit_yeoh(measured.height, measured.pressure, step=measured.step)
    assert right.repeats.settings == 15
    assert right.repeats.p_value > 0.01
    assert right.repeats.height_sd == pytest.approx(0.05e-3, rel=0.3)
    assert right.repeats.pressure_sd == pytest.approx(150, rel=0.3)
    off = measured.pressure * (1 + 0.05 * np.sin(2e3 * np.linspace(5.4e-3, 13e-3, 15)))[measured.step]
    plain = fit_yeoh(measured.height, off)
    with pytest.warns(LackOfFitWarning, match="model, wall or calibration is off"):
        wrong = fit_yeoh(measured.height, off, step=measured.step)
    assert wrong.repeats.p_value < 1e-6
    assert np.all(np.diag(wrong.covariance) > np.diag(plain.covariance))


def test_sheet_lends_shape_to_a_bubble_with_few_points():
    measured, true = simulate_sheet(7, heights_mm=np.linspace(5.4, 13.0, 14), seed=11)
    poor = measured.bubble == 3
    keep = ~poor | (poor & np.isin(measured.step, [2, 5, 8]) & (np.arange(len(measured)) % 3 == 0))
    sheet = fit_sheet(measured.bubble[keep], measured.height[keep], measured.pressure[keep])
    fit = sheet[3]
    assert fit.residuals.size == 3
    h = np.linspace(6, 13, 50) * 1e-3
    exact = true[3].pressure_at_height(h)
    assert np.max(np.abs(fit.balloon.pressure_at_height(h) / exact - 1)) < 0.03
    low, high = fit.interval().T
    assert np.all((low <= truth(true[3])) & (truth(true[3]) <= high))
    widths = {n: np.diff(sheet[n].interval()[0])[0] for n in sheet}
    assert widths[3] > 2 * widths[2]


def test_sheet_keeps_bubbles_apart():
    measured, true = simulate_sheet(7, spread=0.2, seed=3)
    sheet = fit_sheet(measured.bubble, measured.height, measured.pressure)
    found = np.array([fit.parameters.mu for fit in sheet.values()])
    exact = np.array([truth(balloon)[0] for balloon in true])
    assert np.max(np.abs(found / exact - 1)) < 0.02
    assert len(sheet.balloons) == 7
    assert sheet.mean.mu == pytest.approx(exact.mean(), rel=0.02)


def test_outliers_of_a_sheet_are_ignored_and_named():
    measured, _ = simulate_sheet(7, seed=3)
    pressure = measured.pressure.copy()
    pressure[[5, 100, 250]] += [6e3, -5e3, 8e3]
    sheet = fit_sheet(measured.bubble, measured.height, pressure)
    assert np.concatenate([fit.outliers for fit in sheet.values()]).nonzero()[0].tolist() == [5, 100, 250]
    assert sheet.scale == pytest.approx(1, abs=0.15)


@noisy
def test_c3_of_a_sheet_is_never_negative():
    soft = YeohBalloon(mu=15.8e3, c2=127.0, c3=0.0)
    measured, _ = simulate_sheet(7, balloon=soft, spread=0.05, heights_mm=np.linspace(5.4, 13.0, 12), repeats=1, seed=1)
    h = np.maximum(measured.height, soft.rest_height)
    stiffening = YeohBalloon(mu=15.8e3, c2=127.0, c3=8.0).pressure_at_height(h) - soft.pressure_at_height(h)
    sheet = fit_sheet(measured.bubble, measured.height, measured.pressure - stiffening)  # C3 = -8 Pa
    assert [fit.parameters.c3 for fit in sheet.values()] == [0.0] * 7


def test_measurements_choose_the_fit():
    measured, _ = simulate_sheet(2, seed=0)
    assert sorted(fit_measurements(measured)) == [0, 1]
    assert fit_measurements(measured.of(1)).residuals.size == 42
    with pytest.warns(LackOfFitWarning):
        assert fit_measurements(measured, pooled=True).residuals.size == 84


GOOD_H = np.linspace(5.5e-3, 12e-3, 10)
GOOD_P = YeohBalloon().pressure_at_height(GOOD_H)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"height": GOOD_H[:3], "pressure": GOOD_P[:3]}, "3 points cannot fix three constants"),
        ({"height": -GOOD_H}, "height is -0.012 m"),
        ({"pressure": GOOD_P * np.nan}, "nan at index"),
        ({"pressure": -GOOD_P}, "suction"),
        ({"height": GOOD_H * 1e3}, "divide mm by 1000"),
        ({"height": GOOD_H[:5]}, "equal length"),
        ({"wall": "thick", "surface": "inner"}, "point 0 is 5.5 mm tall.*7 mm tall at rest"),
        ({"height": np.full(10, 5.01e-3)}, "no inflation to fit"),
        ({"pressure": np.linspace(60e3, 1e3, 10)}, "shear modulus of -"),
        ({"thickness": 0}, "thickness is 0 m"),
        ({"noise": Noise(pressure_sd=0)}, "pressure_sd is 0"),
        ({"noise": Noise(height_sd=[1e-3, 1e-3])}, "one number or one per point"),
        ({"step": [1, 2]}, "each of the 10 points"),
    ],
)
def test_impossible_points_are_refused_in_a_sentence(arguments, says):
    with pytest.raises(InvalidInput, match=says) as refusal:
        fit_yeoh(**{"height": GOOD_H, "pressure": GOOD_P, **arguments})
    assert str(refusal.value).endswith(".")
