"""The link over a pseudo-terminal to the firmware in MicroPython, side by side with a plain echo over the same one."""

import select
import subprocess
import sys
import time
from statistics import median

import numpy as np
import serial

from bubbleskin.bench.rows import Row
from bubbleskin.connect import connect
from bubbleskin.link import wire
from bubbleskin.link.session import drive

_ROUNDS = 5
_EACH = 400
"""Requests in a round."""


def far_end() -> None:
    """The other end of the pseudo-terminal: prints its name, then is what each line on stdin says, echo or board."""
    from bubbleskin.sim import open_board
    from bubbleskin.sim.serve import PtyEnd, serve

    end = PtyEnd()
    _, board = open_board("micropython", "wristband7", {})
    print(end.name, flush=True)
    try:
        for mode in sys.stdin:
            if mode == "echo\n":
                while not _told():
                    end.write(end.wait(0.02))
            else:
                for _ in serve(board, end, lambda: not _told()):
                    pass
    finally:
        board.close()


def _told() -> bool:
    return bool(select.select([sys.stdin], [], [], 0)[0])


def rows() -> list[Row]:
    """Round trips and rates of acknowledged SHOWs, and of echoes of as many bytes, in turns."""
    program = "from bubbleskin.bench.link import far_end; far_end()"
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as other:
        assert other.stdin
        assert other.stdout
        name = other.stdout.readline().strip()
        echoes: list[float] = []
        shows: list[float] = []
        pings: list[float] = []
        for _ in range(_ROUNDS):
            other.stdin.write("echo\n")
            echoes += _echo(name)
            other.stdin.write("board\n")
            one, two = _board(name)
            shows += one
            pings += two
        other.stdin.close()
    echo, show, ping = (median(times) * 1e3 for times in (echoes, shows, pings))
    rate, floor = len(shows) / sum(shows), len(echoes) / sum(echoes)
    return [
        Row("echo over the pty, round trip, median", echo, "ms"),
        Row("PING to MicroPython over the same pty", ping, "ms"),
        Row("acknowledged SHOW over the same pty", show, "ms"),
        Row("  in round trips of the echo", show / echo, "×", "≤ 2"),
        Row("echoes a second", floor, "1/s"),
        Row("acknowledged SHOWs a second", rate, "1/s", "≥ 300"),
        Row("  slowest in a hundred", float(np.quantile(shows, 0.99)) * 1e3, "ms"),
    ]


def _echo(name: str) -> list[float]:
    frame = wire.encode("SHOW", 1, (0,), [(8000,)] * 7)
    times = []
    with serial.Serial(name, timeout=1.0) as port:
        for _ in range(_EACH):
            begin = time.perf_counter()
            port.write(frame)
            port.read(len(frame))
            times.append(time.perf_counter() - begin)
    return times


def _board(name: str) -> tuple[list[float], list[float]]:
    shows, pings = [], []
    with connect(name) as skin:
        link = skin._skin._link
        for count in range(_EACH):
            begin = time.perf_counter()
            drive(link.call("SHOW", (0,), [(8000 + count,)] * 7))
            shows.append(time.perf_counter() - begin)
        for count in range(_EACH // 4):
            begin = time.perf_counter()
            drive(link.call("PING", (count,)))
            pings.append(time.perf_counter() - begin)
        skin.vent()
    return shows, pings
