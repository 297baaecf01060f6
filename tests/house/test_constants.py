"""A constant is defined once. Where MicroPython needs it in another file, tools/generate/constants.py writes it there."""

import ast
import re

REGION = re.compile(r"^# \[constants\] .*?^# \[end of constants\]\n", re.MULTILINE | re.DOTALL)


def constants(text: str) -> dict[str, object]:
    """Module-level `NAME = value` and `NAME = const(value)` outside generated regions, names without underscore."""
    found = {}
    for node in ast.parse(REGION.sub("", text)).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        if not isinstance(target, ast.Name) or not re.fullmatch(r"_*[A-Z][A-Z0-9_]*", target.id):
            continue
        value = node.value
        if isinstance(value, ast.Call) and getattr(value.func, "id", "") == "const":
            value = value.args[0]
        try:
            number = eval(compile(ast.Expression(value), "", "eval"), {"__builtins__": {}})
        except (NameError, TypeError):
            continue  # made from other names: nothing is repeated
        if isinstance(number, int | float | str | bytes):
            found[target.id.lstrip("_")] = number
    return found


def complaints(product: dict[str, str]) -> dict[str, list[str]]:
    """Names that two modules give the same value, and these modules."""
    places: dict[tuple, list[str]] = {}
    for path, text in product.items():
        for name, value in constants(text).items():
            places.setdefault((name, type(value), value), []).append(path)
    return {name: paths for (name, _, _), paths in places.items() if len(paths) > 1}


def without_boards(product: dict[str, str]) -> dict[str, str]:
    """A board is data of its own: two boards may have the same figure for different reasons."""
    return {path: text for path, text in product.items() if not path.startswith("firmware/bubble_firmware/boards/")}


def test_a_constant_is_defined_once(product, judge):
    found = complaints(without_boards(product))
    judge("constants", {name: f"{name} is defined in {' and '.join(paths)}" for name, paths in found.items()})


def test_a_constant_defined_twice_is_found():
    planted = {
        "a.py": "LIMIT = 3 * 4\nOTHER = 1\n",
        "b.py": "_LIMIT = const(12)\nOTHER = 2\n",
        "c.py": "# [constants] a: LIMIT\n_LIMIT = const(12)\n# [end of constants]\n",
    }
    assert complaints(planted) == {"LIMIT": ["a.py", "b.py"]}
