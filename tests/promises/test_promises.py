"""The promises of docs/safety.md against whatever comes, in any order, and in courses of events that have broken one.

The judge is `World` of conftest.py; that it sees each promise broken is shown in test_controls.py.
"""

import os

import pytest

SCENARIOS = int(os.environ.get("BUBBLESKIN_SCENARIOS", "2000"))
"""Of the slow test: `BUBBLESKIN_SCENARIOS=20000 pytest -n 2 tests/promises -m slow -k for_long` looks for longer."""
SHARES = 8
"""Tests that the scenarios are shared out to, each with other ones, so that they can run beside each other."""
FEW = 5

of_the_judge = pytest.mark.promise(
    "pressure-limit",
    "height-limit",
    "reservoir-limit",
    "silence",
    "emergency-stop",
    "fill-valve-time",
    "isolation",
    "fault-stays",
)


@of_the_judge
@pytest.mark.medium
def test_promises_are_kept(look):
    look(FEW)


@of_the_judge
@pytest.mark.slow
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("share", range(1, SHARES + 1))
def test_promises_are_kept_for_long(share, look):
    look(SCENARIOS // SHARES, share=share)


OVERFILLED = 128


@pytest.mark.promise("stuck-fill-valve")
@pytest.mark.medium
@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
@pytest.mark.parametrize("ramp_ms", [0, 500])
@pytest.mark.parametrize("after_s", [0.02, 0.34, 0.5])
def test_a_fill_valve_that_sticks_open_on_the_way_up_empties_the_reservoir(board, ramp_ms, after_s, world):
    """It is closed by nobody: its bubble passes the limit, and no vent valve takes away as much as it brings."""
    world = world(board)
    world.run(0.3)
    world.show([13700, *[5000] * (world.bubbles - 1)], ramp_ms)
    world.run(after_s)
    world.inject("fill_stuck", 0, 1.0)
    world.run(3.0)
    assert world.board.firmware.app.faults.board == OVERFILLED
    assert world.board.plant.supply_pa < 1e3
    assert world.board.plant.height_mm[0] < 5.1


@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
def test_a_reservoir_that_fills_meanwhile_takes_no_bubble_too_high(board, world):
    """After a power cut with an empty reservoir: whoever reckons flow with what its pressure was a while ago lets too much in."""
    world = world(board)
    world.inject_supply("supply_stuck", 2160.0)
    world.run(0.3)
    world.mend()
    world.run(0.3)
    world.cut_power()
    world.run(0.1)
    assert world.board.plant.supply_pa < 20e3
    world.show([14000, *[8000] * (world.bubbles - 1)], 0)
    world.run(2.0)
    assert world.board.plant.height_mm[0] > 13.8


LOW = [("supply_bias", -5e3), ("supply_bias", -8e3)]


@pytest.mark.promise("height-limit")
@pytest.mark.medium
@pytest.mark.parametrize("lie", [("supply_flat", 50e3), ("supply_flat", 55e3), ("supply_flat", 58e3), *LOW])
def test_a_reservoir_whose_sensor_lies_takes_no_bubble_too_high(lie, world):
    """Air is metered from what it says and may hide. docs/safety.md has the most that is printed here (`pytest -s -k lies`)."""
    most = 0.0
    for moving in (1, 2, 4, 7):
        for after_s in (0.005, 0.1, 0.3):
            one = world("wristband7", seed=3)
            one.show([14000] * moving + [4000] * (one.bubbles - moving), 0)
            one.run(after_s)
            one.inject_supply(*lie)
            for _ in range(300):
                one.run(one.board.tick_s)
                most = max(most, float(one.board.plant.height_mm.max()))
            one.board.close()
    print(f"{lie}: {most:.2f} mm")


@pytest.mark.medium
@pytest.mark.parametrize("moving", [2, 4, 5])
def test_nor_does_it_when_others_rise_after_the_first(moving, world):
    """Pump and valves are in balance for so long that what the reservoir hides is nearly forgotten."""
    for after_s in (0.3, 0.5, 0.7):
        one = world("wristband7", seed=0)
        one.show([14000] * moving + [4000] * (one.bubbles - moving), 0)
        one.run(0.005)
        one.inject_supply("supply_flat", 55e3)
        one.run(after_s)
        one.show([8000] * (one.bubbles - moving) + [14000] * moving, 0)
        one.run(1.1)  # which judges
        one.board.close()


def test_a_fill_valve_that_stays_open_is_found(world):
    """Judged alone: a firmware that leaves one open breaks the promise of height long before."""
    world = world()
    acting = world.board.pulses.copy()
    acting[3] = world.board.tick_s, 0.0
    for _ in range(200):
        world.judge(acting)
    with pytest.raises(world.Broken, match=r"^on-time: open for 1\.0"):
        list(map(world.judge, [acting] * 3))


@pytest.mark.parametrize("ticks", [10, 400])
def test_a_fault_that_goes_by_itself_is_found(ticks, world):
    world = world()
    world.ill.add(0)
    vented = [True] * world.bubbles
    well, ill = (0,) * world.bubbles, (16,) + (0,) * (world.bubbles - 1)
    for _ in range(ticks):
        world.judge_faults(ill, vented)
    with pytest.raises(world.Broken, match=r"^latching: "):
        world.judge_faults(well, vented)
    world.clear()
    if ticks < 200:
        with pytest.raises(world.Broken, match=r"^isolation: "):
            world.judge_faults(well, vented)
    else:
        world.judge_faults(well, vented)


@pytest.mark.promise("height-limit")
@pytest.mark.medium
@pytest.mark.parametrize("seed", [1, 2, 236])
@pytest.mark.parametrize("leak", [1e-6, 2e-6, 3e-6, 4e-6])
def test_a_leak_fills_no_bubble_past_what_is_asked(leak, seed, world):
    """A curve's error that was learned against what the pressure said made each correction worse than the one before: 15.3 mm."""
    one = world("wristband7", seed=seed)
    one.show([13500] * one.bubbles, 0)
    one.run(0.7)
    one.send("VENT")
    one.run(0.1)
    one.show([13500] * one.bubbles, 0)
    one.run(0.005)
    one.inject("leak", 0, leak)
    highest = 0.0
    for _ in range(30):
        one.run(0.05)
        highest = max(highest, float(one.board.plant.height_mm[0]))
    assert 13.0 < highest < 13.8
