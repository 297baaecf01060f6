"""`docs/benchmarks.md`: every figure with the command that measured it, the machine, and how far repeats are apart."""

import os
import platform
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import NamedTuple

from bubbleskin import files
from bubbleskin.bench import BENCHES, measure
from bubbleskin.bench.rows import Row

PAGE = Path("docs/benchmarks.md")
RUNS = 3
"""Of each bench, one after the other."""
LIBRARIES = ("numpy", "scipy", "numba", "pyserial", "pymavlink", "matplotlib")
"""Whose versions count, and the peers."""
_HEAD = """# Benchmarks

Made by `bubbleskin bench --write`, which measures on whatever computer it runs and writes this page. So nothing checks it against
a file, and figures of another computer are other figures: compare ratios, "×", which have both sides measured in the same run.
Each bench ran {runs} times; a figure is the middle one, beside the lowest and the highest. Goals are for a computer that has
nothing else to do.

How well heights are held is in [Control](control.md), of bubbles that touch in [Contact](contact.md), and what a tick costs the
chip in [The chip](chip.md).
"""


class Figure(NamedTuple):
    """A figure of one bench in all runs."""

    name: str
    values: tuple[float, ...]
    unit: str
    target: str


def figures(bench: str, runs: int = RUNS, size: float = 1.0) -> list[Figure]:
    """All figures of one of `BENCHES`, `runs` times; `size` as of `measure`."""
    repeats = [list(measure(bench, size)) for _ in range(runs)]
    return [_together(rows) for rows in zip(*repeats, strict=True)]


def _together(rows: Sequence[Row]) -> Figure:
    first = rows[0]
    return Figure(first.name, tuple(row.value for row in rows), first.unit, first.target)


def machine() -> dict[str, str]:
    """What figures depend on: processor, system, Python, libraries, and what else the computer does."""
    found = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.release().partition('-')[0]}, {platform.machine()}",
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
        "bubbleskin": version("bubbleskin"),
    }
    found |= {name: _version(name) for name in LIBRARIES}
    found["busy"] = f"{os.getloadavg()[0]:.1f} programs at a time, in the minute before"
    return found


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = dict(line.split(":", 1) for line in info.read_text(encoding="utf-8").splitlines() if ":" in line)
        named = {key.strip(): value.strip() for key, value in lines.items()}
        return named.get("model name") or platform.machine()
    asked = ["sysctl", "-n", "machdep.cpu.brand_string"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip() or platform.machine()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # a peer that is not installed is not measured
        return "not installed"


def page(measured: Mapping[str, Iterable[Figure]], where: Mapping[str, str], runs: int = RUNS) -> str:
    """The page: the computer, then a table for each bench."""
    lines = [_HEAD.format(runs=runs), "## Where", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {what} |" for name, what in where.items()]
    for bench, found in measured.items():
        lines += ["", f"## {BENCHES[bench].capitalize()}", "", f"    bubbleskin bench {bench}", ""]
        lines += ["| what | middle | lowest to highest | unit | goal |", "|---|---|---|---|---|"]
        lines += [_line(figure) for figure in found]
    return "\n".join(lines) + "\n"


def _line(figure: Figure) -> str:
    middle, low, high = (_shown(pick(figure.values)) for pick in (median, min, max))
    spread = f"{low} to {high}" if low != high else low
    name = figure.name.replace("  ", "… ", 1) if figure.name.startswith("  ") else figure.name
    return f"| {name} | {middle} | {spread} | {figure.unit} | {figure.target} |"


def _shown(value: float) -> str:
    return "never" if value == float("inf") else f"{value:.3g}"


def write(root: Path, benches: Sequence[str], each: Callable[[str], None], size: float = 1.0) -> list[Row]:
    """Measure `benches`, telling `each` by its name, and write the page of the repository at `root`; the middle figures."""
    where = machine()
    measured = {}
    for bench in benches:
        each(bench)
        measured[bench] = figures(bench, RUNS, size)
    files.write_text(root / PAGE, page(measured, where), "the page of benchmarks")
    return [Row(one.name, median(one.values), one.unit, one.target) for found in measured.values() for one in found]
