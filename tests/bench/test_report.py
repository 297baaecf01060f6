"""The page of benchmarks: every figure with its command, its spread and the machine."""

import math
import re
from statistics import median

import pytest
from click.testing import CliRunner

from bubbleskin.bench import report
from bubbleskin.bench.report import Figure
from bubbleskin.cli.bench import bench


def test_a_figure_is_the_middle_one_beside_the_lowest_and_the_highest():
    found = {
        "codec": [Figure("  ours in theirs", (0.5, 0.25, 0.75), "×", "≤ 0.8"), Figure("soon", (math.inf,) * 3, "s", "")]
    }
    text = report.page(found, {"processor": "a good one"})
    assert "| … ours in theirs | 0.5 | 0.25 to 0.75 | × | ≤ 0.8 |" in text
    assert "| soon | never | never | s |  |" in text
    assert "    bubbleskin bench codec\n" in text
    assert "| processor | a good one |" in text


def test_the_machine_is_described_without_its_name():
    import platform

    where = report.machine()
    assert where["Python"].endswith(platform.python_version())
    assert all(where.values())
    assert int(where["cores"]) >= 1
    assert platform.node() not in " ".join(where.values())


def test_runs_are_kept_apart_and_their_names_agree():
    found = report.figures("codec", runs=3, size=0.005)
    assert len(found) == 12
    for figure in found:
        assert len(figure.values) == 3
        assert min(figure.values) <= median(figure.values) <= max(figure.values)
    lines = report.page({"codec": found}, {}).splitlines()
    assert sum(bool(re.search(r"in pymavlink \| [\d.e+]+ \|", line)) for line in lines) == 4


def test_the_page_is_written_where_it_belongs(tmp_path):
    (tmp_path / "docs").mkdir()
    told = []
    rows = report.write(tmp_path, ("codec",), told.append, size=0.005)
    text = (tmp_path / report.PAGE).read_text(encoding="utf-8")
    assert told == ["codec"]
    assert len(rows) == 12
    assert all(row.name.strip() in text for row in rows)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["codec", "--write"], "without a PART"),
        (["--write", "--seed", "3"], "of one bench"),
        (["--write"], "run this in the folder of bubbleskin's repository"),
    ],
)
def test_what_cannot_be_written_is_said_before_anything_is_measured(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke(bench, words)
    assert run.exit_code == 1
    assert said in str(run.exception)
    assert list(tmp_path.iterdir()) == []
