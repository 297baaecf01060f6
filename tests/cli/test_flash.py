"""`bubbleskin flash` as its user meets it where no board is attached."""

import pytest

from bubbleskin.cli.command import main
from bubbleskin.flash.machine import ThisMachine


@pytest.fixture
def run(capsys, monkeypatch):
    """Run the command on a machine with nothing plugged in, whatever the one that tests has; status and sentence."""
    monkeypatch.setattr(ThisMachine, "ports", lambda self: [])
    monkeypatch.setattr(ThisMachine, "drives", lambda self: [])
    monkeypatch.setattr(ThisMachine, "unmounted", lambda self: None)

    def run(*arguments):
        with pytest.raises(SystemExit) as end:
            main(["flash", *arguments])
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return end.value.code, out, " ".join(err.split())

    return run


def test_nothing_is_attached(run):
    for arguments in ([], ["--json"], ["--board", "wristband7"]):
        status, out, sentence = run(*arguments)
        assert (status, out.strip()) == (1, "")
        assert "No wristband is found." in sentence


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--board", "wristband8"], "wristband8"),
        (["--mpy", "--previous"], "one of --uf2, --mpy and --previous"),
        (["--device", "x", "--drive", "."], "not both"),
        (["--drive", "{}", "--board", "wristband7"], "no boot loader's drive"),
    ],
)
def test_a_mistake_is_one_sentence_and_status_2(run, tmp_path, arguments, words):
    status, out, sentence = run(*(argument.format(tmp_path) for argument in arguments))
    assert (status, out.strip()) == (2, "")
    assert words in sentence


def test_a_rp2350s_drive_and_a_file_that_is_no_uf2(run, tmp_path):
    info = tmp_path / "INFO_UF2.TXT"
    info.write_text("UF2 Bootloader v1.0\nModel: Raspberry Pi RP2350\nBoard-ID: RP2350\n")
    status, _, sentence = run("--drive", str(tmp_path), "--board", "wristband7")
    assert status == 2
    assert "wrong kind" in sentence
    info.write_text("UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: RPI-RP2\n")
    file = tmp_path / "it.uf2"
    file.write_text("hello")
    status, _, sentence = run("--drive", str(tmp_path), "--board", "wristband7", "--uf2", str(file))
    assert status == 2
    assert "damaged or no UF2" in sentence
    assert sorted(path.name for path in tmp_path.iterdir()) == ["INFO_UF2.TXT", "it.uf2"]
