"""fit, table and plot as their user meets them."""

import json
from pathlib import Path

import click
import pytest

from bubbleskin.cli import membrane, plot
from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import Calibration, simulate_sheet, write_csv

ROOT = Path(__file__).parents[2]
SHEET = str(ROOT / "docs/data/sheet.csv")
BUBBLE = str(ROOT / "docs/data/single_bubble.csv")


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """Run the verbs in an empty folder; returns standard output and the exit status."""
    monkeypatch.chdir(tmp_path)
    group = click.Group(commands={command.name: command for command in (*membrane.commands, *plot.commands)})

    def run(*arguments):
        status = 0
        try:
            group.main(list(arguments), standalone_mode=False)
        except SystemExit as end:
            status = end.code
        return capsys.readouterr().out, status

    return run


def test_fit_of_one_bubble(run):
    out, _ = run("fit", BUBBLE)
    assert "mu = " in out
    assert "95 % interval" in out
    found = json.loads(run("fit", BUBBLE, "--json")[0])
    assert found["mu_pa"] == pytest.approx(39.62e3, rel=0.02)
    assert found["mu_95_pa"][0] < 39.62e3 < found["mu_95_pa"][1]
    assert found["diameter_is"] == "mid"


@pytest.mark.medium
def test_fit_of_a_sheet_makes_a_calibration_and_a_picture(run):
    out, _ = run("fit", SHEET, "-o", "a.toml", "--board", "mine", "--picture", "a.png")
    assert out.count("±") >= 21
    calibration = Calibration.load("a.toml")
    assert (calibration.board, len(calibration.tables)) == ("mine", 7)
    assert calibration.source == "fit of sheet.csv"
    assert Path("a.png").stat().st_size > 10_000
    assert len(json.loads(run("fit", SHEET, "--json")[0])["bubbles"]) == 7


def test_table_of_a_preset_of_constants_and_of_data(run):
    assert run("table", "--bubbles", "2")[0].count("every height within") == 2
    out, _ = run("table", "--c1-kpa", "39.62", "--bubbles", "1", "--json")
    (bubble,) = json.loads(out)["bubbles"]
    assert len(bubble["height_um"]) == 64
    assert max(b - a for a, b in zip(bubble["pressure_pa"], bubble["pressure_pa"][1:], strict=False)) > 0
    assert min(b - a for a, b in zip(bubble["pressure_pa"], bubble["pressure_pa"][1:], strict=False)) < 0
    assert "fit of sheet.csv" in run("table", "--data", SHEET)[0]


@pytest.mark.medium
def test_tables_are_shown_and_compared(run):
    run("table", "-o", "a.toml")
    run("table", "--mu-kpa", "41", "-o", "b.toml")
    assert run("table", "--show", "a.toml", "--compare", "a.toml") == (
        run("table", "--show", "a.toml")[0] + "no difference\n",
        0,
    )
    out, status = run("table", "--show", "a.toml", "--compare", "b.toml")
    assert status == 1
    assert out.count("Pa apart") == 7


@pytest.mark.medium
@pytest.mark.parametrize(
    "arguments",
    [
        ("curve", "--c1-kpa", "39.62"),
        ("curve", "--wall", "thick", "--diameter-is", "outer"),
        ("fit", BUBBLE),
        ("fit", SHEET),
        ("figure4",),
        ("figure6",),
    ],
)
def test_pictures(run, arguments):
    run("plot", *arguments, "-o", "picture.png")
    assert Path("picture.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.medium
def test_picture_of_a_table(run):
    run("table", "-o", "a.toml")
    run("plot", "table", "a.toml", "--bubble", "6")
    assert Path("table.png").exists()


def test_bad_rows_are_left_out_on_request_only(run, capsys):
    measured, _ = simulate_sheet(1, seed=0)
    write_csv("a.csv", measured)
    with Path("a.csv").open("a") as file:
        file.write("0,3,oops,21\n")
    with pytest.raises(InvalidInput, match="line 44: height is 'oops'"):
        run("fit", "a.csv")
    out, _ = run("fit", "a.csv", "--skip-bad-rows")
    assert "42 points" in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("fit", "nowhere.csv"), "Cannot read the measurements nowhere.csv"),
        (("fit", BUBBLE, "--thickness-mm", "0"), "--thickness-mm is 0 mm; it must be above zero"),
        (("fit", BUBBLE, "--height-noise-mm", "-1"), "--height-noise-mm is -1 mm; it must be above zero"),
        (("table", "--preset", "rubber"), "no preset 'rubber'; there are paper"),
        (("table", "--mu-kpa", "40", "--c1-kpa", "20"), "exactly one of"),
        (("table", "--bubbles", "0"), "--bubbles is 0; 1 to 1000 is allowed"),
        (("table", "--knots", "1"), "knots is 1; 2 to 64 is allowed"),
        (("table", "--up-to-mm", "nan"), "--up-to-mm is nan mm"),
        (("table", "--show", "nowhere.toml"), "Cannot read the calibration nowhere.toml"),
        (("plot", "curve", "--diameter-is", "inner"), "thin wall has one diameter"),
    ],
)
def test_mistakes_are_one_sentence(run, arguments, says):
    with pytest.raises(InvalidInput, match=says):
        run(*arguments)
