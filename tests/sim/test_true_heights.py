"""Heights are true on rubber that has a memory, softens and snaps through, once the device knows its valves and its sheet.

The plant is `rubber=real`, which shares nothing with the firmware. Tables and trim are what a good calibration would leave:
the plant's own figures.
"""

import numpy as np
import pytest

import bubbleskin as bs

AIR_BY_LEAK = 16e9  # of a leak in J/s for each Pa: µJ/s for each kPa, /16, as the trim has it
NOMINAL_CONDUCTANCE = 3.8e-11
SURE = {"flow_sd": 400, "curve_sd": 6554}  # 0.6 % and 10 %, /65536


def connect(options="", told=None, **trim):
    """A calibrated wristband of real rubber, its bubbles apart, that has been inflated once; `told` are settings."""
    skin = bs.connect(f"sim://wristband7?contact=0&rubber=real{options}")
    plant = skin.simulated.plant.parameters
    skin.upload_tables(
        [
            bs.build_table(bs.YeohBalloon(mu=mu, c2=c2, c3=c3, thickness=thickness, radius=radius, wall="thin"))
            for mu, c2, c3, thickness, radius in zip(
                plant.mu, plant.c2, plant.c3, plant.thickness, plant.radius, strict=True
            )
        ]
    )
    nominal = skin.trim()
    figures = {
        "opens_us": 1e6 * plant.fill_opening,
        "closes_us": 1e6 * plant.fill_closing,
        "flow_gain": nominal.flow_gain * plant.fill_conductance / NOMINAL_CONDUCTANCE,
        "vent_opens_us": 1e6 * plant.vent_opening,
        "vent_closes_us": 1e6 * plant.vent_closing,
        "vent_flow_gain": nominal.flow_gain * plant.vent_conductance / NOMINAL_CONDUCTANCE,
        "leak": AIR_BY_LEAK * plant.leak,
        **{name: np.full(7, value) for name, value in SURE.items()},
        **trim,
    }
    skin.upload_trim(bs.Trim(nominal.zero, **{name: np.rint(value).astype(int) for name, value in figures.items()}))
    skin.configure(**(told or {}))
    skin.show(np.full(7, 13.0), wait=False)
    skin.sleep(1.0)
    skin.vent()
    skin.sleep(1.0)
    return skin


def hold(skin, heights, seconds=1.0):
    """How far true heights are from those asked, and the state, after so long."""
    skin.show(heights, wait=False)
    skin.sleep(seconds)
    return skin.simulated.alone_mm - heights, skin.state()


@pytest.mark.medium
@pytest.mark.parametrize(
    ("sheet", "spread"), [("paper", 0.0), ("paper", 0.1), ("stiff25", 0.0), ("stiff50", 0.0), ("ecoflex-00-30", 0.1)]
)
def test_heights_are_true_on_every_sheet(sheet, spread):
    rng = np.random.default_rng(1)
    with connect(f"&sheet={sheet}&spread={spread}&seed=2") as skin:
        for _ in range(3):
            off, state = hold(skin, rng.uniform(5.5, 12.5, 7))
            assert np.abs(off).max() < (0.3 if spread else 0.15)  # nobody has told it how much air its lines hold
            assert set(state.status) <= {"settled"}
            if not spread:
                assert (np.abs(skin.simulated.alone_mm - state.height_mm) < 2 * state.sd_mm).all()


@pytest.mark.medium
def test_memory_is_not_taken_for_height():
    with connect("&sheet=stiff50") as skin:
        for height in (12.0, 6.0, 12.0, 6.0):
            off, _ = hold(skin, np.full(7, height), 2.0)
            assert np.abs(off).max() < 0.2


@pytest.mark.medium
@pytest.mark.parametrize("kpa", [80, 105])
def test_air_of_another_pressure_is_a_setting(kpa):
    shape = np.linspace(6.0, 12.0, 7)
    with connect(f"&atmosphere_kpa={kpa}", {"atmosphere_kpa": kpa}) as skin:
        assert np.abs(hold(skin, shape)[0]).max() < 0.15
    if kpa == 80:
        with connect("&atmosphere_kpa=80") as skin:
            assert np.abs(hold(skin, shape)[0]).max() > 0.15


@pytest.mark.slow
def test_a_leak_that_is_known_is_made_up_for():
    shape = np.linspace(7.0, 12.0, 7)  # lower, so much is a fault
    with connect("&leak=0.01") as skin:
        assert np.abs(hold(skin, shape, 10.0)[0]).max() < 0.25
    with connect("&leak=0.01", leak=np.zeros(7)) as skin:
        assert np.abs(hold(skin, shape, 10.0)[0]).max() > 0.25


@pytest.mark.medium
def test_who_does_not_know_says_so():
    """Nobody has measured valves and sheet, as far as the device knows: the more air is metered, the less sure."""
    with connect(flow_sd=np.full(7, 3900), curve_sd=np.full(7, 16384)) as skin:
        off, state = hold(skin, np.linspace(6.0, 12.0, 7))
        assert state.status == ("settled",) * 3 + ("unsure",) * 4
        assert (np.diff(state.sd_mm) > 0).all()
        assert np.abs(off).max() < 0.2, "it is there all the same"
        assert state.arrived
        assert not state.settled


@pytest.mark.medium
@pytest.mark.parametrize("sheet", ["ecoflex-00-30", "stiff50"])
def test_what_empties_through_a_plateau_has_no_fault(sheet):
    """There the pressure of a bubble that loses air stays, or rises."""
    with connect(f"&sheet={sheet}") as skin:
        for height in (9.0, 12.5):
            skin.show(np.full(7, height), wait=False)
            skin.sleep(1.0)
            skin.vent()
            skin.sleep(1.5)
            assert not any(skin.state().faults)
            assert skin.simulated.alone_mm.max() < 5.3


@pytest.mark.slow
def test_a_bubble_that_has_become_unsure_is_emptied_before_it_goes_elsewhere():
    rng = np.random.default_rng(3)
    with connect("&sheet=stiff50", {"rezero_mm": 0.15}, flow_sd=np.full(7, 1200)) as skin:
        lowest, surest = [], []
        for _ in range(8):
            skin.show(rng.uniform(8.0, 12.0, 7), wait=False)
            heights = []
            for _ in range(30):
                skin.sleep(0.02)
                heights.append(skin.simulated.alone_mm)
            skin.sleep(0.6)
            lowest.append(np.min(heights, axis=0))
            surest.append(skin.state().sd_mm)
        assert (np.array(lowest[1:]) < 5.5).any(), "none was emptied"
        assert (np.array(lowest[1:]) > 7.5).any(), "all were, always"
    with connect("&sheet=stiff50", {"rezero_mm": 0.0}, flow_sd=np.full(7, 1200)) as skin:
        for _ in range(4):
            skin.show(rng.uniform(8.0, 12.0, 7), wait=False)
            skin.sleep(0.3)
            assert skin.simulated.alone_mm.min() > 7.5 or _ == 0
            skin.sleep(0.6)
