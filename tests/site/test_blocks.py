"""Blocks of pages that no doctest runs: commands are such as the command line takes, and the test that a page writes passes."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

from bubbleskin.cli.command import bubbleskin

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMAND = re.compile(r"^    (?:\S*/)?bubbleskin (.*)$", re.MULTILINE)
TARGETS = ("sim://wristband7", "sim://wristband19")


def commands(page: Path) -> list[list[str]]:
    """The words after `bubbleskin` in the page's blocks, without what a shell does with them."""
    lines = [shlex.split(line, comments=True) for line in COMMAND.findall(page.read_text(encoding="utf-8"))]
    return [
        line[: min([line.index(sign) for sign in ("|", ">", "&&") if sign in line], default=None)] for line in lines
    ]


def check(words: list[str]) -> None:
    """Raise click.UsageError where the command line would; files need not be there."""
    command: click.Command = bubbleskin
    words = list(words)
    while isinstance(command, click.Group) and words and words[0] in command.commands:
        command = command.commands[words.pop(0)]
    try:
        context = command.make_context("bubbleskin", list(words))
        if isinstance(command, click.Group) and words and not words[0].startswith("-"):
            command.resolve_command(context, words)  # says that there is no such verb
    except click.BadParameter as error:
        if "does not exist" not in str(error):
            raise
    except click.exceptions.Exit:
        pass  # --help


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_command_line_takes_what_pages_write(page):
    for words in commands(page):
        check(words)


def test_commands_are_found_and_wrong_ones_are_said():
    assert len(commands(ROOT / "docs/start.md")) > 8
    with pytest.raises(click.UsageError, match="No such option"):
        check(["info", "--jsn"])
    with pytest.raises(click.UsageError):
        check(["shows"])


@pytest.mark.medium
def test_the_start_pages_simulated_commands_run(command):
    simulated = [
        words for words in commands(ROOT / "docs/start.md") if any(word.startswith("sim://") for word in words)
    ]
    assert len(simulated) == 2
    for words in simulated:
        status, _, problem = command(*words)
        assert status == 0, problem


@pytest.mark.medium
def test_the_test_that_a_page_writes_passes_on_both_boards(tmp_path):
    text = (ROOT / "docs/hil_test.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (tmp_path / "test_wave.py").write_text(block, encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "hil_tests.conftest",
        "test_wave.py",
    ]
    for target in TARGETS:
        command += ["--target", target]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([*sys.path, str(ROOT)])}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{block.count('def test_') * len(TARGETS)} passed" in done.stdout
