"""Functions and modules stay small enough to read: complexity, parameters, lines."""

import ast
import json
import re
import subprocess
import sys

import pytest

COMPLEXITY, PARAMETERS, LINES = 12, 8, 400
COMPILED_COMPLEXITY = 40
FOLDERS = ("protocol", "firmware", "host_sdk", "tools", "tests", "hil_tests")
COMPILERS = {"viper", "njit"}


def module_name(path: str) -> str:
    return re.sub(r"^(protocol|firmware|host_sdk)/", "", path).removesuffix(".py").replace("/", ".")


def too_much(folder) -> dict[str, dict[str, int]]:
    """Functions above a limit, as ruff measures them: {"module:function": {"C901": 17}}."""
    limits = (f"--config=lint.mccabe.max-complexity={COMPLEXITY}", f"--config=lint.pylint.max-args={PARAMETERS}")
    options = ("--no-cache", "--isolated", "--ignore-noqa", "--output-format=json", "--select=C901,PLR0913")
    done = subprocess.run(
        [sys.executable, "-m", "ruff", "check", *options, *limits, *FOLDERS],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (0, 1), done.stderr
    found: dict[str, dict[str, int]] = {}
    for one in json.loads(done.stdout):
        path = one["filename"].removeprefix(f"{folder}/")
        name = function_at((folder / path).read_text(encoding="utf-8"), one["location"]["row"])
        value = int(re.search(r"\((\d+) > \d+\)", one["message"])[1])
        found.setdefault(f"{module_name(path)}:{name}", {})[one["code"]] = value
    return found


def functions(text: str) -> dict[str, ast.FunctionDef | ast.AsyncFunctionDef]:
    """All functions of a file, those in classes as `Class.function`, those in functions as `outer.inner`."""
    found = {}

    def walk(node, prefix):
        for child in ast.iter_child_nodes(node):
            name = prefix
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                name = f"{prefix}.{child.name}".lstrip(".")
                if not isinstance(child, ast.ClassDef):
                    found[name] = child
            walk(child, name)

    walk(ast.parse(text), "")
    return found


def function_at(text: str, row: int) -> str:
    return next(name for name, node in functions(text).items() if node.lineno == row)


def is_compiled(node) -> bool:
    """Whether a function, or one that stands in it, is compiled: `@micropython.viper`, `@njit(...)`."""
    words = {
        getattr(part, "attr", getattr(part, "id", ""))
        for inner in ast.walk(node)
        if isinstance(inner, ast.FunctionDef)
        for decorator in inner.decorator_list
        for part in ast.walk(decorator)
    }
    return bool(words & COMPILERS)


def complex_functions(found: dict[str, dict[str, int]], compiled: dict[str, str]) -> dict[str, str]:
    """Functions that are more complex than they may be, by name, with what is wrong."""
    return {
        name: f"{name} has complexity {values['C901']}: at most {COMPLEXITY}, compiled {COMPILED_COMPLEXITY}."
        for name, values in found.items()
        if values.get("C901", 0) > (COMPILED_COMPLEXITY if name in compiled else COMPLEXITY)
    }


def wide_functions(found: dict[str, dict[str, int]]) -> dict[str, str]:
    return {
        name: f"{name} has {values['PLR0913']} parameters: at most {PARAMETERS}."
        for name, values in found.items()
        if "PLR0913" in values
    }


def long_modules(python: dict[str, str]) -> dict[str, str]:
    lines = {path: len(text.splitlines()) for path, text in python.items()}
    return {
        path: f"{path} has {count} lines: at most {LINES}, data excepted."
        for path, count in lines.items()
        if count > LINES
    }


@pytest.fixture(scope="module")
def found(root):
    return too_much(root)


def test_functions_are_simple(found, allowed, judge):
    judge("complexity", complex_functions(found, allowed["compiled"]))


def test_functions_have_few_parameters(found, judge):
    judge("parameters", wide_functions(found))


def test_modules_are_short(python, judge):
    judge("long_modules", long_modules(python))


def test_what_is_listed_as_compiled_is_compiled_and_complex(found, python, allowed):
    assert {name for name in allowed["compiled"] if "C901" not in found.get(name, {})} == set(), "simple enough"
    texts = {module_name(path): text for path, text in python.items()}
    for name in allowed["compiled"]:
        module, _, function = name.partition(":")
        assert is_compiled(functions(texts[module])[function]), f"{name} is not compiled"


def test_large_functions_are_found(tmp_path):
    for folder in FOLDERS:
        (tmp_path / folder).mkdir()
    branches = "".join(f"    if a == {n}:\n        return {n}\n" for n in range(COMPLEXITY))
    names = ", ".join(f"p{n}" for n in range(PARAMETERS + 1))
    (tmp_path / "firmware/planted.py").write_text(
        f"class A:\n    def wide(self, {names}):\n        pass\n\n\ndef branchy(a):\n{branches}    return -1\n"
    )
    found = too_much(tmp_path)
    assert wide_functions(found) == {"planted:A.wide": "planted:A.wide has 9 parameters: at most 8."}
    said = "planted:branchy has complexity 13: at most 12, compiled 40."
    assert complex_functions(found, {}) == {"planted:branchy": said}


def test_a_compiled_function_has_a_limit_too():
    found = {"m:f": {"C901": 41}, "m:g": {"C901": 40}}
    assert set(complex_functions(found, {"m:f": "", "m:g": ""})) == {"m:f"}
    assert is_compiled(ast.parse("@micropython.viper\ndef f(a):\n    return a\n"))
    assert is_compiled(ast.parse("def outer():\n    @numba.njit(cache=True)\n    def f(a):\n        return a\n"))
    assert not is_compiled(ast.parse("@cache\ndef f(a):\n    return a\n"))


def test_long_modules_are_found():
    said = long_modules({"long.py": "pass\n" * (LINES + 1), "short.py": "pass\n" * LINES})
    assert said == {"long.py": "long.py has 401 lines: at most 400, data excepted."}
