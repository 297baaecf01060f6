"""`bubbleskin plan`."""

import json

import pytest

from bubbleskin.cli import main


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    said = capsys.readouterr()
    return end.value.code, said.out, said.err


@pytest.mark.medium
def test_a_plan_is_printed_and_explained(capsys):
    status, out, _ = run(capsys, "plan", "13.9", *["11.88"] * 6)
    assert status == 0
    assert "Bubble 0 goes first" in out


@pytest.mark.medium
def test_json_has_what_to_send(capsys):
    status, out, _ = run(capsys, "plan", "--shape", "dome", "--board", "wristband19", "--json")
    facts = json.loads(out)
    assert status == 0
    assert len(facts["steps"][-1]["target_mm"]) == 19
    assert facts["error_mm"] < 0.2


def test_from_another_shape(capsys):
    status, out, _ = run(capsys, "plan", "--shape", "flat", "--from", "8,8,8,8,8,8,8", "--json")
    assert status == 0
    assert json.loads(out)["steps"][0]["target_mm"] == [0] * 7


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["8", "8"], "2 heights for 7 bubbles"),
        ([], "in one way"),
        (["8", "--shape", "dome"], "in one way"),
        (["high"] * 7, "not a height"),
        (["8"] * 7 + ["--anyway"], "goes with --play"),
    ],
)
def test_mistakes_are_one_line_and_status_2(capsys, arguments, words):
    status, out, err = run(capsys, "plan", *arguments)
    assert status == 2
    assert words in err
    assert not out
    assert len(err.strip().splitlines()) == 1


@pytest.mark.medium
def test_the_picture_is_drawn(capsys, tmp_path):
    path = tmp_path / "plan.png"
    status, _, err = run(capsys, "plan", "13.9", *["11.88"] * 6, "--plot", str(path))
    assert status == 0
    assert "wrote" in err
    assert path.read_bytes()[:4] == b"\x89PNG"


def test_what_is_not_sure_is_played_when_asked_twice(capsys):
    near = ["10.92", "11.04", "10.81", "9.68", "11.92", "10.33", "9.0", "--play", "--device", "sim://wristband7"]
    status, _, err = run(capsys, "plan", *near)
    assert status == 2
    assert "anyway" in err
    status, _, err = run(capsys, "plan", *near, "--anyway")
    assert status == 0
    assert "played" in err
