"""The profile of the chip's tick against what the chip itself says of its ticks."""

import pytest

pytestmark = pytest.mark.chip

NAME = "wristband7"
BIN_US = 100.0
"""Of the histogram of TICKS, whose times are upper edges."""


def test_a_profile_adds_up_to_what_the_firmware_measures(uf2):
    """The firmware times its ticks from the moment the period began, up to its last look at the clock."""
    from bubbleskin.bench.profile import LOAD, TICK, VIPER, profile
    from bubbleskin.bench.rp2040 import load

    uf2(NAME)
    found = profile(NAME, LOAD, 0.2)
    assert found.tick_us == pytest.approx(load(NAME, 0.2).mean_us - BIN_US / 2, rel=0.12)
    own = {name: spent for name, spent, _ in found.by_function()}
    assert sum(own.values()) == pytest.approx(found.tick_us)
    assert found.by_function()[0][0] == "app: App._control"
    assert found.calls[TICK] == pytest.approx(1.0, abs=0.1)
    assert "control/estimate: estimate" not in found.calls, "viper is not run by the interpreter"
    assert 0.1 < found.by_kind()[VIPER] / found.tick_us < 0.5
