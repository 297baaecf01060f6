"""Native code is kept and found again, by what it is made of; who runs it does not wait for numba."""

import os
import resource
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import bubble_firmware
import bubble_protocol
from bubbleskin import native
from bubbleskin.native.said import COMPILING


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache folder of this test's own, empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    yield tmp_path / "bubbleskin" / "native"
    native.UNKEPT.clear()  # what could not be kept here is no news for `doctor` in another test


@pytest.fixture
def loaded(cache):
    """`loaded(factor)`: what a + factor b gives for 40 and 2, and whether it was compiled for that."""
    compiled = []

    def load(factor: int = 1, **options):
        def make():
            import numba

            compiled.append(factor)
            return {"added": numba.njit("int64(int64, int64)")(lambda a, b: a + factor * b)}

        compiled.clear()
        added = native.load("added", f"a + {factor} b".encode(), make, **options)["added"]
        return added(40, 2), bool(compiled)

    return load


def test_it_is_compiled_once(loaded, cache):
    assert [loaded(), loaded()] == [(42, True), (42, False)]
    assert len(list(cache.iterdir())) == 1


@pytest.mark.medium
def test_another_source_is_compiled_anew(loaded):
    assert [loaded(1), loaded(2), loaded(1)] == [(42, True), (44, True), (42, False)]


@pytest.mark.medium
def test_half_a_file_is_compiled_anew(loaded, cache):
    loaded()
    (path,) = cache.iterdir()
    path.write_bytes(path.read_bytes()[:-100])
    assert [loaded(), loaded()] == [(42, True), (42, False)]


@pytest.mark.medium
def test_where_nothing_can_be_kept_every_start_compiles_and_says_so(loaded, cache, capsys):
    cache.parent.write_text("a file where a folder should be")
    assert [loaded(), loaded()] == [(42, True), (42, True)]
    told = capsys.readouterr().err
    assert told.count(f"Compiled code cannot be kept in {cache}, so every start compiles: Not a directory.") == 1
    with pytest.raises(NotADirectoryError):
        loaded(unkept=False)


ADDED = """
from bubbleskin import native

def make():
    import numba
    return {"added": numba.njit("int64(int64, int64)")(lambda a, b: a + b)}

print(native.load("added", b"a + b", make)["added"](40, 2))
import sys
print("numba" in sys.modules)
"""


def run(cache, code: str = ADDED) -> tuple[list[str], str]:
    """What a Python prints that loads a function from, or into, this cache folder: words of standard output, and error."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split(), done.stderr


@pytest.mark.slow
def test_two_processes_may_compile_at_once_and_say_so_and_a_third_does_not_import_numba(tmp_path):
    with ThreadPoolExecutor() as pool:
        both = list(pool.map(run, [tmp_path] * 2))
    said = f"{COMPILING}\n"
    assert [words[0] for words, _ in both] == ["42", "42"]
    assert said in {told for _, told in both} <= {"", said}
    assert len(list((tmp_path / "bubbleskin" / "native").iterdir())) == 1
    assert run(tmp_path) == (["42", "False"], "")


@pytest.mark.slow
@pytest.mark.parametrize("hurt", ["no folder", "full disk"])
def test_numbas_cache_is_not_compulsory_either(tmp_path, hurt):
    """The package where nothing can be written, a home that is none; or a disk that is full once all is compiled."""
    sources = Path(native.__file__).parents[1]
    for package in (sources, Path(bubble_protocol.__path__[0]), Path(bubble_firmware.__path__[0])):
        shutil.copytree(package, tmp_path / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    home = tmp_path / "home"
    if hurt == "no folder":
        home.write_text("a file")
        (tmp_path / "bubbleskin/contact/__pycache__").write_text("a file")
    environment = {name: value for name, value in os.environ.items() if name != "XDG_CACHE_HOME"}
    environment |= {"HOME": str(home), "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "bubbleskin", "plan", "8", "8", "8", "8", "8", "8", "8"],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        preexec_fn=lambda: hurt == "no folder" or resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000)),
    )
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stderr.splitlines() if line.strip()]
    reason = {"no folder": "no folder can be written to", "full disk": "File too large"}[hurt]
    unkept = f"Compiled code cannot be kept in numba's cache, so every start compiles: {reason}."
    assert sorted(said) == sorted([COMPILING, unkept])


@pytest.fixture(scope="module")
def functions():
    def make():
        import numba

        number = numba.types.CPointer(numba.float64)
        return {
            "quotient": numba.njit("int64(int64, int64)")(lambda a, b: a // b),
            "half": numba.njit("float64(float64)")(lambda a: a / 2),
            "put": numba.njit(numba.void(number, numba.int64, numba.float64))(_put),
        }

    return native.load("test", b"quotient, half, put: 1", make)


def _put(numbers, place, value):
    numbers[place] = value


def test_numbers_go_in_and_out(functions):
    assert functions["quotient"](-7, 2) == -4
    assert functions["half"](-3) == -1.5
    assert functions["quotient"](-(1 << 63), 1) == -(1 << 63)


def test_a_pointer_is_an_address(functions):
    numbers = np.zeros(3)
    assert functions["put"](numbers.ctypes.data, 1, 2.5) is None
    assert numbers.tolist() == [0, 2.5, 0]


def test_mistakes_are_exceptions(functions):
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        functions["quotient"](1, 0)
    with pytest.raises(TypeError, match="quotient takes 2 numbers"):
        functions["quotient"](1)
    with pytest.raises(TypeError, match="str"):
        functions["quotient"]("1", 2)
    with pytest.raises(OverflowError):
        functions["quotient"](1 << 64, 2)


@pytest.mark.medium
def test_what_allocates_is_refused():
    def make():
        import numba

        return {"made": numba.njit("float64(int64)")(lambda n: np.arange(n).astype(np.float64)[-1] + n)}

    with pytest.raises(RuntimeError, match=r"it needs NRT_.* of numba"):
        native.load("allocates", b"np.arange", make)


LATER = """
import sys
from bubbleskin.contact import energy, relax
import bubbleskin.sim.kernel
before = "numba" in sys.modules
import numpy as np
out = np.zeros(1)
from bubbleskin import CompliantContact, Layout
model = CompliantContact(Layout.hexagon(rings=1))
relax.hold(np.array([5e-3]), model.bubbles, out)
print(before, "numba" in sys.modules, out[0] > 1e4)
"""


@pytest.mark.slow
def test_numba_comes_when_something_is_called(tmp_path):
    assert run(tmp_path, LATER)[0] == ["False", "True", "True"]


OPENED = """
import sys
import bubbleskin as bs
skin = bs.connect("sim://wristband7")
skin.show([6.0] * 7, wait=False)
skin.sleep(0.1)
print(*[name for name in ("numba", "scipy", "matplotlib") if name in sys.modules])
"""


@pytest.mark.slow
def test_a_board_is_opened_without_numba_and_scipy():
    done = subprocess.run([sys.executable, "-c", OPENED], capture_output=True, text=True, check=True)
    if done.stderr:  # it has compiled, because no test before has
        done = subprocess.run([sys.executable, "-c", OPENED], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("\n", "")
