"""The vocabulary of injected failures: what each of them does to the plant, what cannot be meant, and that it can be mended."""

import contextlib
import json

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim import SimulatedBoard, SimulatedTransport
from bubbleskin.sim.failures import HOWS, OF_BUBBLES, PARTS, TABLE, failure_of
from bubbleskin.sim.records import FAILURES, SUPPLY_FAILURES

N = 7
FOUND = {
    ("sensor", "off"): {"sensor_lost"},
    ("sensor", "missing"): {"sensor_lost"},
    ("sensor", "stuck"): {"sensor_stuck"},
    ("sensor", "wrong"): {"valve_stuck"},
    ("sensor", "intermittent"): {"sensor_lost"},
    ("fill valve", "off"): {"no_air"},
    ("fill valve", "missing"): {"no_air"},
    ("fill valve", "stuck"): {"valve_stuck", "overfilled", "overpressure"},
    ("vent valve", "off"): {"leak"},
    ("vent valve", "missing"): {"leak"},
    ("vent valve", "stuck"): {"valve_stuck"},
    ("tube", "off"): {"leak"},
    ("tube", "missing"): {"leak"},
    ("bubble", "off"): {"leak"},
    ("bubble", "missing"): {"leak"},
    ("bubble", "wrong"): {"leak"},
    ("supply", "off"): {"supply_lost"},
    ("supply", "stuck"): {"supply_lost"},
    ("supply", "wrong"): {"supply_lost"},
    ("supply", "missing"): {"supply_lost"},
    ("pump", "off"): {"supply_lost"},
    ("pump", "missing"): {"supply_lost"},
}
"""What a healthy firmware finds within a few moves: at least one of these, of that bubble or of the board."""


def moved(skin):
    """The names of faults that come up as all bubbles rise and fall, and the bubbles that have some."""
    for height in (8.0, 11.0, 6.5):
        try:
            skin.show([height] * N, wait=False)
        except bs.DeviceRefused:
            break
        skin.sleep(0.8)
    log = skin.fault_log()
    return {fault.name for fault in log}, {fault.bubble for fault in log} - {None}


@pytest.mark.medium
@pytest.mark.parametrize("words", FOUND, ids=" ".join)
def test_the_firmware_finds_it_and_nothing_of_others_and_it_can_be_mended(words):
    part, how = words
    number = 3 if part in OF_BUBBLES else 0
    with bs.connect("sim://wristband7?contact=0") as skin:
        skin.show([8.0] * N)
        skin.sleep(0.2)  # a sensor that leaps while its bubble comes to rest is not told from moving air
        skin.inject(part, number, how)
        found, bubbles = moved(skin)
        assert found & FOUND[words], found
        assert bubbles <= {number}
        skin.inject(part, number, "healthy")
        skin.vent()
        skin.sleep(3.0)
        skin.clear_faults()
        skin.sleep(2.0)
        assert moved(skin)[0] == found, "nothing new in the log"
        assert skin.faults() == {}


@pytest.mark.parametrize("failure", TABLE, ids=lambda failure: f"{failure.part} {failure.how}")
def test_whatever_it_changes_in_the_plant_is_as_before_once_it_is_healthy(failure):
    board = SimulatedBoard()
    plant = board.plant

    def now():
        return [array.tolist() for array in plant.snapshot()[:5]]

    before = now()
    board.inject(failure.part, 2, failure.how)
    board.step(0.0)
    assert now() != before or bool(plant.live) or board.line is not None or board.clock_pace != 1.0
    board.inject(failure.part, 2, "healthy")
    assert now() == before
    assert not plant.live
    assert board.line is None
    assert board.clock_pace == 1.0


def test_another_failure_of_the_same_part_takes_the_first_ones_place():
    board = SimulatedBoard()
    board.inject("sensor", 2, "missing")
    board.inject("sensor", 2, "noisy")
    counts = np.array([board.plant.sense()[2] for _ in range(200)])
    assert 100 < counts.mean() < 220
    assert 40 < counts.std() < 80


def test_a_sensor_that_is_slow_or_delayed_says_what_was():
    board = SimulatedBoard()
    board.inject("sensor", 1, "slow")
    board.inject("sensor", 2, "delayed")
    said = []
    fill, vent = np.zeros(N), np.zeros(N)
    counts = np.zeros(N + 1, np.uint16)
    for tick in range(60):
        fill[:] = 5e-3 if tick == 20 else 0.0
        board.plant.read(counts)
        said.append(counts[:3].astype(float))
        board.plant.advance(5e-3, fill, vent)
    good, slow, delayed = np.array(said[:]).T
    assert np.abs(delayed[30:] - good[20:50]).max() < 12, "10 ticks later, but for noise"
    step = good[40:].mean() - 160
    assert slow[22] - 160 < 0.3 * step
    assert slow[32] - 160 == pytest.approx((1 - np.exp(-1)) * step, rel=0.2)
    assert slow[59] == pytest.approx(good[59], abs=12)


def test_what_comes_and_goes_does_so():
    board = SimulatedBoard()
    board.inject("sensor", 4, "intermittent")
    gone = []
    for _ in range(400):
        board.plant.advance(5e-3, np.zeros(N), np.zeros(N))
        gone.append(board.plant.sense()[4] == 0)
    assert np.mean(gone) == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("how", ["off", "missing"])
def test_a_line_that_is_off_loses_both_ways_and_can_be_mended(how):
    with bs.connect("sim://wristband7") as skin:
        before = skin.health().frames_good
        skin.inject("link", 0, how)
        with pytest.raises(bs.DeviceSilent):
            skin.state()
        skin.inject("link", 0, "healthy")
        assert skin.health().frames_good < before + 8, "a dozen repetitions were written"


@pytest.mark.parametrize("how", ["noisy", "delayed", "intermittent"])
def test_a_line_that_fails_takes_longer_and_can_be_mended(how):
    with bs.connect("sim://wristband7") as skin:
        skin.inject("link", 0, how)
        before = skin.simulated.time
        for _ in range(100):
            skin.state()
        assert skin.simulated.time - before > 0.7, "which takes 0.5 s on a good line"
        skin.inject("link", 0, "healthy")
        before = skin.simulated.time
        for _ in range(100):
            skin.state()
        assert skin.simulated.time - before < 0.6


@pytest.mark.medium
def test_a_slow_crystal_is_what_the_clock_finds():
    with bs.connect("sim://wristband7?fail=clock-slow") as skin:
        skin.sleep(60.0)
        assert skin.clock.drift_ppm == pytest.approx(-60.0, abs=15.0)


def test_a_clock_that_is_wrong_goes_slow_by_the_hosts():
    with bs.connect("sim://wristband7") as skin:
        skin.sleep(1.0)
        skin.inject("clock", 0, "wrong")
        begin, device = skin.link.transport.now(), skin.state().time
        skin.sleep(5.1)
        assert skin.link.transport.now() - begin == pytest.approx(5.1, abs=0.03)
        assert skin.state().time - device == pytest.approx(5.0, abs=0.03)
        skin.inject("clock", 0, "healthy")
        begin, device = skin.link.transport.now(), skin.state().time
        skin.sleep(5.0)
        assert skin.state().time - device == pytest.approx(5.0, abs=0.03)
        assert skin.link.transport.now() - begin == pytest.approx(5.0, abs=0.03), "the host's does not leap back"


def test_every_part_and_every_how_of_the_vocabulary_is_there():
    assert {failure.how for failure in TABLE} == set(HOWS)
    assert {failure.part for failure in TABLE} == set(PARTS)
    assert len({(failure.part, failure.how) for failure in TABLE}) == len(TABLE)
    for failure in TABLE:
        assert failure.plant.keys() <= {*FAILURES, *SUPPLY_FAILURES}
        assert failure_of(failure.part, failure.how) is failure


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sensor", 3, "hot"), "it can be off, stuck, wrong"),
        (("tube", 3, "wrong"), "tubes=1-4"),
        (("valve", 3, "stuck"), "give one of sensor, fill valve"),
        (("clock", 0, "off"), "it can be slow, wrong, and healthy again"),
        (("sensor", 7, "stuck"), "0 to 6"),
        (("sensor", "three", "stuck"), "number"),
        (("sensor", 3, 5), "text"),
        ((3, 3, "stuck"), "text"),
    ],
)
def test_what_cannot_be_meant_says_what_can(words, said):
    with bs.connect("sim://wristband7") as skin, pytest.raises(bs.InvalidInput, match=said):
        skin.inject(*words)


@pytest.fixture
def real():
    """A skin that takes its board for a real one, and the board."""
    board = SimulatedBoard("wristband7", contact=False)
    with bs.Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, "/dev/ttyACM0"), 2.0))) as skin:
        yield skin, board


def test_a_real_board_fails_only_once_that_is_permitted(real):
    skin, _ = real
    with pytest.raises(bs.DeviceRefused, match="permit_injection"):
        skin.inject("sensor", 3, "missing")
    skin.show([6.0] * 7)
    with pytest.raises(bs.DeviceRefused, match="not vented"):
        skin.permit_injection()
    with pytest.raises(bs.InvalidInput, match="True or False"):
        skin.permit_injection("yes")
    assert skin.faults() == {}


ON_ITS_OWN = [
    ("sensor", "off", {"sensor_lost"}),
    ("sensor", "missing", {"sensor_lost"}),
    ("sensor", "stuck", {"sensor_stuck"}),
    ("fill valve", "off", {"no_air"}),
    ("fill valve", "missing", {"no_air"}),
    ("vent valve", "off", {"leak", "no_air"}),
    ("vent valve", "missing", {"leak", "no_air"}),
]


@pytest.mark.parametrize(("part", "how", "names"), ON_ITS_OWN)
def test_a_real_board_finds_what_it_does_to_itself(real, part, how, names):
    skin, board = real
    skin.permit_injection()
    skin.show([8.0] * 7)
    skin.inject(part, 3, how)
    skin.show([10.0] * 7, wait=False)
    skin.sleep(1.5)
    assert list(skin.faults()) == [3]
    assert set(skin.faults()[3]) & names
    assert board.plant.height_mm[3] < 10.2
    skin.inject(part, 3, "healthy")
    skin.vent()
    skin.sleep(1.5)
    skin.clear_faults()
    assert skin.show([8.0] * 7).settled


def test_a_real_board_with_a_sensor_that_says_too_much_stands_lower(real):
    skin, board = real
    skin.permit_injection()
    skin.show([7.0] * 7, plan=False)
    skin.inject("sensor", 3, "wrong")
    skin.show([12.0] * 7, wait=False, plan=False)
    skin.sleep(1.0)
    assert board.plant.height_mm[3] < 12.1
    assert board.plant.height_mm[2] == pytest.approx(12.0, abs=0.2)


@pytest.mark.medium
def test_the_supply_of_a_real_board_fails_and_is_mended(real):
    skin, _ = real
    skin.permit_injection()
    for part, how in (("supply", "missing"), ("supply", "off"), ("pump", "off"), ("pump", "missing")):
        skin.show([8.0] * 7)
        skin.inject(part, 0, how)
        for _ in range(100):
            with contextlib.suppress(bs.DeviceRefused):
                skin.show([12.0] * 7, wait=False)
                skin.sleep(0.3)
                skin.show([6.0] * 7, wait=False)
            skin.sleep(0.3)
            if "supply_lost" in skin.health().board_faults:
                break
        assert "supply_lost" in skin.health().board_faults, (part, how)
        skin.inject(part, 0, "healthy")
        skin.sleep(5.0)
        skin.clear_faults()


def test_permission_ends_with_a_restart_and_on_request(real):
    skin, _ = real
    skin.permit_injection()
    skin.inject("sensor", 3, "missing")
    skin.permit_injection(False)
    with pytest.raises(bs.DeviceRefused, match="permit_injection"):
        skin.inject("sensor", 3, "missing")
    skin.permit_injection()
    skin.restart()
    with pytest.raises(bs.DeviceRefused, match="permit_injection"):
        skin.inject("sensor", 3, "missing")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("fill valve", 3, "stuck"), "it can make it off, missing, and healthy again"),
        (("vent valve", 3, "stuck"), "it can make it off, missing"),
        (("tube", 3, "off"), "Simulated"),
        (("link", 0, "off"), "sim://"),
        (("sensor", 7, "missing"), "0 to 6"),
        (("sensor", 3, "green"), "it can be off, stuck"),
        (("sensor", 3, 5), "5"),
        (("teapot", 3, "off"), "give one of"),
    ],
)
def test_what_a_real_board_cannot_do_says_what_it_can(real, words, said):
    with pytest.raises(bs.InvalidInput, match=said):
        real[0].inject(*words)


def test_the_words_with_values_go_on():
    board = SimulatedBoard()
    board.inject("sensor_absent", 2)
    assert board.plant.sense()[2] == 0
    board.inject("sensor_absent", 2, 0)
    board.inject(fault="sensor_stuck", number=1, value=700.0)
    assert board.plant.sense()[1] == 700
    with pytest.raises(bs.InvalidInput, match="no failure is called 'sensor'"):
        board.inject("sensor", 3, 1.0)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("fail=sensor3", "part, number and how"),
        ("fail=sensor-stuck", "of which bubble"),
        ("fail=sensor3-hot", "it can be off"),
        ("fail=sensor9-stuck", "0 to 6"),
        ("fail=3-stuck", "part, number and how"),
    ],
)
def test_urls_that_cannot_be_meant(option, words):
    with pytest.raises(bs.InvalidInput, match=words):
        bs.connect(f"sim://wristband7?{option}")


def test_a_url_makes_parts_fail_from_the_start():
    with bs.connect("sim://wristband7?fail=sensor3-off,fill_valve2-off,link-noisy") as skin:
        skin.sleep(0.1)
        assert skin.faults() == {3: ("sensor_lost",)}
        assert skin.simulated.line is not None


@pytest.mark.slow
def test_the_same_words_on_micropython():
    with bs.connect("micropython://wristband7?fail=sensor3-stuck") as skin:
        skin.sleep(0.5)
        assert skin.faults() == {3: ("sensor_stuck",)}


# ---- the command


def test_the_command_says_what_the_firmware_makes_of_it(command):
    status, out, _ = command("inject", "sensor", "3", "stuck", "--seconds", "1")
    assert status == 0
    assert out.startswith("0.30 s: sensor_stuck of bubble 3: ")
    assert out.rstrip().endswith(".")


def test_the_command_takes_parts_of_two_words_and_prints_json(command):
    status, out, _ = command("inject", "fill", "valve", "2", "off", "--json", "--seconds", "1")
    assert status == 0
    said = json.loads(out)
    assert (said["part"], said["number"], said["how"]) == ("fill valve", 2, "off")
    assert [(found["name"], found["bubble"]) for found in said["found"]] == [("no_air", 2)]


def test_the_command_lists_them(command):
    status, out, _ = command("inject", "--list", "--json")
    assert status == 0
    assert len(json.loads(out)) == len(TABLE)


@pytest.mark.parametrize(
    "words", [[], ["sensor"], ["sensor", "stuck"], ["sensor", "2", "hot"], ["clock", "off"], ["x", "y"]]
)
def test_the_command_refuses_in_a_sentence(command, words):
    status, out, err = command("inject", *words)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
