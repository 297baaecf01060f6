"""The bench of control, in tiny: every kind of plant is one, errors are seen, and what is spoilt comes out worse."""

import json
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from click.testing import CliRunner

from bubbleskin.bench.control import page, touching
from bubbleskin.bench.control.contenders import CONTENDERS, FIRST, PRESENT, Present
from bubbleskin.bench.control.figures import Figures
from bubbleskin.bench.control.fill import fastest_fill
from bubbleskin.bench.control.measure import rows_of
from bubbleskin.bench.control.plants import KINDS, REAL, kind_named, sheet
from bubbleskin.bench.control.runs import HOLDS, SEARCH, STEP, TO_AND_FRO, Job, Outcome, run, to_and_fro
from bubbleskin.bench.control.shows import hold
from bubbleskin.bench.rows import Row
from bubbleskin.cli.bench import bench
from bubbleskin.errors import InvalidInput

IDEAL = KINDS[0]


def rms(shows):
    return float(np.sqrt(np.mean([(show.true[-1] - show.target) ** 2 for show in shows])))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
@pytest.mark.parametrize("contender", CONTENDERS)
def test_every_kind_has_sheets_that_every_contender_takes(kind, contender):
    one = CONTENDERS[contender](sheet(kind, 7))
    told = hold(one, np.full(7, 6.5), 0.6)
    assert told.true.shape == told.told.shape == (1, 7)
    assert told.true.max() > 6.0  # how well they are there is what the bench measures


def test_a_sheet_is_its_seed():
    first, again, other = sheet(REAL, 3), sheet(REAL, 3), sheet(REAL, 4)
    np.testing.assert_array_equal(first.trim.flow_gain, again.trim.flow_gain)
    assert first.tables == again.tables
    assert (first.parameters.mu != other.parameters.mu).all()


@pytest.mark.medium
def test_a_calibration_is_a_little_off():
    fill, vent, line = [], [], []
    for seed in range(30):
        drawn = sheet(IDEAL, seed)
        fill.append(drawn.trim.flow_gain / drawn.parameters.fill_conductance)
        vent.append(drawn.trim.vent_flow_gain / drawn.parameters.vent_conductance)
        line.append(drawn.parameters.node_volume + drawn.parameters.tube_volume)
    for values, sd in ((fill, 0.006), (vent, 0.006), (line, 0.01)):
        assert np.std(values) / np.mean(values) == pytest.approx(sd, rel=0.2)
    assert abs(np.corrcoef(np.ravel(fill), np.ravel(vent))[0, 1]) < 0.2


@pytest.mark.slow
def test_a_spoilt_firmware_comes_out_worse():
    drawn = sheet(IDEAL, 1)
    spoilt = drawn._replace(trim=replace(drawn.trim, flow_gain=np.rint(drawn.trim.flow_gain * 1.08).astype(int)))
    errors = []
    for one in (drawn, spoilt):
        rng = np.random.default_rng(2)
        contender = Present(one)
        errors.append(rms([hold(contender, rng.uniform(5.5, 13.0, 7), 0.6) for _ in range(4)]))
    assert errors[0] < 0.1
    assert errors[1] > 2 * errors[0]


@pytest.mark.slow
def test_rows_say_what_was_seen():
    for contender in CONTENDERS:
        for use in (SEARCH, STEP):
            one = Figures.of([run(Job(use, contender, REAL, seed)) for seed in (1, 2)])
            rows = list(rows_of(one))
            assert rows
            assert len({row.name for row in rows}) == len(rows)
            assert all(row.value >= 0 for row in rows)
            goals = {row.target for row in rows} - {""}
            assert bool(goals) == (contender == PRESENT)


@pytest.mark.slow
def test_the_first_law_loses_real_rubber_and_the_firmware_does_not():
    errors = {}
    for name, make in CONTENDERS.items():
        shows = list(islice(to_and_fro(make(sheet(REAL, 1)), REAL, np.random.default_rng(1)), 2))
        assert Figures.of([Outcome(Job(TO_AND_FRO, name, REAL, 1), shows, [])]).shows == 2
        errors[name] = rms(shows)
    assert errors[PRESENT] < 0.3 < errors[FIRST]


@pytest.mark.medium
@pytest.mark.parametrize(
    ("plant", "seed"),
    [
        ("real rubber", 13),  # recovers after 12.5 → 5.7 mm
        ("μ × 1.5, real rubber", 1),  # relaxes after 0 → 5.8 mm
        ("μ × 1.5, real rubber", 7),
        ("viscosity × 3, real rubber", 9),  # has 20 kPa more than its table says as it begins to rise
    ],
)
def test_healthy_rubber_that_has_just_moved_is_no_fault(plant, seed):
    shows = run(Job(SEARCH, PRESENT, kind_named(plant), seed)).shows
    assert not np.any([show.faulty for show in shows])


@pytest.mark.medium
def test_the_fastest_fill_is_the_plant_s_own():
    board = Present(sheet(IDEAL, 1)).board
    before = board.alone_mm
    fastest = fastest_fill(board, np.full(7, 12.0))
    np.testing.assert_array_equal(board.alone_mm, before)
    half = fastest_fill(board, np.full(7, 8.0))
    assert (half < fastest).all()
    assert (fastest > 0.15).all()
    assert (fastest < 0.4).all()


def figures():
    found = []
    for contender in CONTENDERS:
        one = run(Job(STEP, contender, IDEAL, 1))
        found += [replace(Figures.of([one]), use=use) for use in (HOLDS, SEARCH, STEP)]
    return [replace(found[2], fill_ratio=np.inf), *found[:2], *found[3:]]


@pytest.mark.medium
@pytest.mark.slow
def test_of_whatever_size_touching_bubbles_are_measured():
    rows = list(touching.rows(0.01))
    assert len({row.name for row in rows}) == len(rows) >= 26
    assert all(np.isfinite(row.value) for row in rows)


@pytest.mark.medium
def test_the_page_shows_the_file_and_check_says_where_not(tmp_path):
    (tmp_path / "docs/data").mkdir(parents=True)
    for path in (page.PAGE, page.TOPS_PAGE):
        (tmp_path / path).write_text(f"before\n{page.BEGIN}old\n{page.END}after\n", encoding="utf-8")
    page.write(tmp_path, figures(), [Row("touching, a shape: RMS", 0.1234, "mm", "≤ 0.15"), Row("shows", 120, "")])
    tops = (tmp_path / page.TOPS_PAGE).read_text(encoding="utf-8")
    assert "| a shape: RMS | 0.12 mm | ≤ 0.15 |\n| shows | 120 |  |\n" in tops
    assert "old" not in tops
    text = (tmp_path / page.PAGE).read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert IDEAL.name in text
    assert "never" in text
    entries = json.loads((tmp_path / page.DATA).read_text(encoding="utf-8"))
    assert len(entries) == 6
    page.check(tmp_path)
    (tmp_path / page.PAGE).write_text(text.replace("never", "0.90"), encoding="utf-8")
    with pytest.raises(InvalidInput, match="does not show the figures"):
        page.check(tmp_path)
    page.write(tmp_path, figures(), [])
    (tmp_path / page.TOPS_PAGE).write_text(tops, encoding="utf-8")
    with pytest.raises(InvalidInput, match=r"contact\.md does not show the figures"):
        page.check(tmp_path)


@pytest.mark.parametrize("arguments", [["codec", "--write"], ["--check"], ["codec", "control", "--size", "0.1"]])
def test_what_is_of_control_is_of_nothing_else(arguments):
    run = CliRunner().invoke(bench, arguments)
    assert isinstance(run.exception, InvalidInput)
    assert "bench control" in str(run.exception)


def test_only_the_chip_has_a_profile():
    run = CliRunner().invoke(bench, ["--profile"])
    assert isinstance(run.exception, InvalidInput)
    assert "--target rp2040 --profile" in str(run.exception)


def test_where_there_is_no_page_nothing_is_measured(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for option in ("--write", "--check"):
        run = CliRunner().invoke(bench, ["control", option])
        assert isinstance(run.exception, InvalidInput)
        assert "docs/control.md" in str(run.exception)
