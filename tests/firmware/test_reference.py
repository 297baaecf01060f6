"""What the membrane may correct: never by more than its slope here can tell, and nothing that was learned at an air not there."""

from array import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bubble_firmware.control.state_layout as layout
from bubble_firmware.control import reference
from bubble_protocol.schema.statuses import FAULT, MOVING
from bubbleskin import boards
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware

APART_MM = 1.5
"""By which one correction may move a bubble."""


class Resting:
    """A board whose bubbles are empty, and what its control keeps of each bubble, by name."""

    def __init__(self):
        self.firmware = InProcessFirmware(boards.load("wristband7"), 1)
        self.board = SimulatedBoard("wristband7", contact=False, firmware=self.firmware)
        self.bubbles = self.firmware.app.bubbles
        n = self.bubbles.count
        words = np.frombuffer(self.bubbles.state, np.int32)
        self.rows = words[layout.ROWS :][: n * layout.ROW_WORDS].reshape(n, layout.ROW_WORDS)
        self.run(0.3)

    def __getitem__(self, name):
        return self.rows[:, getattr(layout, name)]

    def run(self, seconds):
        for _ in range(round(seconds / self.board.tick_s)):
            self.firmware.app.deadman.host_activity()
            self.board.tick()


@pytest.fixture(scope="module")
def resting():
    return Resting()


@pytest.mark.promise("correction")
@pytest.mark.medium
@given(
    st.integers(100, 60_000),  # µJ
    st.integers(300, 26_000),
    st.integers(-4000, 4000),
    st.integers(-204_800, 204_800),
    st.integers(1000, 40_000),  # Pa
    st.integers(500, 40_000),
    st.integers(25_000, 300_000),  # µJ
)
def test_a_correction_moves_no_bubble_further_than_its_slope_can_tell(
    resting, air_sd, curve_sd, correlation, slope, pressure, here, air
):
    height_mm = 9.0
    per_mm = (101.325 + pressure / 1000) * np.pi * height_mm**2 / 2  # µJ, of a sphere that grows
    for name, value in {
        "AIR": air,
        "AIR_SD": air_sd,
        "AIR_SLOPE": round(per_mm * 64 / 1000),
        "CURVE_ERROR": 0,
        "CURVE_ERROR_SD": curve_sd,
        "CORRELATION": correlation,
        "DWELL_SLOPE": slope or 1,
        "CURVE_BEND": 0,
        "CURVE_PRESSURE": here,
        "QUIET_PRESSURE": pressure,
    }.items():
        resting[name][0] = value
    reference.correct(resting.bubbles.rows, resting.bubbles.state, 1)
    moved = abs(int(resting["AIR"][0]) - air)
    assert moved <= (APART_MM + 0.05) * per_mm or resting["AIR"][0] == 0


@pytest.mark.parametrize(("before", "pressure"), [(26_000, 12_000), (-26_000, 4_000)])
def test_the_curves_error_is_never_taken_for_more_than_rubber_can_differ(resting, before, pressure):
    """The pressure says that the curve is further off than before, and nothing else is in doubt."""
    for name, value in {
        "AIR": 90_000,
        "AIR_SD": 100,
        "AIR_SLOPE": 800,
        "CURVE_ERROR": before,
        "CURVE_ERROR_SD": 20_000,
        "CORRELATION": 0,
        "DWELL_SLOPE": 1,
        "CURVE_BEND": 0,
        "CURVE_PRESSURE": 8_000,
        "QUIET_PRESSURE": pressure,
    }.items():
        resting[name][0] = value
    reference.correct(resting.bubbles.rows, resting.bubbles.state, 1)
    assert abs(int(resting["CURVE_ERROR"][0])) == 26_214  # 0.4, * 65536


@pytest.mark.parametrize("air", [-1, 400_001, 500_000])
def test_no_bubble_has_more_air_than_any_can_hold_nor_less_than_none(resting, air):
    resting.run(0.1)
    for name, value in {"AIR": air, "STATUS": MOVING, "FAR_TICKS": 0, "EMPTY_TICKS": 0, "QUIESCENT": 0}.items():
        resting[name][0] = value
    counts = np.full(resting.bubbles.count + 1, boards.load("wristband7").SENSOR_ZERO + 400, np.uint16)
    resting.bubbles.step(counts, 60_000, 0)
    assert 0 <= resting["AIR"][0] <= 400_000


@pytest.mark.parametrize(("off", "kept"), [(0, True), (3000, True), (-60_000, False), (80_000, False)])
def test_what_was_learned_at_an_air_that_was_not_there_is_forgotten(off, kept):
    resting = Resting()
    board_sd = int(resting["CURVE_SD"][0])
    resting["AIR"][:] += off
    resting["AIR_SD"][:] = 30_000
    resting["CURVE_ERROR"][:] = -9000
    resting["CURVE_ERROR_SD"][:] = 500
    resting.run(0.5)
    assert (resting["AIR_SD"] < 1000).all()
    if kept:
        assert (resting["CURVE_ERROR"] == -9000).all()
        assert (resting["CURVE_ERROR_SD"] == 500).all()
    else:
        assert (resting["CURVE_ERROR"] == 0).all()
        assert (resting["CURVE_ERROR_SD"] == board_sd).all()


@pytest.mark.parametrize(
    ("changed", "ticks", "emptied"),
    [
        ({}, 1, True),
        ({}, 2, False),
        ({"AIR_SD": 100}, 1, False),
        ({"FLOW_SD": 1311}, 1, False),
        ({"STATUS": FAULT}, 1, False),
        ({"HEIGHT": 11_000 << 4}, 1, False),
        ({"HEIGHT": 13_000 << 4}, 1, False),
        ({"HEIGHT": 13_001 << 4}, 1, True),
    ],
    ids=["asked at once", "by a ramp", "known well", "metered badly", "vented", "a mm below", "a mm above", "and more"],
)
def test_a_bubble_whose_height_is_known_badly_is_emptied_first(resting, changed, ticks, emptied):
    resting.bubbles.set_atmosphere(101_325, 200)
    usual = {"AIR_SD": 30_000, "FLOW_SD": 600, "STATUS": MOVING, "HEIGHT": 9000 << 4}
    for name, value in {**usual, **changed}.items():
        resting[name][:] = value
    resting.bubbles.set_targets(array("i", [12_000] * resting.bubbles.count), 0, ticks)
    assert resting["REZERO"].astype(bool).tolist() == [emptied] * resting.bubbles.count
