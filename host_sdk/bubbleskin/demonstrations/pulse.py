"""The pulse: what a notification feels like. The inner bubbles rise together, then the framing ring one after the other."""

import threading
from collections.abc import Iterable, Iterator
from queue import SimpleQueue

from bubbleskin import checks
from bubbleskin.layout import Layout
from bubbleskin.sequence import library
from bubbleskin.sequence.model import Sequence
from bubbleskin.skin import Skin

RATE_HZ = 0.25
DEPTH_MM = library.HIGH_MM - library.LOW_MM
LOOPS = 2


def pulse(layout: Layout, *, rate_hz: float = RATE_HZ, depth_mm: float = DEPTH_MM, loops: int = LOOPS) -> Sequence:
    """The paper's pulse, `rate_hz` times a second and `depth_mm` deep, `loops` times.

    The skin oscillates between its inner bubbles and its outermost ring; see `bubbleskin.sequences.pulse` for each time of it.
    """
    depth = checks.above_zero("depth_mm", depth_mm, unit="mm")
    return library.pulse(layout, high_mm=library.LOW_MM + depth, rate_hz=rate_hz, loops=loops)


def pulse_per_line(skin: Skin, lines: Iterable[str], sequence: Sequence) -> Iterator[list[str]]:
    """Play `sequence` whenever a line comes, such as of `sys.stdin`, and vent after it; the lines that it was for, each time.

    Lines that come while it plays are felt together, once, when it has ended: a hundred mails are one more pulse.
    """
    for batch in _batches(lines):
        skin.play(sequence)
        skin.vent()
        yield batch


def _batches(lines: Iterable[str]) -> Iterator[list[str]]:
    """What has come since it was looked last, one line at least; a thread reads what comes meanwhile."""
    come: SimpleQueue[str | None] = SimpleQueue()

    def read() -> None:
        try:
            for line in lines:
                come.put(line.rstrip("\r\n"))
        finally:
            come.put(None)

    threading.Thread(target=read, name="lines", daemon=True).start()
    ended = False
    while not ended:
        batch: list[str] = []
        while not ended and (not batch or not come.empty()):
            line = come.get()
            ended = line is None
            batch += [] if line is None else [line]
        if batch:
            yield batch
