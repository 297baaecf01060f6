"""Who may import whom stands in pyproject.toml; every contract there is seen to be broken once."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib

import pytest

# file, an import that must not be, what the linter says then
VIOLATIONS = [
    ("protocol/bubble_protocol/crc.py", "import bubble_firmware.app", "bubble_protocol.crc -> bubble_firmware.app"),
    (
        "protocol/bubble_protocol/mpy_compat.py",
        "from bubble_protocol import codec",
        "mpy_compat -> bubble_protocol.codec",
    ),
    ("firmware/bubble_firmware/control/curve.py", "from bubble_firmware import app", "curve -> bubble_firmware.app"),
    ("firmware/bubble_firmware/odds_and_ends.py", "", "- bubble_firmware.odds_and_ends"),
    ("host_sdk/bubbleskin/link/clock.py", "from bubbleskin import skin", "bubbleskin.link.clock -> bubbleskin.skin"),
    ("host_sdk/bubbleskin/helpers/__init__.py", "", "- bubbleskin.helpers"),
    (
        "host_sdk/bubbleskin/membrane/wall.py",
        "TYPE_CHECKING = False\nif TYPE_CHECKING:\n    from bubbleskin.membrane import balloon",
        "No cycles are allowed in bubbleskin.membrane.",
    ),
    ("host_sdk/bubbleskin/flash/update.py", "from bubble_firmware import app", "Illegal imports of protected package"),
    (
        "host_sdk/bubbleskin/sim/pneumatics.py",
        "from bubbleskin.membrane.balloon import ATMOSPHERE",
        "bubbleskin.sim.pneumatics -> bubbleskin.membrane.balloon",
    ),
    (
        "host_sdk/bubbleskin/calibrate/rubber.py",
        "from bubbleskin.membrane.balloon import ATMOSPHERE",
        "bubbleskin.calibrate.rubber -> bubbleskin.membrane.balloon",
    ),
    ("firmware/bubble_firmware/store/slots.py", "import machine", "bubble_firmware.store.slots -> machine"),
]


@pytest.fixture(scope="module")
def said(root, tmp_path_factory) -> str:
    """What the linter says of a copy of the three packages with all these imports added."""
    folder = tmp_path_factory.mktemp("planted")
    for package in ("protocol", "firmware", "host_sdk"):
        shutil.copytree(root / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(root / "pyproject.toml", folder)
    for name, line, _ in VIOLATIONS:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(f"\n{line}\n")
    paths = os.pathsep.join(str(folder / package) for package in ("protocol", "firmware", "host_sdk"))
    command = "import sys; from importlinter.cli import lint_imports_command; sys.exit(lint_imports_command())"
    done = subprocess.run(
        [sys.executable, "-c", command, "--no-cache", "--no-logo"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": paths, "COLUMNS": "300"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode
    return done.stdout + done.stderr


def test_every_contract_is_broken_by_what_is_planted(said, root):
    settings = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    for contract in settings["contracts"]:
        assert re.search(rf"{re.escape(contract['name'])} BROKEN", said), said


@pytest.mark.parametrize(("name", "line", "message"), VIOLATIONS, ids=[name for name, _, _ in VIOLATIONS])
def test_a_forbidden_import_is_found(said, name, line, message):
    assert message in said, said


def hidden_imports(product: dict[str, str]) -> list[str]:
    """Imports by a string, which no contract sees: `import_module("bubbleskin.sequence.model")`."""
    return [
        f"{path}: {node.args[0].value}"
        for path, text in product.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call)
        and getattr(node.func, "id", getattr(node.func, "attr", "")) in ("import_module", "__import__")
        and isinstance(node.args[0], ast.Constant)
        and str(node.args[0].value).startswith("bubble")
    ]


def test_no_import_is_hidden_in_a_string(product, judge):
    judge("hidden_imports", {line: line for line in hidden_imports(product)})


def test_a_hidden_import_is_found():
    planted = 'from importlib import import_module\nmade = import_module("bubbleskin.skin")\n'
    assert hidden_imports({"planted.py": planted}) == ["planted.py: bubbleskin.skin"]


def test_hil_tests_use_the_public_sdk_only(python):
    said = [
        line for path, text in python.items() if path.startswith("hil_tests/") for line in private_imports(path, text)
    ]
    assert said == []


def private_imports(path: str, text: str) -> list[str]:
    """Imports of anything of ours but `bubbleskin` itself and its public rooms."""
    said = []
    for node in ast.walk(ast.parse(text)):
        modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        said += [f"{path}: {name}" for name in modules if name.startswith(("bubble_", "bubbleskin.", "tests", "tools"))]
    return said


def test_a_private_import_of_hil_tests_is_found():
    text = "import bubbleskin as bs\nfrom bubbleskin.link import window\nimport bubble_firmware\n"
    assert private_imports("t.py", text) == ["t.py: bubbleskin.link", "t.py: bubble_firmware"]
