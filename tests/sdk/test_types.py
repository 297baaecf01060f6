"""A type checker over a user's script: it knows every value that the SDK returns, and finds the user's mistakes."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import bubble_protocol
import bubbleskin

SCRIPT = Path(__file__).with_name("user_script.py")
SOURCES = sorted({str(Path(package.__path__[0]).parent) for package in (bubbleskin, bubble_protocol)})
ANY_SHAPE = "tuple[Any, ...], "  # how numpy says that an array may have any shape


def marked(word):
    """The lines with this mark, and what stands after it."""
    lines = enumerate(SCRIPT.read_text(encoding="utf-8").splitlines(), start=1)
    found = [(number, re.search(rf"# {word}: (.+)$", line)) for number, line in lines]
    return {number: match[1] for number, match in found if match}


def run(command, **how):
    program = Path(sys.executable).with_name(command[0])
    return subprocess.run([program, *command[1:]], capture_output=True, text=True, timeout=500, **how)


def mypy(folder):
    """The revealed types and the errors, by line."""
    settings = folder / "mypy.ini"
    settings.write_text(f"[mypy]\nmypy_path = {':'.join(SOURCES)}\nfollow_imports = silent\n")
    done = run(
        ["mypy", "--strict", "--config-file", str(settings), "--cache-dir", str(folder), str(SCRIPT)], cwd=folder
    )
    found = re.findall(r"user_script\.py:(\d+): (note|error): (.*)", done.stdout)
    revealed = {int(line): text for line, kind, text in found if kind == "note" and "Revealed type" in text}
    assert revealed, done.stdout + done.stderr
    return revealed, {int(line): text for line, kind, text in found if kind == "error"}


def pyright(folder):
    """The same by pyright."""
    settings = folder / "pyrightconfig.json"
    config = {"typeCheckingMode": "standard", "extraPaths": SOURCES, "include": [str(SCRIPT)]}
    settings.write_text(json.dumps(config))
    done = run(["basedpyright", "--project", str(settings), "--pythonpath", sys.executable, "--outputjson"])
    report = json.loads(done.stdout)["generalDiagnostics"]
    found = [(one["range"]["start"]["line"] + 1, one["severity"], one["message"]) for one in report]
    return (
        {line: text for line, severity, text in found if severity == "information" and "Type of" in text},
        {line: text for line, severity, text in found if severity == "error"},
    )


@pytest.mark.slow
@pytest.mark.parametrize("checker", [mypy, pyright])
def test_a_users_script(checker, tmp_path):
    revealed, errors = checker(tmp_path)
    assert revealed.keys() == marked("is").keys()
    for line, expected in marked("is").items():
        kind = re.sub(r"\b\w+\.", "", revealed[line].replace(ANY_SHAPE, ""))
        kind = re.sub(r"^.*?(Revealed type|Type of .*) is ", "", kind).strip('"').replace('"', "")
        assert not re.search(r"\b(Any|Unknown)\b", kind), f"line {line}: {revealed[line]}"
        assert kind == expected or kind.startswith(f"{expected}["), f"line {line}: {revealed[line]}"
    assert errors.keys() == marked("wrong").keys(), errors


@pytest.mark.parametrize("package", [bubbleskin, bubble_protocol])
def test_the_packages_say_that_they_have_types(package):
    assert Path(package.__path__[0], "py.typed").exists()
