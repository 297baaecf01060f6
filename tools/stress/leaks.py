"""Connect and close over and over, and read many states: say what is left of it in this process and beside it.

    python tools/stress/leaks.py                             # 500 connections each to three targets; 100,000 states of two
    python tools/stress/leaks.py micropython --cycles 20     # one part, fewer
    python tools/stress/leaks.py chip boots                  # 500 connections to one emulated chip that runs on, 12 to a chip
                                                             # that boots for each: fifteen minutes

Each part does some to warm up, says how many, and counts from there: descriptors, threads, child processes, temporary files,
Python's objects, and memory, of this process and of MicroPython's; what the allocator holds without need is given back first.
Ends with status 1 where anything but memory differs, where objects have grown by more than one for five connections, or memory
by more than 0.1 kB for each (10 bytes for each state) beyond the half MB by which it swings by itself. Whole chips are 20 MB of
objects: that is their swing.
"""

import argparse
import contextlib
import ctypes
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
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim.rp2040 import open_chip
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import Skin

BOARD = "wristband7?contact=0"
CONNECTIONS, STATES = (0.1, 0.2), (0.01, 0.0)
"""What one may leave: kB, objects."""
SWING_KB = 512
CHIP_KB = 20_000
CHIPS = (0.5, 10.0)
"""What a whole chip may leave: the emulator makes a logger for each, and `logging` forgets none."""


def resident_kb(process: str) -> int:
    """What a process occupies, 0 where it has gone."""
    try:
        found = re.search(r"VmRSS:\s*(\d+) kB", Path(f"/proc/{process}/status").read_text())
    except FileNotFoundError:
        return 0
    return int(found[1]) if found else 0


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
        objects = len(gc.get_objects())
        tasks = Path("/proc/self/task").iterdir()
        children = [child for task in tasks for child in (task / "children").read_text().split()]
        with contextlib.suppress(AttributeError):  # not every libc has it
            ctypes.CDLL(None).malloc_trim(0)
        return cls(
            descriptors=len(list(Path("/proc/self/fd").iterdir())),
            threads=threading.active_count(),
            children=len(children),
            files=len(list(folder.rglob("*"))),
            objects=objects,
            memory_kb=sum(map(resident_kb, ["self", *children])),
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


def use(skin: Skin) -> None:
    """What a short program asks of a wristband."""
    with skin:
        skin.show([8.0] * skin.info.bubbles, wait=False)
        skin.state()
        skin.vent()


def cycle(url: str) -> None:
    """One program: connect, show, ask, vent, close."""
    use(bs.connect(url, timeout=10.0))


def measure(
    name: str,
    times: int,
    act: Callable[[], object],
    warm_up: int,
    limits: tuple[float, float],
    swing_kb: int = SWING_KB,
) -> bool:
    """Do it `warm_up` times and then so many times; say what is left of those. Whether that is nothing."""
    folder = Path(tempfile.gettempdir())
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        for _ in bar.track(range(warm_up), description=f"{name}, to warm up"):
            act()
        Held.now(folder)  # the first look makes things of its own
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
    print(f"{name}: after {warm_up} more {times} in {seconds:.0f} s: {'; '.join(complaints) or same}", flush=True)
    return not complaints


def connections(scheme: str, cycles: int) -> bool:
    """To a board that is simulated anew for each."""
    return measure(f"{scheme}://", cycles, lambda: cycle(f"{scheme}://{BOARD}"), cycles // 2, CONNECTIONS)


def served_connections(cycles: int) -> bool:
    """To a board that another process serves."""
    with served() as url:
        return measure("socket://", cycles, lambda: cycle(url), cycles // 2, CONNECTIONS)


def chip_connections(cycles: int) -> bool:
    """To one emulated chip that runs on; the chip's own heap too."""
    board = open_chip("wristband7", contact=False)

    def connect() -> Skin:
        transport = SimulatedTransport(board, "rp2040://wristband7")
        return Skin(run_sync(AsyncSkin.open(transport, 10.0, simulated=board)))

    def heap_free() -> int:
        """The least of a while, as the collector's turn may be near or far."""
        with connect() as skin:
            return min(skin.health().heap_free for _ in range(20))

    connect().close()
    before = heap_free()
    good = measure("rp2040://, one chip", cycles, lambda: use(connect()), cycles // 20, CONNECTIONS)
    print(f"rp2040://, one chip: heap free on it {before / 1e3:.1f} kB, then {heap_free() / 1e3:.1f} kB", flush=True)
    return good


def chip_boots(boots: int) -> bool:
    """To an emulated chip that boots for each."""
    return measure("rp2040://, booted", boots, lambda: cycle(f"rp2040://{BOARD}"), 2, CHIPS, CHIP_KB)


def many_states(scheme: str, states: int) -> bool:
    """Of one connection, whose history, which grows up to its limit, is not kept."""
    with bs.connect(f"{scheme}://{BOARD}&history=0") as skin:
        return measure(f"states of {scheme}://", states, skin.state, states // 100, STATES)


PARTS: dict[str, Callable[[argparse.Namespace], bool]] = {
    "sim": lambda options: connections("sim", options.cycles),
    "socket": lambda options: served_connections(options.cycles),
    "micropython": lambda options: connections("micropython", options.cycles),
    "states": lambda options: many_states("sim", options.states) & many_states("micropython", options.states),
    "chip": lambda options: chip_connections(options.cycles),
    "boots": lambda options: chip_boots(options.boots),
}
EVERY_TIME = [part for part in PARTS if part not in ("chip", "boots")]


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; without any: {', '.join(EVERY_TIME)}"
    )
    parser.add_argument("--cycles", type=int, default=500)
    parser.add_argument("--states", type=int, default=100_000)
    parser.add_argument("--boots", type=int, default=12, help="connections to a chip that boots, half a minute each")
    options = parser.parse_args()
    unknown = sorted(set(options.parts) - set(PARTS))
    if unknown:
        parser.error(f"{', '.join(unknown)} is no part; parts are {', '.join(PARTS)}.")
    warnings.simplefilter("always", ResourceWarning)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["TMPDIR"] = tempfile.tempdir = folder
        with contextlib.suppress(KeyboardInterrupt):
            results = [PARTS[part](options) for part in options.parts or EVERY_TIME]
            return 0 if all(results) else 1
    return 130


if __name__ == "__main__":
    sys.exit(main())
