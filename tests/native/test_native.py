"""Native code is kept and found again, by what it is made of; who runs it does not wait for numba."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from bubbleskin import native

ADDED = """
from bubbleskin import native

def make():
    import numba
    return {{"added": numba.njit("int64(int64, int64)")(lambda a, b: a + {0} * b)}}

added = native.load("added", b"a + {0} b", make, **{1})["added"]
import sys
print(added(40, 2), "numba" in sys.modules)
"""


def run(cache, factor: int = 1, code: str = ADDED, **options):
    """What a Python prints that loads a function from, or into, this cache folder: standard output and error."""
    done = subprocess.run(
        [sys.executable, "-c", code.format(factor, options)],
        env={**os.environ, "XDG_CACHE_HOME": str(cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout.strip(), done.stderr


def kept(cache) -> list[str]:
    return sorted(path.name for path in (cache / "bubbleskin" / "native").iterdir())


def test_it_is_compiled_once_and_says_so(tmp_path):
    said, told = run(tmp_path)
    assert said == "42 True"
    assert told == "Compiling the simulation for this computer, once: up to 20 s.\n"
    assert run(tmp_path) == ("42 False", "")
    assert len(kept(tmp_path)) == 1


def test_another_source_is_compiled_anew(tmp_path):
    assert run(tmp_path)[0] == "42 True"
    assert run(tmp_path, factor=2)[0] == "44 True"
    assert run(tmp_path)[0] == "42 False"


def test_half_a_file_is_compiled_anew(tmp_path):
    run(tmp_path)
    (path,) = (tmp_path / "bubbleskin" / "native").iterdir()
    path.write_bytes(path.read_bytes()[:-100])
    assert run(tmp_path)[0] == "42 True"
    assert run(tmp_path)[0] == "42 False"


def test_two_processes_may_compile_at_once(tmp_path):
    with ThreadPoolExecutor() as pool:
        both = list(pool.map(run, [tmp_path] * 2))
    assert {said.split()[0] for said, _ in both} == {"42"}
    assert len(kept(tmp_path)) == 1
    assert run(tmp_path) == ("42 False", "")


def test_where_nothing_can_be_kept_every_start_compiles_and_says_so(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    for _ in range(2):
        said, told = run(file)
        assert said == "42 True"
        assert (
            f"Native code cannot be kept in {file / 'bubbleskin' / 'native'}, so every start compiles: Not a dir"
            in told
        )
    assert "NotADirectoryError" in run(file, unkept=False)[1]


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
    import numpy as np

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


def test_what_allocates_is_refused():
    def make():
        import numba
        import numpy as np

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


def test_numba_comes_when_something_is_called(tmp_path):
    assert run(tmp_path, code=LATER)[0] == "False True True"


OPENED = """
import sys
import bubbleskin as bs
skin = bs.connect("sim://wristband7")
skin.show([6.0] * 7, wait=False)
skin.sleep(0.1)
print(*[name for name in ("numba", "scipy", "matplotlib") if name in sys.modules])
"""


def test_a_board_is_opened_without_numba_and_scipy():
    done = subprocess.run([sys.executable, "-c", OPENED], capture_output=True, text=True, check=True)
    if done.stderr:  # it has compiled, because no test before has
        done = subprocess.run([sys.executable, "-c", OPENED], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("\n", "")
