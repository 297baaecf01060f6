"""Old words do not come back: `words.toml` has those that the project gave up and what it says instead."""

import ast
import re
import tomllib

import pytest


@pytest.fixture(scope="module")
def words(root) -> dict[str, dict]:
    return tomllib.loads((root / "tests/house/words.toml").read_text(encoding="utf-8"))


def identifiers(text: str) -> set[str]:
    """Every name that a file gives or uses, without underscores at its ends."""
    fields = ("id", "attr", "name", "arg", "asname")
    names = {getattr(node, field, None) for node in ast.walk(ast.parse(text)) for field in fields}
    return {name.strip("_") for name in names if isinstance(name, str)}


def complaints(texts: dict[str, str], words: dict[str, dict]) -> dict[str, str]:
    """{"path: word": sentence} of old words in Python files and pages."""
    found = {}
    for path, text in texts.items():
        small = re.sub(r"\s+", " ", text.lower())
        for old, new in words["everywhere"].items():
            if re.search(rf"(?<![a-z]){re.escape(old.lower())}s?(?![a-z])", small):
                found[f"{path}: {old}"] = f"{path} says {old}: it is {new}."
        for room, olds in words["identifiers"].items():
            if path.startswith(f"{room}/") and path.endswith(".py"):
                own = identifiers(text) | {path.rpartition("/")[2].removesuffix(".py")}
                for old, new in olds.items():
                    if old in own:
                        found[f"{path}: {old}"] = f"{path} has the name {old}: it is {new}."
    return found


def test_old_words_are_gone(product, pages, words, allowed):
    still_open = allowed.get("open", {}).get("words", {})
    found = complaints({**product, **pages}, words)
    assert [line for name, line in found.items() if name not in words["allowed"] and name not in still_open] == []
    assert set(words["allowed"]) - set(found) == set(), "listed as allowed in words.toml, and not there"


def test_every_room_of_the_list_is_there(root, words):
    assert [room for room in words["identifiers"] if not (root / room).is_dir()] == []


def test_an_old_word_is_found(words):
    planted = {
        "firmware/bubble_firmware/control/planted.py": "_COAST = 1\n",
        "host_sdk/bubbleskin/link/planted.py": "class A:\n    def tend(self, other):\n        return other.sentences\n",
        "host_sdk/bubbleskin/planned.py": "tend = 1\n",
        "docs/planted.md": "The guard keeps a *book of\nair*, and has a FaultLink.",
    }
    assert set(complaints(planted, words)) == {
        "firmware/bubble_firmware/control/planted.py: COAST",
        "host_sdk/bubbleskin/link/planted.py: sentences",
        "host_sdk/bubbleskin/link/planted.py: tend",
        "docs/planted.md: book of air",
        "docs/planted.md: faultlink",
    }
