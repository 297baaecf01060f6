"""`bubbleskin store` and `bubbleskin table --upload --save`."""

import json

import pytest

from bubbleskin.cli.command import main


@pytest.fixture
def run(capsys, tmp_path):
    """`run(*arguments)`: status, output, error; the wristband's flash is a file."""
    device = f"sim://wristband7?store={tmp_path / 'flash.bin'}"

    def call(*arguments):
        with pytest.raises(SystemExit) as ended:
            main([*arguments, "--device", device])
        out, err = capsys.readouterr()
        return ended.value.code, out, err

    return call


@pytest.mark.medium
def test_tables_saved_by_one_command_are_read_by_the_next(run):
    status, out, _ = run("store", "--json")
    assert status == 0
    assert json.loads(out)["source"] == "factory"
    status, _, err = run("table", "--mu-kpa", "35", "--upload", "--save")
    assert (status, "from now on" in err) == (0, True)
    facts = json.loads(run("store", "--json")[1])
    assert (facts["source"], facts["generation"], facts["tables_saved"]) == ("slot_a", 1, True)
    assert "1 in a, 0 in b" in run("store", "--save")[1], "nothing new, nothing written"
    assert "factory" in run("store", "--reset")[1]
    assert json.loads(run("store", "--json")[1])["source"] == "factory"


def test_what_cannot_be_meant_is_one_line(run):
    for arguments in (("store", "--save", "--reset"), ("table", "--save")):
        status, _, err = run(*arguments)
        assert (status, err.count("\n")) == (2, 1)
        assert "--save" in err
