"""Every public call with what cannot be meant: one sentence, nothing sent, and the next call goes on."""

import datetime
import math
import warnings
from pathlib import Path

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.link.link import run_sync
from bubbleskin.membrane.balloon import YeohBalloon


class Tensor:
    """What a machine-learning library's array does where its numbers cannot be had."""

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")


class Unspeakable:
    def __repr__(self):
        raise OSError("no name")


class Quantity:
    units = "inch"

    def __array__(self, dtype=None, copy=None):
        return np.array(3.0)


JUNK = [
        None, True, "x", "", "1", b"1", -1, -0.5, 2.5, 1e9, 1e300, 10**20, 10**400, 10**5000, math.nan, math.inf, 1j, object(),
        [], [[]], [1, [2]], {}, {0: 6.0}, (), set(), Tensor(), Unspeakable(), Quantity(), Path("no such file"),
        datetime.timedelta(seconds=1), np.timedelta64(1, "s"), np.array([True] * 7), np.array(["6"] * 7), [None] * 7,
        np.ma.masked_equal([0.0, 6, 6, 6, 6, 6, 6], 0.0), np.zeros(7, dtype=[("a", float)]), np.zeros((7, 2)), "\ud800", "a\0b",
        [1j] * 7, [0.012] * 7, [1e5] * 7, range(10**9), iter([6.0]), bs, bs.Step, ["x"] * 7, [math.nan] * 7,
    ]  # fmt: skip

VERBS = {
    "show": lambda skin, a, b: skin.show(a, over=b, wait=False),
    "show over": lambda skin, a, b: skin.show([6.0] * 7, over=a, wait=False),
    "show wait": lambda skin, a, b: skin.show([6.0] * 7, wait=a),
    "show fill": lambda skin, a, b: skin.show([[6.0, 7.0]], wait=False, fill=a),
    "play": lambda skin, a, b: skin.play(a, wait=False),
    "play at": lambda skin, a, b: skin.play("pulse", at=a, wait=False),
    "play wait": lambda skin, a, b: skin.play(bs.Sequence([bs.Step([6] * 7)]), wait=a),
    "play progress": lambda skin, a, b: skin.play(
        bs.Sequence([bs.Step([6] * 7)]), progress=a if a is not bs.Step else None
    ),
    "acknowledge": lambda skin, a, b: skin.acknowledge(a),
    "restart": lambda skin, a, b: skin.restart(a),
    "sleep": lambda skin, a, b: skin.sleep(-1 if type(a) in (int, float) and a > 1e8 else a),
    "synchronise": lambda skin, a, b: skin.synchronise(a),
    "telemetry": lambda skin, a, b: next(skin.telemetry(a)),
    "telemetry fields": lambda skin, a, b: next(skin.telemetry(fields=a)),
    "record": lambda skin, a, b: skin.record(a),
    "record rate": lambda skin, a, b: skin.record("/dev/null/x.csv", rate_hz=a),
    "record seconds": lambda skin, a, b: skin.record("/dev/null/x.csv", seconds=a),
    "configure": lambda skin, a, b: skin.configure(deadman_vent=a),
    "configure name": lambda skin, a, b: skin.configure(x=a),
    "upload_tables": lambda skin, a, b: skin.upload_tables(a),
    "upload_tables save": lambda skin, a, b: skin.upload_tables(skin.read_tables()[0], save=a),
    "upload_trim": lambda skin, a, b: skin.upload_trim(a),
    "inject": lambda skin, a, b: skin.simulated.inject("leak", a, b),
    "inject fault": lambda skin, a, b: skin.simulated.inject(a, 0),
    "link": lambda skin, a, b: run_sync(skin.link.call("SHOW", (a,), () if b is None else b)),
    "link name": lambda skin, a, b: run_sync(skin.link.call(a)),
}
ASKS_FIRST = ("configure", "configure name", "upload_tables save")
"""What is allowed is the wristband's to say."""

OTHERS = {
    "connect": lambda a, b: bs.connect(a if a is not None else 7),
    "connect timeout": lambda a, b: bs.connect("sim://wristband7", timeout=a).close(),
    "connect layout": lambda a, b: bs.connect("sim://wristband7", layout=a).close(),
    "Layout": lambda a, b: bs.Layout(a, b),
    "Layout.hexagon": lambda a, b: bs.Layout.hexagon(a),
    "Layout.hexagon pitch": lambda a, b: bs.Layout.hexagon(1, a),
    "Layout.grid": lambda a, b: bs.Layout.grid(a, b),
    "Layout.from_file": lambda a, b: bs.Layout.from_file(a),
    "Layout.of_board": lambda a, b: bs.Layout.of_board(a),
    "Step": lambda a, b: bs.Step(a, b),
    "Step easing": lambda a, b: bs.Step([6], 1, a, b),
    "Step name": lambda a, b: bs.Step([6], name=a),
    "After": lambda a, b: bs.After(a),
    "Settled": lambda a, b: bs.Settled(a, b),
    "Settled then": lambda a, b: bs.Settled(then=a),
    "Repeat": lambda a, b: bs.Repeat(a, b),
    "Sequence": lambda a, b: bs.Sequence(a),
    "Sequence loops": lambda a, b: bs.Sequence([bs.Step([6])], loops=a, name=b),
    "Sequence layout": lambda a, b: bs.Sequence([bs.Step([6])], layout=a, board=b),
    "Sequence.from_json": lambda a, b: bs.Sequence.from_json(a),
    "Sequence.from_csv": lambda a, b: bs.Sequence.from_csv(a, lead=b),
    "Sequence.load": lambda a, b: bs.Sequence.load(a),
    "targets_at": lambda a, b: bs.sequences.pulse(bs.Layout.hexagon()).targets_at(a, b),
    **{name: lambda a, b, make=make: make(a) for name, make in bs.sequences.LIBRARY.items()},
    "pulse heights": lambda a, b: bs.sequences.pulse(bs.Layout.hexagon(), low_mm=a, high_mm=b),
    "pulse times": lambda a, b: bs.sequences.pulse(bs.Layout.hexagon(), rise=a, each=b),
    "wave": lambda a, b: bs.sequences.wave(bs.Layout.hexagon(), period=a, wavelength_mm=b),
    "wave direction": lambda a, b: bs.sequences.wave(bs.Layout.hexagon(), direction_deg=a, loops=b),
    "pop_up hold": lambda a, b: bs.sequences.pop_up(bs.Layout.hexagon(), hold=a),
    "dome": lambda a, b: bs.shapes.dome(a),
    "plane": lambda a, b: bs.shapes.plane(a),
    "flat": lambda a, b: bs.shapes.flat(a),
    "shapes.load": lambda a, b: bs.shapes.load(a),
    "YeohBalloon": lambda a, b: YeohBalloon(mu=a),
    "pressure_at_height": lambda a, b: YeohBalloon().pressure_at_height(a),
    "heights": lambda a, b: YeohBalloon().heights(a),
    "volume": lambda a, b: YeohBalloon().volume(a),
    "fit_yeoh": lambda a, b: bs.fit_yeoh(a, b, radius=2.5e-3, thickness=1e-3),
    "build_table": lambda a, b: bs.build_table(a),
    "build_table knots": lambda a, b: bs.build_table(YeohBalloon(), knots=a),
    "build_table range": lambda a, b: bs.build_table(YeohBalloon(), height_mm=a),
    "read_csv": lambda a, b: bs.read_csv(a),
    "preset": lambda a, b: bs.preset(a),
    "Calibration.load": lambda a, b: bs.Calibration.load(a),
    "RigidContact": lambda a, b: bs.RigidContact(a),
    "CompliantContact": lambda a, b: bs.CompliantContact(a),
    "CompliantContact seed": lambda a, b: bs.CompliantContact(bs.Layout.hexagon(), seed=a),
    "SimulatedBoard": lambda a, b: bs.sim.SimulatedBoard(a),
    "SimulatedBoard seed": lambda a, b: bs.sim.SimulatedBoard("wristband7", seed=a),
    "SimulatedBoard spread": lambda a, b: bs.sim.SimulatedBoard("wristband7", spread=a),
    "CompliantContact kz": lambda a, b: bs.CompliantContact(bs.Layout.hexagon(), kz=a),
}  # fmt: skip


@pytest.fixture(scope="module")
def skin():
    with bs.connect("sim://wristband7?contact=0") as skin:
        yield skin


def refusal(call):
    """What a call is refused with; any exception but our own is the test's failure."""
    try:
        call()
    except bs.BubbleskinError as problem:
        return problem
    return None


def pairs():
    """Each thing alone, and beside another one."""
    return [*((one, None) for one in JUNK), *zip(JUNK, JUNK[7:] + JUNK[:7], strict=True)]


@pytest.mark.medium
@pytest.mark.parametrize("verb", VERBS)
def test_a_refused_call_is_a_sentence_and_the_next_one_goes_on(skin, verb, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for a, b in pairs():
        before = skin.link.window.next_number
        problem = refusal(lambda a=a, b=b: VERBS[verb](skin, a, b))
        if isinstance(problem, bs.InvalidInput) and verb not in ASKS_FIRST:
            assert skin.link.window.next_number == before, f"a refused call sends nothing: {problem}"
        assert skin.state().mode, "whatever it was, the next call is answered"


@pytest.mark.medium
@pytest.mark.parametrize("call", OTHERS)
def test_whatever_is_given_is_taken_or_refused_in_a_sentence(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for a, b in pairs():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # some are, rightly, of what is taken
            problem = refusal(lambda a=a, b=b: OTHERS[call](a, b))
        assert problem is None or str(problem).rstrip().endswith("."), problem
