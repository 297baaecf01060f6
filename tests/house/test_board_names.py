"""A board is one file: its name stands nowhere else. In sentences and docstrings it may be an example."""

import ast
import re
from pathlib import Path

import pytest

BOARDS = "firmware/bubble_firmware/boards/"


def uses(text: str, names: set[str]) -> set[str]:
    """Strings that are a board's name or the URL of one, identifiers that hold one."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            bare = re.sub(r"^\w+://", "", node.value).partition("?")[0]
            found |= {node.value} if bare in names else set()
        elif isinstance(node, ast.Name | ast.Attribute | ast.FunctionDef | ast.ClassDef | ast.alias):
            word = getattr(node, "id", getattr(node, "attr", getattr(node, "name", "")))
            found |= {word} if any(name in word for name in names) else set()
    return found


def complaints(product: dict[str, str], names: set[str]) -> list[str]:
    return [
        f"{path}: {word}"
        for path, text in product.items()
        if not path.startswith(BOARDS)
        for word in sorted(uses(text, names))
    ]


@pytest.fixture(scope="module")
def names(root) -> set[str]:
    return {path.stem for path in Path(root, BOARDS).glob("*.py") if path.stem != "__init__"}


def test_boards_are_named_in_their_folder_only(product, names, judge):
    assert len(names) >= 2
    judge("board_names", {line: line for line in complaints(product, names)})


def test_a_boards_name_is_found(names):
    name = min(names)
    planted = {
        "a.py": f'"""Opens sim://{name}."""\nBOARDS = ("{name}",)\nURL = "sim://{name}?seed=3"\nprint("try {name}")\n',
        "b.py": f"from boards import {name}\n",
        BOARDS + "c.py": f'NAME = "{name}"\n',
    }
    assert complaints(planted, names) == [f"a.py: sim://{name}?seed=3", f"a.py: {name}", f"b.py: {name}"]
