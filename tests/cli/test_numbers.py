"""Numbers on the command line: whatever option takes one, of whatever verb, all go through the one check."""

import click
import pytest

from bubbleskin.cli.command import bubbleskin, main
from bubbleskin.cli.options import Real, Whole

NONE = (
    "nan",
    "-nan",
    "inf",
    "-inf",
    "1e400",
    "-1e400",
    "x",
    "",
    "1_000",
    "1,5",
    "٣",
    "1j",
    "9" * 5000,
    "\ud800",
    "0x10",
    "true",
)
"""What no option takes. `'9' * 5000` is a number, but beyond every range."""


def commands(group, path=()):
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from commands(command, (*path, name))
        else:
            yield (*path, name), command


def numeric():
    """Every option that takes a number."""
    for path, command in commands(bubbleskin):
        for option in command.params:
            if isinstance(option, click.Option) and option.type.name in (
                "float",
                "integer",
                "float range",
                "integer range",
            ):
                yield pytest.param(path, option, id=" ".join((*path, option.opts[-1])))


NUMERIC = list(numeric())


def refusal(capsys, path, option, text):
    """What the command ends with where this option is given as `text`: its status, and its sentence."""
    with pytest.raises(SystemExit) as end:
        main([*path, f"{option.opts[-1]}={text}", *(["x"] if "plot" in path or path[0] in ("fit", "play") else [])])
    told = capsys.readouterr()
    assert not told.out
    return end.value.code, told.err


def test_there_are_some():
    assert len(NUMERIC) > 30


@pytest.mark.parametrize(("path", "option"), NUMERIC)
def test_an_option_that_takes_a_number_is_checked_as_those_of_the_sdk(capsys, path, option):
    assert isinstance(option.type, Real | Whole), "nan and inf pass click's own"
    for text in NONE:
        status, said = refusal(capsys, path, option, text)
        assert status == 2, said
        assert said.startswith(f"{option.opts[-1]} is ")
        assert said.endswith(".\n")
        assert said.count("\n") == 1
        assert len(said) < 250


@pytest.mark.parametrize(("path", "option"), NUMERIC)
def test_a_number_beyond_the_range_is_told_the_range(capsys, path, option):
    low, high = option.type.low, option.type.high
    beyond = [f"{end:.17g}" for end in (low - 1, high + 1, -1e300, 1e300) if not low <= end <= high]
    if isinstance(option.type, Whole):
        beyond.append("0.5")
    elif option.type.above_zero:
        beyond += ["0", "-1"]
    for text in beyond:
        if abs(float(text)) != float("inf"):
            status, said = refusal(capsys, path, option, text)
            assert (status, said.startswith(f"{option.opts[-1]} is ")) == (2, True), said
            assert any(words in said for words in ("is allowed", "must be")), said


@pytest.mark.parametrize("text", [text for text in NONE if text] + ["1e300", "-5"], ids=lambda text: ascii(text)[:9])
@pytest.mark.parametrize(
    "verb",
    [
        "show {} 8 8 8 8 8 8",
        "show --all {}",
        "show --all 8 --over {}",
        "plan {} 8 8 8 8 8 8",
        "plan 8 8 8 8 8 8 8 --from {},8,8,8,8,8,8",
        "monitor --rate {}",
        "play pulse --at {}",
        "sim --spread {}",
        "table --mu-kpa {}",
        "table --c3-pa {}",
        "table --diameter-mm {}",
        "plot curve --up-to-mm {}",
        "fit docs/data/sheet.csv --pressure-noise-kpa {}",
        *(
            f"show --all 8 --device sim://wristband7?{name}={{}}"
            for name in ("seed", "spread", "loss", "realtime", "leak")
        ),
    ],
)
def test_what_the_verbs_do_with_numbers_that_cannot_be_meant(capsys, monkeypatch, verb, text):
    """Numbers that have no range on the command line are the wristband's or the model's to judge: a sentence, too."""
    if text == "1,5" and "{}" in verb.split()[1]:
        return  # a height may have a decimal comma
    if verb.startswith(("show", "play", "monitor")):
        monkeypatch.setenv("BUBBLESKIN_DEVICE", "sim://wristband7?contact=0")
    with pytest.raises(SystemExit) as end:
        main([word.format(text) for word in verb.split()])
    said = capsys.readouterr().err
    assert end.value.code == 2, said
    assert said.endswith(".\n")
    assert said.count("\n") == 1
