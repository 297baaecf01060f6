"""Plants that the model does not know: other air, other rubber, neighbours, another board; how far heights are off then."""

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.slow

REAL = "spread=0.1&rubber=real"


@pytest.mark.parametrize(
    ("url", "most_mm"),
    [
        ("wristband7?contact=0&seed=1", 0.06),
        ("wristband7?contact=0&seed=2&spread=0.1", 0.12),
        (f"wristband7?contact=0&seed=3&{REAL}", 0.12),
        (f"wristband7?contact=0&seed=5&{REAL}&viscosity=2", 0.14),
        (f"wristband7?contact=0&seed=5&{REAL}&gas_c=35", 0.14),
        (f"wristband7?contact=0&seed=6&{REAL}&atmosphere_kpa=98", 0.16),
        (f"wristband7?seed=7&{REAL}", None),
        (f"wristband19?contact=0&seed=2&{REAL}", 0.12),
    ],
)
def test_heights(sheets, url, most_mm):
    with bs.connect(f"sim://{url}") as skin:
        skin.sleep(1.0)
        found = skin.calibrate(save=False)
        assert found.device_s <= (40.0 if skin.info.bubbles > 7 else 20.0)
        assert len(found.accepted) == skin.info.bubbles
        if most_mm is not None:  # together, neighbours press: that is no calibration's matter
            assert sheets.rms(sheets.errors_mm(skin)) < most_mm


def test_an_atmosphere_that_is_told(sheets):
    with bs.connect(f"sim://wristband7?contact=0&seed=6&{REAL}&atmosphere_kpa=84") as skin:
        skin.sleep(1.0)
        skin.configure(atmosphere_kpa=84.0)
        found = skin.calibrate(save=False)
        assert found.atmosphere_kpa == pytest.approx(84.0)
        assert len(found.accepted) == 7
        assert sheets.rms(sheets.errors_mm(skin)) < 0.14


def test_another_rubber_whose_tables_it_has(sheets):
    with bs.connect(f"sim://wristband7?contact=0&seed=2&{REAL}&sheet=ecoflex-00-30") as skin:
        skin.sleep(1.0)
        found = skin.calibrate(save=False)
        assert found.accepted == ()
        assert found[0].verdict.reasons == ("other rubber",)
        skin.clear_faults()
        skin.vent()
        skin.upload_tables(bs.build_table(bs.preset("ecoflex-00-30")))
        skin.calibrate(save=False)
        assert sheets.rms(sheets.errors_mm(skin)) < 0.15


def test_a_second_calibration_is_like_the_first(sheets):
    with sheets.skin_of(sheets.real(seed=4)) as skin:
        first, second = (skin.calibrate(save=False) for _ in range(2))
        for one, other in zip(first.bubbles, second.bubbles, strict=True):
            sd = np.hypot(one.estimate.sd, other.estimate.sd)
            assert (np.abs(one.estimate.values - other.estimate.values) < 4.0 * sd + 1e-3).all()
        assert sheets.rms(sheets.errors_mm(skin)) < 0.15
