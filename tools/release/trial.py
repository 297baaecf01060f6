"""Try a wheel where nothing is: in an empty environment, with no compiler in reach, the demo runs.

python tools/release/trial.py dist/bubbleskin-0.1.0/bubbleskin-0.1.0-py3-none-any.whl
python tools/release/trial.py WHEEL --python python3.12 --python python3.13

Packages come from wherever pip has them from, in the versions of constraints.txt.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
KEPT = ("LANG", "TERM", "SSL_CERT_FILE", "REQUESTS_CA_BUNDLE")
"""Of this environment, besides what tells pip where packages are."""
ASK = """
import importlib.util, platform, shutil, crcmod.predefined
assert not any(map(shutil.which, ("cc", "gcc", "clang", "c++"))), "a compiler is in reach"
compiled = importlib.util.find_spec("crcmod._crcfunext") is not None
print(platform.python_version(), compiled, crcmod.predefined.mkPredefinedCrcFun("crc-32")(b"123456789"))
"""


class Tried(NamedTuple):
    """What came of it."""

    python: str
    compiled: bool
    """Whether crcmod is in C: it is not where there was no compiler."""
    crc: int
    said: str
    """What the demo printed."""
    seconds: tuple[float, float]
    """Installing; the first demo, which compiles the physics."""


def trial(wheel: Path, python: str, home: Path) -> Tried:
    """Install `wheel` for `python` below `home`, and run the demo; RuntimeError with what was said where a step fails."""
    binaries = home / "venv/bin"

    def run(*command: str) -> str:
        kept = {name: text for name, text in os.environ.items() if name in KEPT or name.startswith("PIP_")}
        alone = kept | {"PATH": str(binaries), "HOME": str(home), "PYTHONNOUSERSITE": "1"}
        done = subprocess.run(command, cwd=home, env=alone, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
        return done.stdout

    run(python, "-m", "venv", str(home / "venv"))
    began = time.monotonic()
    constraint = ("--constraint", str(ROOT / "constraints.txt"))
    run(str(binaries / "python"), "-m", "pip", "install", "--quiet", "--no-compile", *constraint, str(wheel.resolve()))
    installed = time.monotonic()
    said = run(str(binaries / "bubbleskin"), "demo", "--output", "demo.png")
    shown = time.monotonic()
    if not (home / "demo.png").read_bytes().startswith(b"\x89PNG"):
        raise RuntimeError("The demo has saved no picture.")
    version, compiled, crc = run(str(binaries / "python"), "-c", ASK).split()
    return Tried(version, compiled == "True", int(crc), said, (installed - began, shown - installed))


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description="Try a wheel in an empty environment, with no compiler in reach.")
    parser.add_argument("wheels", type=Path, nargs="+", metavar="WHEEL")
    parser.add_argument("--python", action="append", metavar="PROGRAM", help="repeat for several (default: this one)")
    asked = parser.parse_args()
    for wheel in asked.wheels:
        if not wheel.is_file():
            sys.exit(f"There is no {wheel}; make release makes one.")
        for python in asked.python or [sys.executable]:
            print(said(wheel, python))


def said(wheel: Path, python: str) -> str:
    """A line on what came of it; the program ends where it failed."""
    with tempfile.TemporaryDirectory() as home:
        try:
            tried = trial(wheel, python, Path(home))
        except (RuntimeError, OSError) as error:
            sys.exit(f"{python}: {error}")
    crc = "in C" if tried.compiled else "in Python"
    return f"{tried.python}: installed in {tried.seconds[0]:.0f} s, demo in {tried.seconds[1]:.0f} s, crcmod {crc}"


if __name__ == "__main__":
    main()
