"""First light on simulated boards that are wired wrongly: what is found, what moves before a yes, and what is left behind."""

import json
from pathlib import Path

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.bringup.findings import MEANINGS
from bubbleskin.bringup.report import Step
from bubbleskin.bringup.session import Session, zeroed
from bubbleskin.fault_guide import GUIDE
from bubbleskin.link.link import run_sync
from bubbleskin.sim import SimulatedBoard, SimulatedTransport

N = 7
pytestmark = pytest.mark.medium


def bring_up(options="", **wanted):
    with bs.connect(f"sim://wristband7?{options}" if options else "sim://wristband7") as skin:
        return bs.bring_up(skin, **wanted)


MISTAKES = {
    "tubes=1-4": {("tubes_swapped", ("tube 1", "tube 4"))},
    "valves=fill1-fill4": {("fill_valves_swapped", ("fill valve 1", "fill valve 4"))},
    "valves=vent1-vent4": {("vent_valves_swapped", ("vent valve 1", "vent valve 4"))},
    "valves=fill2-vent2": {("fill_and_vent_swapped", ("vent valve 2", "fill valve 2"))},
    "sensors=0-3": {("sensor_wires_swapped", ("sensor 0", "sensor 3"))},
    "dead=fill3": {("fill_valve_dead", ("fill valve 3",))},
    "dead=vent3": {("vent_valve_dead", ("vent valve 3",))},
    "estop=open": {("estop_normally_open", ("emergency stop",))},
    "tubes=1-4&sensors=0-3&dead=vent6": {
        ("tubes_swapped", ("tube 1", "tube 4")),
        ("sensor_wires_swapped", ("sensor 0", "sensor 3")),
        ("vent_valve_dead", ("vent valve 6",)),
    },
}
PLANTS = ("", "&spread=0.1&rubber=real&seed=3")


@pytest.mark.parametrize("plant", PLANTS, ids=["ideal", "real"])
@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_mistake_is_found_and_named_and_nothing_else(mistake, plant):
    found = bring_up(mistake + plant)
    assert {(finding.name, finding.parts) for finding in found.findings} == MISTAKES[mistake]
    assert not found.passed
    assert found.trim is None, "zeros of sensors that may be another's are not kept"
    for finding in found.findings:
        for sentence in (finding.cause, finding.remedy, finding.seen):
            assert sentence.endswith(".")
            assert sentence in found.report()


@pytest.mark.parametrize("mistake", ["tubes=7-11", "valves=vent5-vent6", "sensors=6-7"])
def test_nineteen_bubbles_on_three_drivers(mistake):
    with bs.connect(f"sim://wristband19?{mistake}") as skin:
        findings = bs.bring_up(skin).findings
    numbers = sorted(int("".join(filter(str.isdigit, part))) for part in mistake.split("=")[1].split("-"))
    assert [sorted(int(part.split()[-1]) for part in finding.parts) for finding in findings] == [numbers]


@pytest.mark.parametrize(
    "plant", ["seed=1", "seed=2&spread=0.1&rubber=real", "seed=3&spread=0.2", "viscosity=3&rubber=real"]
)
def test_a_board_that_is_as_it_should_be_passes_and_keeps_its_zeros(plant):
    with bs.connect(f"sim://wristband7?{plant}") as skin:
        offsets = skin.simulated.plant.parameters.sensor_offset
        found = bs.bring_up(skin)
        assert found.passed, found.report()
        assert len(found.pulses) == 2 * N
        assert (skin.trim().zero == found.trim.zero).all()
        assert np.abs(found.trim.zero - 160 - offsets / 17).max() < 1.0
        assert skin.stored().source.startswith("slot")
        skin.vent()
        skin.sleep(0.5)
        assert np.abs(skin.state().pressure_kpa).max() < 0.2, "what it says without pressure is nothing"


def test_without_saving_the_zeros_are_in_use_only():
    with bs.connect("sim://wristband7?seed=2&spread=0.1") as skin:
        found = bs.bring_up(skin, save=False)
        assert found.passed
        assert not found.saved
        assert not skin.stored().source.startswith("slot")
        assert (skin.trim().zero == found.trim.zero).all()


def as_a_real_one_is(transport):
    """A skin that knows nothing of the board behind its transport."""
    return bs.Skin(run_sync(AsyncSkin.open(transport, 2.0)))


class Hesitant:
    """Says yes so many times, then no, or what `last` raises; keeps the truth of the plant whenever it is asked."""

    def __init__(self, skin, yes, last=None):
        self.board, self.left, self.last = skin.simulated, yes, last
        self.asked, self.pressures = [], []

    def __call__(self, question):
        self.asked.append(question)
        self.pressures.append(float(np.abs(self.board.plant.pressure_pa).max()))
        self.left -= 1
        if self.left >= 0:
            return True
        if self.last:
            raise self.last
        return False


def test_nothing_is_under_pressure_whenever_somebody_is_asked_or_says_no():
    """Whatever question a no comes at, or a Ctrl-C: all is vented, the report says so, and what was done before is in it."""
    with bs.connect("sim://wristband7") as skin:
        everybody = Hesitant(skin, 1000)
        whole = bs.bring_up(skin, everybody)
    assert whole.passed
    assert max(everybody.pressures) < 500.0, "before each yes"
    assert len(everybody.asked) == 1 + 3 + 1 + (N + 1) + 2 + 1 + 1 + 1
    for yes in range(0, len(everybody.asked), 3):
        for last in (None, KeyboardInterrupt()):
            with bs.connect("sim://wristband7") as skin:
                found = bs.bring_up(skin, Hesitant(skin, yes, last))
                assert found.ended.startswith("It was ended at: ")
                assert found.steps[-1].name == everybody.asked[yes].step
                assert not found.passed
                assert skin.state().mode in ("idle", "venting", "boot", "stopped")
                skin.sleep(0.5)
                assert np.abs(skin.simulated.plant.pressure_pa).max() < 100.0
                assert "begin the bring-up again" in found.report().lower()


class Interrupted(SimulatedTransport):
    """Ctrl-C comes while the wristband is waited for, once, at a time of the board."""

    def __init__(self, board, at):
        super().__init__(board, "sim://interrupted")
        self.at = at

    def read(self, timeout):
        if self.board.time > self.at:
            self.at = np.inf
            raise KeyboardInterrupt
        return super().read(timeout)


@pytest.mark.parametrize("at", [2.01, 2.65, 6.05, 13.0, 14.5, 17.5, 19.5])
def test_a_ctrl_c_in_the_middle_of_a_move_vents(at):
    board = SimulatedBoard("wristband7")
    skin = bs.Skin(run_sync(AsyncSkin.open(Interrupted(board, at), 2.0, simulated=board)))
    with skin:
        found = bs.bring_up(skin)
        assert board.time < at + 0.7
        assert found.ended.startswith("It was ended at: ")
        assert skin.state().mode in ("venting", "idle", "faulted")
        skin.sleep(0.7)
        assert np.abs(board.plant.pressure_pa).max() < 100.0


def test_what_was_seen_is_asked_when_the_bubble_is_down_again(monkeypatch):
    """Nobody says anything to the wristband while a person reads and types, and a second later it would vent."""
    seen = []

    def ask(question):
        if question.look:
            seen.append((question.act, float(np.abs(board.plant.pressure_pa).max())))
            return question.act == "listen"
        return True

    with bs.connect("sim://wristband7") as skin:
        board = skin.simulated
        session = Session(skin, board.data, ask, None, None)
        found = session.run(True)
    assert [finding.name for finding in found.findings] == ["estop_without_effect"], "nobody has pressed it"
    with bs.connect("sim://wristband7") as skin:
        board = skin.simulated
        session = Session(skin, board.data, ask, None, None)
        step = Step("one", "One bubble")
        session.one(step)
        assert [finding.name for finding in step.findings] == ["wrong_bubble"]
    assert seen[-1][0] == "see"
    assert max(pressure for _, pressure in seen) < 500.0


@pytest.mark.parametrize("line", ["loss=0.01", "fail=link-delayed"])
def test_a_bad_line_changes_nothing_of_what_is_said(line):
    found = bring_up(f"tubes=1-4&seed=3&{line}")
    assert [finding.name for finding in found.findings] == ["tubes_swapped"]


def test_a_line_that_loses_too_much_is_said_instead_of_a_guess():
    found = bring_up("seed=3&loss=0.2")
    assert not found.findings
    assert "bubbleskin doctor --link" in found.ended


def test_a_no_at_the_first_question_moves_nothing():
    with bs.connect("sim://wristband7") as skin:
        before = skin.simulated.plant.air.copy()
        found = bs.bring_up(skin, lambda question: False)
        assert np.allclose(skin.simulated.plant.air, before, rtol=1e-9)
    assert [step.name for step in found.steps] == ["power"]


def test_no_bubble_rises_before_all_wires_are_right():
    """Until the step that shows one bubble, what is highest on a right board is 1.5 mm above rest, for tenths of a second."""
    with bs.connect("sim://wristband7") as skin:
        tops = []

        class Watched:
            def __call__(self, question):
                if question.step == "supply":
                    return False
                tops.append(skin.simulated.height_mm.max())
                return True

        bs.bring_up(skin, Watched())
        assert max(tops) < 5.1


@pytest.mark.parametrize(
    ("inject", "step", "name"),
    [
        (("sensor_absent", 2, 1.0), "sensors", "sensor_lost"),
        (("sensor_stuck", 2, 160.0), "sensors", "sensor_stuck"),
        (("sensor_bias", 2, 2e3), "sensors", "sensor_zero_off"),
        (("vent_stuck", 2, -1.0), "valves", "vent_valve_stuck"),
        (("fill_stuck", 2, -1.0), "valves", "fill_valve_dead"),
        (("leak", 2, 1e-6), "all", "leak"),
        (("dump_stuck", 0, -1.0), "supply", "dump_valve_dead"),
    ],
)
def test_what_has_failed_is_found_at_its_step(inject, step, name):
    with bs.connect("sim://wristband7") as skin:
        skin.simulated.inject(*inject)
        found = bs.bring_up(skin)
    assert found.steps[-1].name == step, found.report()
    assert name in [finding.name for finding in found.findings], found.report()
    assert name in MEANINGS.keys() | GUIDE.keys()


def test_a_pump_that_brings_nothing_is_found_first():
    with bs.connect("sim://wristband7") as skin:
        skin.simulated.inject("pump_off", 0, 1.0)
        skin.simulated.inject("dump_stuck", 0, 1.0)
        skin.sleep(2.0)
        found = bs.bring_up(skin)
    assert [step.name for step in found.steps] == ["power"]
    assert {finding.name for finding in found.findings} <= {"supply_low", "supply_lost"}
    assert found.findings


def test_a_wristband_that_is_lost_ends_it_with_a_report():
    with bs.connect("sim://wristband7") as skin:

        def ask(question):
            if question.step == "valves":
                skin.link.transport.close()
            return True

        found = bs.bring_up(skin, ask)
    assert found.ended.startswith("The wristband was lost at: Each bubble's valves")
    assert [step.passed for step in found.steps] == [True, True, True, False]


def test_the_report_as_json_text_and_page(tmp_path):
    found = bring_up("tubes=1-4&seed=1")
    for name in ("found.json", "found.html", "found.txt"):
        found.save(tmp_path / name)
    kept = json.loads((tmp_path / "found.json").read_text())
    assert kept == json.loads(json.dumps(found.as_dict()))
    assert kept["steps"][3]["findings"][0]["name"] == "tubes_swapped"
    assert len(kept["pulses"]) == len(found.pulses) > 2 * N
    for name in ("found.html", "found.txt"):
        assert found.findings[0].remedy in (tmp_path / name).read_text()
    with pytest.raises(bs.InvalidInput, match=r"\.json, \.html, \.txt"):
        found.save(tmp_path / "found.pdf")


def test_arguments_that_cannot_be_meant():
    with bs.connect("sim://wristband7") as skin:
        for wrong in ({"ask": "yes"}, {"progress": 3}, {"save": "no"}, {"board": "nowhere"}):
            with pytest.raises(bs.InvalidInput):
                bs.bring_up(skin, **wrong)

    with (
        as_a_real_one_is(SimulatedTransport(SimulatedBoard(), "real")) as skin,
        pytest.raises(bs.InvalidInput, match="ask is"),
    ):
        bs.bring_up(skin)


def test_zeros_move_by_whole_counts():
    with bs.connect("sim://wristband7") as skin:
        trim = skin.trim()
        assert (zeroed(trim, np.array([17.0, -17.0, 8.0, 9.0, 0.0, 340.0, -340.0]), 17).zero - trim.zero).tolist() == [
            1,
            -1,
            0,
            1,
            0,
            20,
            -20,
        ]


def test_the_page_lists_what_there_is_to_find():
    page = (Path(__file__).parents[2] / "docs" / "bring-up.md").read_text()
    for name, meaning in MEANINGS.items():
        assert f"| `{name}` | {meaning} |" in page


# ---- the command


def answer(monkeypatch, answers):
    given = iter(answers)
    monkeypatch.setattr("click.termui.visible_prompt_func", lambda _="": next(given))


def test_the_command_asks_and_writes(command, monkeypatch, tmp_path):
    answer(monkeypatch, ["maybe", *["yes"] * 40])
    path = tmp_path / "first.html"
    status, out, err = command("bring-up", "--device", "sim://wristband7?dead=vent3", "-o", path)
    assert status == 1
    assert "Vent valve 3 does not close." in out
    assert "'maybe' is neither yes nor no." in err
    assert "Vent valve 3" in path.read_text()


def test_the_command_prints_json_and_nothing_else(command, monkeypatch):
    answer(monkeypatch, ["y"] * 40)
    status, out, _ = command("bring-up", "--device", "sim://wristband7", "--json", "--no-save")
    assert status == 0
    assert json.loads(out)["passed"] is True


@pytest.mark.parametrize("answers", [["yes", "no"], ["yes", "stop"], ["yes"]], ids=["no", "stop", "end of input"])
def test_the_command_ends_with_its_report(command, monkeypatch, answers):
    def more():
        yield from answers
        raise EOFError

    answer(monkeypatch, more())
    status, out, err = command("bring-up", "--device", "sim://wristband7")
    assert status == 1
    assert "It was ended at: The emergency stop." in out
    assert "Traceback" not in err


def test_the_command_refuses_a_report_before_it_asks(command):
    status, _, err = command("bring-up", "--device", "sim://wristband7", "-o", "first.pdf")
    assert status == 2
    assert err.count("\n") == 1
    assert ".json, .html, .txt" in err
