"""Viper functions compiled on this computer compute what MicroPython's own compiler makes of them."""

import importlib
import importlib.util
import os
import subprocess
import sys
from array import array
from textwrap import indent

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from llvmlite import binding as llvm

from bubbleskin import native
from bubbleskin.sim.jit import assemble, install, translate

WORDS = (0, 1, -1, 7, 255, 65535, 65536, -65536, 0x3FFFFFFF, -0x40000000, 123456789, -987654321)
"""What MicroPython has as small integers."""

# Programs: text within viper's subset. `a`, `b` and `c` have 8 entries each; `x` and `y` are numbers.

_names = st.sampled_from(["x", "y", "i", "z", "most", "least", "half"])
_places = st.builds("({} & 7)".format, _names) | st.integers(0, 7).map(str)
_loads = st.builds("{}[{}]".format, st.sampled_from("abc"), _places)
_leaves = _names | _loads | st.builds("ptr32(uint(a) + 4 * ({} & 3))[{}]".format, _names, st.integers(0, 4))
_expressions = st.recursive(
    _leaves,
    lambda inner: (
        st.builds("({} {} {})".format, inner, st.sampled_from(["+", "-", "*", "&", "|", "^"]), inner)
        | st.builds("({} {} {})".format, inner, st.sampled_from([">>", "<<"]), st.integers(0, 31))
        | st.builds("({} {} {})".format, inner, st.sampled_from(["//", "%"]), st.integers(1, 1 << 20))
        | st.builds("(-{})".format, inner)
        | st.builds("(~{})".format, inner)
    ),
    max_leaves=6,
)
_words = st.sampled_from(["and", "or"])
_conditions = st.builds(
    "{} {} {}".format, _expressions, st.sampled_from(["<", "<=", "==", "!=", ">", ">="]), _expressions
) | st.builds("{} < {} {} {}{} != 0".format, _expressions, _expressions, _words, st.sampled_from(["", "not "]), _leaves)
_assignments = (
    st.builds("{} = {}".format, st.sampled_from("xyz"), _expressions)
    | st.builds("{} {}= {}".format, st.sampled_from("xyz"), st.sampled_from("+-*&|^"), _expressions)
    | st.builds("{}[{}] = {}".format, st.sampled_from("abc"), _places, _expressions)
    | st.builds("{}[{}] ^= {}".format, st.sampled_from("abc"), _places, _expressions)
    | st.builds("z = {} if {} else {}".format, _expressions, _conditions, _expressions)
)


def _block(lines):
    return indent("\n".join(lines), "    ")


_statements = st.recursive(
    _assignments,
    lambda inner: (
        st.builds(
            lambda c, t, f: f"if {c}:\n{_block(t)}\nelse:\n{_block(f)}",
            _conditions,
            st.lists(inner, min_size=1, max_size=2),
            st.lists(inner, min_size=1, max_size=2),
        )
        | st.builds(
            lambda t, c, u, v: f"i = 0\nwhile i < 3:\n{_block(['i += 1', *t, f'if {c}:', f'    {u}', *v])}",
            st.lists(_assignments, min_size=1, max_size=2),
            _conditions,
            st.sampled_from(["break", "continue", "return z"]),
            st.lists(_assignments, max_size=1),
        )
    ),
    max_leaves=5,
)
programs = st.lists(_statements, min_size=1, max_size=5)
HEAD = "def program{}(a: ptr32, b: ptr16, c: ptr8, x: int, y: int) -> int:\n    i = 0\n    z = 1\n"
# Constants are locals: MicroPython folds those of an expression, to numbers that viper has not.
HEAD += "    most = 0x3FFFFFFF\n    least = -0x3FFFFFFF\n    half = 65536\n"


def text(number, statements):
    return HEAD.format(number) + _block(statements) + "\n    return z ^ x ^ y\n"


def memory():
    return (
        array("i", [5, -3, 1 << 30, -(1 << 31), 77, 0, -1, 9]),
        array("H", range(65000, 65008)),
        bytearray(range(250, 256)) + bytearray(2),
    )


RUN = """
from array import array
def report(program):
    a, b = array("i", [5, -3, 0x3fffffff + 1, -0x40000000 * 2, 77, 0, -1, 9]), array("H", range(65000, 65008))
    c = bytearray(range(250, 256)) + bytearray(2)
    said = program(a, b, c, {x}, {y})
    print(said, list(a), list(b), list(c))
"""


@pytest.mark.slow
@settings(max_examples=20, phases=[Phase.generate])
@given(sources=st.lists(programs, min_size=12, max_size=12), x=st.sampled_from(WORDS), y=st.sampled_from(WORDS))
def test_random_programs_give_the_same_on_micropython(sources, x, y, micropython, tmp_path_factory):
    texts = [text(number, statements) for number, statements in enumerate(sources)]
    script = RUN.format(x=x, y=y) + "".join(
        f"@micropython.viper\n{source}\nreport(program{number})\n" for number, source in enumerate(texts)
    )
    said = micropython(script).splitlines()

    path = tmp_path_factory.mktemp("programs") / "programs.py"
    path.write_text(
        "from bubble_protocol.mpy_compat import ptr8, ptr16, ptr32, uint\n" + "".join(texts), encoding="utf-8"
    )
    functions = loaded(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(path.parent))
        made = native.load("programs", path.read_bytes(), lambda: assemble.assembly(functions, {}))
    for number, line in enumerate(said):
        buffers = memory()
        memo = [None, 0, None] * 3
        for at, buffer in enumerate(buffers):
            install.locate(memo, 3 * at, buffer)
        answer = made[f"program{number}"](memo[1], memo[4], memo[7], x, y)
        assert f"{answer} {' '.join(str(list(buffer)) for buffer in buffers)}" == line, texts[number]


def loaded(path):
    """The programs of a file, by name."""
    spec = importlib.util.spec_from_file_location(path.parent.name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return {name: value for name, value in vars(module).items() if name.startswith("program")}


@pytest.mark.medium
def test_every_viper_function_that_runs_here_is_understood():
    """What LLVM makes of it is another matter: simulated boards run that in most tests."""
    install.enable()
    for name in ("control.bubbles", "app", "sequence.player", "store.slots", "link.server", "drivers.pwm"):
        importlib.import_module(f"bubble_firmware.{name}")
    modules = install.functions_of
    assert not [name for name in modules if ".drivers." in name]
    assert sum(len(functions) for functions in modules.values()) > 30
    for name, functions in modules.items():
        llvm.parse_assembly(assemble.assembly(functions, vars(sys.modules[name])).text).verify()


@pytest.mark.parametrize("body", ["return x / 2", "return len(x)", "x.y = 1", "return unknown"])
def test_what_is_not_viper_is_not_guessed_at(body, tmp_path):
    path = tmp_path / "odd.py"
    path.write_text(f"def program(x: int) -> int:\n    {body}\n", encoding="utf-8")
    with pytest.raises(translate.NotViperError):
        assemble.assembly(loaded(path), {})


def test_beyond_32_bits_is_found_by_the_check():
    with pytest.raises(OverflowError, match="beyond 32 bits"):
        install.whole(1 << 31)
    assert install.whole(-1 << 31) == -1 << 31


SCRIPT = """
import bubbleskin as bs
skin = bs.connect("sim://wristband7?seed=3&spread=0.1&contact=0")
skin.show([6, 7, 8, 9, 10, 11, 12], wait=False)
skin.sleep(0.5)
skin.show([12, 11, 10, 9, 8, 7, 6], over=0.2, wait=False)
skin.sleep(0.5)
print(skin.state().height_mm.tolist(), skin.state().pressure_kpa.tolist())
"""


def run(**environment):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
def test_compiled_plain_and_checked_are_the_same(tmp_path):
    """And where nothing can be kept it is plain, and says so once."""
    nowhere = tmp_path / "file"
    nowhere.write_text("")
    ways = [run(BUBBLESKIN_JIT=way) for way in ("1", "0", "check")] + [run(XDG_CACHE_HOME=str(nowhere / "in it"))]
    assert [status for status, _, _ in ways] == [0] * 4, [error for _, _, error in ways]
    assert len({said for _, said, _ in ways}) == 1
    assert ways[3][2].count("plain Python") == 1


@pytest.mark.medium
def test_a_switch_that_is_none_is_a_sentence():
    status, _, error = run(BUBBLESKIN_JIT="yes")
    assert status == 1
    assert "BUBBLESKIN_JIT is 'yes': it may be 1 (compiled), 0 (plain Python) or check (plain, checked)." in error
