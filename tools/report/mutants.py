"""Plant the mistakes of tests/mutants/mutants.toml in the firmware, one at a time, and say what finds them.

python tools/report/mutants.py                  # hil_tests on sim://wristband7, then the tests of firmware and protocol
python tools/report/mutants.py --only deadman   # those whose names have this word

The sources stay as they are: each mistake stands in a copy. A mutant is found by whatever fails first.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parents[2]
LIST = ROOT / "tests" / "mutants" / "mutants.toml"
SOURCES = ("protocol", "firmware")
SUITES = {
    "hil_tests": ["hil_tests", "--target", "sim://wristband7?contact=0"],
    "tests": ["tests/firmware", "tests/protocol", "tests/promises", "tests/store"],
}
ENVIRONMENT = {"BUBBLESKIN_EXAMPLES": "20", "PYTHONDONTWRITEBYTECODE": "1"}
QUICK = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not slow and not chip"]
LONGEST_S = 900


class Mutant(NamedTuple):
    """One mistake. `outside`: why no host can see it; empty where one can."""

    name: str
    file: str
    old: str
    new: str
    outside: str = ""


def mutants() -> list[Mutant]:
    """The list, each checked to be one place in its file."""
    found = [Mutant(**entry) for entry in tomllib.loads(LIST.read_text(encoding="utf-8"))["mutant"]]
    for mutant in found:
        places = (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.old)
        if places != 1:
            sys.exit(
                f"{mutant.name}: what it replaces stands {places} times in {mutant.file}; it has to stand there once."
            )
    return found


def found_by(mutant: Mutant) -> tuple[str, str]:
    """Which suite finds it, and which test first; both empty where none does."""
    with tempfile.TemporaryDirectory() as folder:
        for source in SOURCES:
            shutil.copytree(ROOT / source, Path(folder) / source, ignore=shutil.ignore_patterns("__pycache__"))
        planted = Path(folder) / mutant.file
        planted.write_text(planted.read_text(encoding="utf-8").replace(mutant.old, mutant.new), encoding="utf-8")
        paths = [str(Path(folder) / source) for source in SOURCES] + [str(ROOT / "host_sdk")]
        environment = {**os.environ, **ENVIRONMENT, "PYTHONPATH": os.pathsep.join(paths)}
        for suite, arguments in SUITES.items():
            command = [sys.executable, "-m", "pytest", *QUICK, *arguments]
            try:
                done = subprocess.run(
                    command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LONGEST_S, check=False
                )
            except subprocess.TimeoutExpired:
                return suite, "it hangs"
            if done.returncode:
                failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
                return suite, failed[0].split(" - ")[0] if failed else done.stdout[-200:]
    return "", ""


def main() -> int:
    """Plant, run, tell."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", metavar="WORD", help="mutants whose names have this word")
    wanted = [mutant for mutant in mutants() if parser.parse_args().only in mutant.name]
    table = Table("mutant", "found by", "first test that fails, or why none of hil_tests can")
    console = Console(width=200)
    counts = {"hil_tests": 0, "tests": 0, "": 0}
    for mutant in wanted:
        suite, test = found_by(mutant)
        counts[suite] += 1
        print(f"{mutant.name}: {suite or 'NOT FOUND'} {test}", flush=True)
        table.add_row(
            mutant.name, suite or "nothing", test if suite == "hil_tests" else f"{mutant.outside or '–'} {test}"
        )
    console.print(table)
    visible = sum(not mutant.outside for mutant in wanted)
    console.print(
        f"{len(wanted)} mutants, {visible} of them to be seen from outside: {counts['hil_tests']} found by hil_tests, "
        f"{counts['tests']} more by the tests of firmware, protocol, promises and store, {counts['']} by nothing."
    )
    return 1 if counts[""] else 0


if __name__ == "__main__":
    sys.exit(main())
