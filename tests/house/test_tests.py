"""A test asks the program, not its text: numbers are compared as numbers, where they are defined."""

import ast

READERS = {"getsource", "getsourcelines"}


def complaints(tests: dict[str, str]) -> list[str]:
    """Tests that take source apart: `ast.parse`, `inspect.getsource`, a string that looks for `const(`."""
    said = []
    for path, text in tests.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Attribute) and (
                node.attr in READERS or (node.attr == "parse" and getattr(node.value, "id", "") == "ast")
            ):
                said.append(f"{path}: {node.attr}")
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "= const(" in node.value:
                said.append(f"{path}: const")
    return sorted(set(said))


def test_tests_do_not_parse_source(python, judge):
    tests = {path: text for path, text in python.items() if path.startswith(("tests/", "hil_tests/"))}
    judge("parsing_tests", {line: line for line in complaints(tests) if not line.startswith("tests/house/")})


def test_a_test_that_parses_source_is_found():
    planted = {"a.py": 'names = [line.split(" = const(")[0] for line in lines]\n', "b.py": "tree = ast.parse(text)\n"}
    assert complaints(planted) == ["a.py: const", "b.py: parse"]
