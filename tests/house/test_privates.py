"""Nobody touches another object's privates: `x._name` only where `_name` is the same module's own."""

import ast

DOCUMENTED = {"_asdict", "_fields", "_replace", "_exit", "_getframe", "_repr_png_"}
"""Public in spite of their underscore: of named tuples, `os` and `sys`, and what notebooks ask for."""


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("__") and name != "_" and name not in DOCUMENTED


def own_names(tree: ast.AST) -> set[str]:
    """What a module defines itself: functions, classes, fields, `self._x = …`, names it assigns."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and is_self(node.value):
            found.add(node.attr)
    return found


def is_self(node: ast.AST) -> bool:
    return isinstance(node, ast.Name) and node.id in ("self", "cls")


def uses(text: str) -> set[str]:
    """Private names of others that a file touches or imports."""
    tree = ast.parse(text)
    own, found = own_names(tree), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and is_private(node.attr) and not is_self(node.value):
            found.add(node.attr)
        elif isinstance(node, ast.ImportFrom):
            found.update(alias.name for alias in node.names if is_private(alias.name) and node.module != "__future__")
    return found - own


def complaints(python: dict[str, str]) -> list[str]:
    return [f"{path}: {name}" for path, text in python.items() for name in sorted(uses(text))]


def test_privates_are_left_alone(python, judge):
    judge("privates", {line: line for line in complaints(python)})


def test_a_private_name_of_another_object_is_found():
    text = "from other import _hidden\nclass A:\n    def f(self, other):\n        return other._x, self._y, other._asdict()\n"
    assert complaints({"planted.py": text}) == ["planted.py: _hidden", "planted.py: _x"]


def test_a_module_may_use_its_own():
    text = "class A:\n    def __init__(self, other):\n        self._x = other._x\n"
    assert complaints({"planted.py": text}) == []
