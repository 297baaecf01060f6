"""A copy of all sources in which mistakes are planted, one at a time, and the tests that look for them.

The sources stay as they are. Tests run from where they are, those that are nearest to the planted file first.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import platformdirs

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("protocol", "firmware", "host_sdk")
HIL = ("hil_tests", "--target", "sim://wristband7?contact=0")
EVERYDAY = "not slow and not chip"
LONGEST_S = 600
_KEPT = platformdirs.user_cache_path("bubbleskin")
# A loop without end in compiled code hears no signal: faulthandler's own thread, in C, ends the process.
QUICK = (
    "-x", "-q", "-p", "no:cacheprovider", "--timeout", "100",
    "-o", "faulthandler_timeout=90", "-o", "faulthandler_exit_on_timeout=true",
)  # fmt: skip

_FIRMWARE = ("tests/firmware", "tests/protocol", "tests/store", "tests/promises")
_CONTROL = (
    "tests/firmware/test_golden_traces.py",
    "tests/firmware/test_identity.py",
    "tests/firmware/test_reference.py",
)
_SAFETY = tuple(f"tests/firmware/test_{name}.py" for name in ("golden_traces", "guards", "safety", "states", "supply"))
_LINK = tuple(f"tests/firmware/test_{name}.py" for name in ("delivery", "requests", "states"))
_WIRE = tuple(
    f"tests/sdk/test_{name}.py" for name in ("wire", "link", "exactly_once", "overtaking", "keepalive", "clock")
)
_OVER_IT = (
    "tests/sim/test_serve.py",
    *(
        f"tests/sdk/test_{name}.py"
        for name in (
            *("asyncio", "connect", "host_frames", "host_killed", "logging", "play", "processes", "reconnect"),
            *("refusals", "show", "telemetry", "threads", "uploads", "wristband19"),
        )
    ),
)
# The tests that look at a file, by the beginning of its path: the nearest, then all that can be meant.
NEAREST: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...] = (
    ("firmware/bubble_firmware/control", (_CONTROL, _FIRMWARE)),
    ("firmware/bubble_firmware/safety", (_SAFETY, _FIRMWARE)),
    ("firmware/bubble_firmware/link", (_LINK, _FIRMWARE)),
    ("firmware/bubble_firmware/store", (("tests/store",), _FIRMWARE)),
    ("firmware", (_SAFETY, _FIRMWARE)),
    ("protocol", (("tests/protocol",), _LINK, _FIRMWARE, _WIRE)),
    ("host_sdk/bubbleskin/calibrate", (("tests/calibrate",),)),
    ("host_sdk", (_WIRE, _OVER_IT)),
)


def suites(file: str) -> tuple[tuple[str, ...], ...]:
    """The tests of this file's part, in the order in which they run."""
    return next(suites for start, suites in NEAREST if file.startswith(start))


class Workshop:
    """The copy. `run` runs tests on it as it stands."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._planted = 0
        for source in SOURCES:
            shutil.copytree(ROOT / source, folder / source, ignore=shutil.ignore_patterns("__pycache__"))
        self._environment = {
            **os.environ,
            "BUBBLESKIN_EXAMPLES": "20",
            "PYTHONPATH": os.pathsep.join(str(folder / source) for source in SOURCES),
            "PYTHONPYCACHEPREFIX": str(folder / "pyc"),
            "XDG_CACHE_HOME": str(_borrowed_cache(folder / "cache")),
            "BUBBLESKIN_CACHE": os.environ.get("BUBBLESKIN_CACHE") or str(_KEPT),  # what is built may be shared
        }
        self._environment.pop("PYTHONDONTWRITEBYTECODE", None)

    @contextmanager
    def planted(self, file: str, text: str) -> Iterator[None]:
        """Within, `file` has this text."""
        path = self._folder / file
        before = path.read_text(encoding="utf-8")
        self._write(path, text)
        try:
            yield
        finally:
            self._write(path, before)

    def _write(self, path: Path, text: str) -> None:
        path.write_text(text, encoding="utf-8")
        # Python takes what it has compiled for today's where size and second are the same: no second comes twice.
        self._planted += 1
        os.utime(path, (self._planted, self._planted))

    def check(self, files: Iterable[str], *others: tuple[str, ...]) -> None:
        """Without a mistake nothing may fail of the tests of these files and of `others`, or all that is planted is found."""
        for suite in {*others, *(suite for file in files for suite in suites(file))}:
            if failed := self.run(suite):
                sys.exit(f"{failed} fails without any mistake; it has to pass before any is planted.")

    def found_by(self, file: str) -> str:
        """The first test that fails of those of this file's part; empty where none does."""
        for suite in suites(file):
            if found := self.run(suite):
                return found
        return ""

    def run(self, tests: tuple[str, ...], marks: str = EVERYDAY) -> str:
        """The first of these tests that fails; empty where none does."""
        command = [sys.executable, "-m", "pytest", *QUICK, *(("-m", marks) if marks else ()), *tests]
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            said, _ = process.communicate(timeout=LONGEST_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # with what the tests had started
            process.communicate()
            return f"{tests[0]}: hangs"
        if process.returncode in (0, 5):  # 5: none of these has this mark
            return ""
        for line in said.splitlines():
            if line.startswith(("FAILED", "ERROR")):
                return line.split(" - ")[0].split(" ", 1)[1].replace(HIL[-1], "sim")
        return f"{tests[0]}: hangs or breaks off, status {process.returncode}"


def _borrowed_cache(cache: Path) -> Path:
    """Links to the native code that is kept: what is compiled of a mistake stays here, and goes with it."""
    native = cache / "bubbleskin" / "native"
    native.mkdir(parents=True)
    for kept in (_KEPT / "native").glob("*.o"):
        (native / kept.name).symlink_to(kept)
    return cache


@contextmanager
def workshop() -> Iterator[Workshop]:
    """A copy of the sources as they are, for as long as it is needed."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        yield Workshop(Path(folder))
