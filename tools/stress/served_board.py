"""Do to a served board what programs should not, and see that it serves the next honest one and keeps its memory.

    python tools/stress/served_board.py                # 200 MB of flood, 50 idle programs, 100 that come and go
    python tools/stress/served_board.py --share 0.05   # less of each

After each attack an honest program connects and asks: the seconds until it has its answer are printed, and the memory of
the server above what it had before (Linux tells it). Ends with status 1 where one is not served within a second, or where
memory has grown by more than 5 MB.
"""

import argparse
import json
import random
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import bubbleskin as bs

SERVED_S = 1.0
GROWN_MB = 5.0
FLOOD_MB = 200
IDLE = 50
RECONNECTS = 100


@dataclass
class Outcome:
    """What one attack did: `served_s` until the next honest program had its answer, `grown_mb` of memory since the start."""

    attack: str
    served_s: float
    grown_mb: float


@contextmanager
def server() -> Iterator[tuple[str, int]]:
    """A board served by a process of its own: its URL, and the process's number."""
    command = [sys.executable, "-m", "bubbleskin", "sim", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout
            yield json.loads(process.stdout.readline())["device"], process.pid
        finally:
            process.terminate()


def memory_mb(pid: int) -> float:
    """What a process has in memory; 0 where the system does not tell."""
    status = Path(f"/proc/{pid}/status")
    found = re.search(r"VmRSS:\s*(\d+) kB", status.read_text()) if status.is_file() else None
    return int(found[1]) / 1024 if found else 0.0


def plain(url: str) -> socket.socket:
    """A connection to the server that knows nothing of the protocol."""
    host, port = url.removeprefix("socket://").split(":")
    return socket.create_connection((host, int(port)), timeout=30.0)


def ask(url: str) -> None:
    """What an honest program does: connect, ask, leave."""
    with bs.connect(url, timeout=5.0) as skin:
        skin.state()


def junk(url: str, share: float) -> None:
    """Random bytes, and a connection cut off while it sends."""
    rng = random.Random(1)
    with plain(url) as client:
        for _ in range(round(1000 * share)):
            client.sendall(rng.randbytes(rng.randrange(1, 2000)))


def flood(url: str, share: float) -> None:
    """Frames that are none, as fast as they are taken."""
    block = b"\x05\x04\1\1\1\0" * 10_000
    with plain(url) as client:
        for _ in range(round(FLOOD_MB * share * 1e6 / len(block))):
            client.sendall(block)


def reconnect(url: str, share: float) -> None:
    """Come and go, every other time with half a frame."""
    for turn in range(round(RECONNECTS * share)):
        with plain(url) as client:
            if turn % 2:
                client.sendall(b"\x07half")


def attack(share: float) -> list[Outcome]:
    """All attacks in turn, `share` of each in full."""
    outcomes = []

    with server() as (url, pid), ExitStack() as idle:

        def measure(name: str, act: Callable[[], object]) -> None:
            act()
            begin = time.monotonic()
            ask(url)
            outcomes.append(Outcome(name, time.monotonic() - begin, memory_mb(pid) - before))

        before = 0.0
        for _ in range(3):
            ask(url)
        junk(url, 0.01)  # the buffers that it keeps once it has read as much as it takes at once
        ask(url)
        before = memory_mb(pid)
        measure("nothing", lambda: None)
        measure("junk", lambda: junk(url, share))
        measure("flood", lambda: flood(url, share))
        measure("idle", lambda: [idle.enter_context(plain(url)) for _ in range(round(IDLE * share))])
        measure("reconnects", lambda: reconnect(url, share))
        measure("honest reconnects", lambda: [ask(url) for _ in range(round(RECONNECTS * share))])
    return outcomes


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--share", type=float, default=1.0, help="of the full attacks")
    share = parser.parse_args().share
    outcomes = attack(share)
    for outcome in outcomes:
        print(f"{outcome.attack:20} served after {outcome.served_s:.3f} s, {outcome.grown_mb:+.1f} MB")
    good = all(outcome.served_s <= SERVED_S and outcome.grown_mb <= GROWN_MB for outcome in outcomes)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
