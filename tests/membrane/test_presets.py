"""Named bubbles say where they come from."""

import numpy as np
import pytest

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import PRESETS, YeohBalloon, preset

# Engineering strain and stress (MPa) of Ecoflex 00-30: every tenth row or so, up to stretch 3, of "Ecoflex
# 00-30.csv" in the Soft Robotics Materials Database (Marechal et al. 2021).
UNIAXIAL = """
0.09084 0.00343  0.18181 0.00682  0.27272 0.00996  0.36364 0.01235  0.45455 0.01524  0.54545 0.01792
0.63637 0.02027  0.72727 0.02293  0.81818 0.02484  0.90909 0.02689  0.99999 0.02972  1.09091 0.03096
1.18182 0.03336  1.27272 0.03503  1.36364 0.03712  1.45454 0.0396   1.54545 0.04149  1.63637 0.04332
1.72727 0.04558  1.81818 0.04797  1.90909 0.05073  2.0     0.05239
"""


def test_every_preset_has_a_source_and_is_a_bubble():
    for name, one in PRESETS.items():
        assert one.name == name
        assert len(one.source) > 40
        assert preset(name) is one.balloon
        assert one.balloon.pressure(2.0) > 0
    assert preset("paper") == YeohBalloon()


def test_ecoflex_preset_is_the_fit_of_its_data():
    strain, stress = np.array(UNIAXIAL.split(), dtype=float).reshape(-1, 2).T
    x = 1 + strain
    J = x**2 + 2 / x - 3
    design = 2 * (x - x**-2)[:, None] * np.stack([np.ones_like(J), 2 * J, 3 * J**2], axis=1)
    free = np.linalg.lstsq(design, stress * 1e6, rcond=None)[0]
    np.testing.assert_allclose(free, [7.79e3, 127, -3.06], rtol=0.01)  # C3 < 0: what must not be used
    bounded = np.linalg.lstsq(design[:, :2], stress * 1e6, rcond=None)[0]
    ours = preset("ecoflex-00-30")
    np.testing.assert_allclose([ours.c1, ours.c2, ours.c3], [*bounded, 0], rtol=2e-3)


def test_unknown_preset_is_refused():
    with pytest.raises(InvalidInput, match="there are paper, ecoflex-00-30"):
        preset("latex")
