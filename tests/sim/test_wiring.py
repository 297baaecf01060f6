"""Boards that are wired wrongly: what leads where, in URLs, files, and by the plant's truth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bubbleskin as bs
from bubbleskin.sim import plant_file
from bubbleskin.sim.parameters import PlantParameters
from bubbleskin.sim.plant import Plant
from bubbleskin.sim.wiring import FILL, VENT, Wires, Wiring, valve_names

N = 7
bubble = st.integers(0, N - 1)
pairs = st.lists(st.tuples(bubble, bubble).filter(lambda pair: pair[0] < pair[1]), max_size=2).map(tuple)
valve = st.sampled_from(valve_names(N))


def no_twice(swaps):
    parts = [part for pair in swaps for part in pair]
    return len(parts) == len(set(parts))


wirings = st.builds(
    Wiring,
    tubes=pairs.filter(no_twice),
    valves=st.lists(st.tuples(valve, valve), max_size=2).map(tuple).filter(no_twice),
    sensors=pairs.filter(no_twice),
    dead=st.lists(valve, max_size=2, unique=True).map(tuple),
    estop=st.sampled_from(["closed", "open"]),
)


@pytest.mark.medium
@given(wirings)
def test_a_plants_file_keeps_the_wiring(tmp_path_factory, wiring):
    path = tmp_path_factory.mktemp("plant") / "wired.toml"
    plant_file.write(path, PlantParameters.nominal(N), wiring=wiring)
    assert plant_file.read_wiring(path, N) == wiring
    plant_file.read(path, N)


@pytest.mark.medium
@given(wirings)
def test_every_output_drives_one_valve_at_most_and_every_input_reads_one_line(wiring):
    coils = wiring.checked(N).coils(N)
    driven = coils[coils >= 0]
    assert len(set(driven)) == len(driven) == 2 * N - len(wiring.dead)
    assert sorted(wiring.channels(N)) == list(range(N))


def test_what_each_part_does():
    straight = Wiring()
    assert straight.coils(3).tolist() == [0, 1, 2, 3, 4, 5]
    assert Wiring(tubes=((0, 2),)).coils(3).tolist() == [4, 5, 2, 3, 0, 1]
    assert Wiring(tubes=((0, 2),)).channels(3).tolist() == [2, 1, 0]
    assert Wiring(sensors=((0, 2),)).coils(3).tolist() == straight.coils(3).tolist()
    assert Wiring(sensors=((0, 2),)).channels(3).tolist() == [2, 1, 0]
    assert Wiring(valves=(("fill0", "vent2"),)).coils(3).tolist() == [5, 1, 2, 3, 4, 0]
    assert Wiring(dead=("vent1",), tubes=((0, 1),)).coils(3).tolist() == [2, 3, 0, -1, 4, 5]


@pytest.mark.medium
@given(wirings.filter(lambda wiring: not wiring.valves and not wiring.dead))
def test_two_tubes_exchanged_are_a_place_that_leads_elsewhere(wiring):
    """Valves and sensor of a place go with its tube: sensors of their own apart, they all lead to the same bubble."""
    places = Wiring(tubes=wiring.tubes).channels(N)
    assert (wiring.coils(N) == np.column_stack([2 * places, 2 * places + 1]).ravel()).all()


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("tubes=1", "a dash between"),
        ("tubes=1-7", "from 0 to 6"),
        ("tubes=1-1", "once"),
        ("sensors=a-b", "by their numbers"),
        ("valves=fill1-wind2", "fill0 to fill6"),
        ("dead=3", "vent0 to vent6"),
        ("estop=up", "closed, open"),
        ("tubes=", "a dash between"),
    ],
)
def test_what_cannot_be_wired_is_refused_in_a_sentence(option, words):
    with pytest.raises(bs.InvalidInput, match=words):
        bs.connect(f"sim://wristband7?{option}")


def test_what_a_file_says_is_not_said_again(tmp_path):
    path = tmp_path / "wired.toml"
    path.write_text("[wiring]\ntubes = [[1, 4]]\n")
    with bs.connect(f"sim://wristband7?plant={path}") as skin:
        assert skin.simulated.wiring == Wiring(tubes=((1, 4),))
    with pytest.raises(bs.InvalidInput, match="leave dead out"):
        bs.connect(f"sim://wristband7?plant={path}&dead=fill1")


@pytest.mark.parametrize("wiring", ['tubes = "1-4"', "dead = [3]", "estop = 1", "tubes = [[1]]", "pipes = [[1, 2]]"])
def test_a_file_that_says_it_otherwise_is_refused(tmp_path, wiring):
    path = tmp_path / "wired.toml"
    path.write_text(f"[wiring]\n{wiring}\n")
    with pytest.raises(bs.InvalidInput, match=r"wired\.toml has"):
        bs.connect(f"sim://wristband7?plant={path}")


@pytest.mark.medium
@given(wirings.filter(lambda wiring: not wiring.dead), st.integers(0, 2**32 - 1))
def test_nothing_but_places_changes(wiring, seed):
    """With wires that cross no kinds, a wired plant is the straight one, with its pulses sent elsewhere."""
    coils = wiring.coils(N)
    if any(coils % 2 != np.arange(2 * N) % 2):
        return
    tick = 5e-3
    rng = np.random.default_rng(seed)
    wired, straight = (Plant(PlantParameters.nominal(N)) for _ in range(2))
    wires = Wires(wiring, N)
    for _ in range(3):
        pulses = rng.uniform(0.0, tick, (N, 2))
        wires.advance(wired, tick, pulses, 0.5, False)
        sent = np.zeros(2 * N)
        sent[coils] = pulses.ravel()
        straight.advance(tick, sent[::2], sent[1::2], 0.5, False)
    assert (wired.node_pa == straight.node_pa).all()


def test_an_output_of_the_other_kind_opens_a_valve_for_the_rest_of_the_period():
    """Fill 1 on the output of vent 1 has current while the vent should be shut: air comes in from the pulse's end on."""
    tick = 5e-3
    plant = Plant(PlantParameters.nominal(N))
    wires = Wires(Wiring(valves=(("fill1", "vent1"),)), N)
    vented = np.tile([0.0, tick], (N, 1))
    for _ in range(4):
        wires.advance(plant, tick, vented, 0.0, False)
    assert np.abs(plant.node_pa).max() < 1.0
    shut = vented.copy()
    shut[1] = 0.0, 0.0
    for _ in range(40):
        wires.advance(plant, tick, shut, 0.0, False)
    assert plant.node_pa[1] > 20e3, "between an open fill and an open vent"
    for _ in range(100):
        wires.advance(plant, tick, vented, 0.0, False)
    assert np.abs(plant.node_pa).max() < 100.0


def test_valves_without_current_are_as_they_are_without_it():
    tick = 5e-3
    plant = Plant(PlantParameters.nominal(N))
    wires = Wires(Wiring(dead=("fill1", "vent2")), N)
    pulses = np.zeros((N, 2))
    pulses[:, FILL] = 4e-3
    for _ in range(2):
        wires.advance(plant, tick, pulses, 0.0, False)
        pulses[:] = 0.0
    assert plant.node_pa[1] == pytest.approx(0.0, abs=1e-6)
    assert plant.node_pa[2] < 0.6 * plant.node_pa[0]
    assert VENT == 1


@pytest.mark.parametrize(("contact", "said"), [("closed", (False, True, False)), ("open", (True, False, True))])
def test_the_emergency_stops_contact(contact, said):
    with bs.connect(f"sim://wristband7?estop={contact}") as skin:
        seen = []
        for pressed in (0.0, 1.0, 0.0):
            skin.simulated.inject("estop", value=pressed)
            skin.sleep(0.05)
            skin.clear_faults()
            seen.append("emergency_stop" in skin.health().board_faults)
    assert tuple(seen) == said


def test_an_emergency_stop_takes_the_current_whatever_the_firmware_knows():
    """Its second contact does: with a loop the wrong way round the firmware goes on, and the bubbles vent nevertheless."""
    with bs.connect("sim://wristband7?estop=open") as skin:
        board = skin.simulated
        board.inject("estop")
        skin.sleep(0.1)
        skin.clear_faults()
        skin.show([8.0] * N, wait=False)
        skin.sleep(0.5)
        assert np.abs(board.plant.pressure_pa).max() < 1.0


def test_where_there_is_no_pin_an_emergency_stop_is_refused():
    from bubbleskin.sim.firmware import Firmware

    with pytest.raises(bs.InvalidInput, match="sim:// or rp2040://"):
        Firmware.open_loop(None, True)


def test_pump_and_dump_valve_fail():
    plant = Plant(PlantParameters.nominal(N))
    plant.inject("pump_off", 0)
    plant.advance(0.5, np.zeros(N), np.zeros(N), pump=1.0)
    assert plant.supply_pa == pytest.approx(60e3)
    plant.inject("dump_stuck", 0, -1.0)
    plant.advance(0.5, np.zeros(N), np.zeros(N), dump=True)
    assert plant.supply_pa == pytest.approx(60e3)
    plant.inject("dump_stuck", 0, 1.0)
    plant.advance(3.0, np.zeros(N), np.zeros(N))
    assert plant.supply_pa < 100.0
