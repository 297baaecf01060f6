"""Connect and close over and over, and read many states: say what is left of it in this process and beside it.

    python tools/stress/leaks.py                             # 500 connections each to three targets; 100,000 states of two
    python tools/stress/leaks.py --cycles 20 --states 1000   # fewer
    python tools/stress/leaks.py --chip 3                    # and so many to rp2040://, half a minute each

After some to warm up: descriptors, threads, child processes, temporary files, Python's objects, and memory, before and after.
Ends with status 1 where anything but memory differs, where objects have grown by more than one for five connections, or memory
by more than 2 kB for each (10 bytes for each state) beyond the 2 MB by which it swings by itself. An emulated chip is 20 MB of
objects: that is its swing.
"""

import argparse
import contextlib
import gc
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

import bubbleskin as bs

SWING_KB = 2048
CHIP_KB = 20_000


@dataclass
class Held:
    """What this process holds."""

    descriptors: int
    threads: int
    children: int
    files: int
    objects: int
    memory_kb: int

    @classmethod
    def now(cls, folder: Path) -> "Held":
        """All of it now; `folder`: where temporary files are made."""
        for _ in range(3):
            gc.collect()
        children = sum(len((task / "children").read_text().split()) for task in Path("/proc/self/task").iterdir())
        status = Path("/proc/self/status").read_text()
        found = re.search(r"VmRSS:\s*(\d+) kB", status)
        return cls(
            descriptors=len(list(Path("/proc/self/fd").iterdir())),
            threads=threading.active_count(),
            children=children,
            files=len(list(folder.rglob("*"))),
            objects=len(gc.get_objects()),
            memory_kb=int(found[1]) if found else 0,
        )

    def left(self, before: "Held", times: int, memory_each_kb: float, objects_each: float, swing_kb: int) -> list[str]:
        """What is more than it was `before` so many times of something."""
        complaints = [
            f"{name}: {getattr(before, name)}, then {getattr(self, name)}"
            for name in ("descriptors", "threads", "children", "files")
            if getattr(before, name) != getattr(self, name)
        ]
        if self.objects - before.objects > objects_each * times + 100:
            complaints.append(f"{self.objects - before.objects} objects more")
        if self.memory_kb - before.memory_kb > memory_each_kb * times + swing_kb:
            complaints.append(f"{self.memory_kb - before.memory_kb} kB more")
        return complaints


@contextmanager
def served() -> Iterator[str]:
    """A board served by a process of its own: its URL."""
    command = [sys.executable, "-m", "bubbleskin", "sim", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout
            yield json.loads(process.stdout.readline())["device"]
        finally:
            process.terminate()


def cycle(url: str) -> None:
    """One program: connect, show, ask, vent, close."""
    with bs.connect(url, timeout=10.0) as skin:
        skin.show([8.0] * skin.info.bubbles, wait=False)
        skin.state()
        skin.vent()


def measure(
    name: str,
    times: int,
    act: Callable[[], object],
    warm_up: int,
    limits: tuple[float, float],
    swing_kb: int = SWING_KB,
) -> bool:
    """Do it so many times; say what is left. Whether that is nothing."""
    folder = Path(tempfile.gettempdir())
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        for _ in range(warm_up):
            act()
        before, begin = Held.now(folder), time.monotonic()
        for _ in bar.track(range(times), description=name):
            act()
    after = Held.now(folder)
    complaints = after.left(before, times, *limits, swing_kb)
    same = (
        f"{after.descriptors} descriptors, {after.threads} threads, {after.children} children and {after.files} files as before, "
        f"objects {after.objects - before.objects:+}, memory {after.memory_kb - before.memory_kb:+} kB"
    )
    seconds = time.monotonic() - begin
    print(f"{name:26} {times:6} times in {seconds:4.0f} s: {'; '.join(complaints) or same}", flush=True)
    return not complaints


def leaks(cycles: int, states: int, chip: int) -> bool:
    """All of it; whether nothing is left."""
    each = (2.0, 0.2)
    good = measure("sim://", cycles, lambda: cycle("sim://wristband7?contact=0"), cycles // 2, each)
    with served() as url:
        good &= measure("socket://", cycles, lambda: cycle(url), cycles // 5, each)
    good &= measure("micropython://", cycles, lambda: cycle("micropython://wristband7?contact=0"), cycles // 5, each)
    if chip:
        good &= measure("rp2040://", chip, lambda: cycle("rp2040://wristband7?contact=0"), 1, (0.0, 0.2), CHIP_KB)
    for url in ("sim://wristband7?contact=0", "micropython://wristband7?contact=0"):
        with bs.connect(url) as skin:
            good &= measure(f"states of {url.split(':')[0]}://", states, skin.state, 500, (0.01, 0.0))
    return good


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=500)
    parser.add_argument("--states", type=int, default=100_000)
    parser.add_argument("--chip", type=int, default=0, help="cycles of rp2040://")
    options = parser.parse_args()
    warnings.simplefilter("always", ResourceWarning)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["TMPDIR"] = tempfile.tempdir = folder
        with contextlib.suppress(KeyboardInterrupt):
            return 0 if leaks(options.cycles, options.states, options.chip) else 1
    return 130


if __name__ == "__main__":
    sys.exit(main())
