"""The link over a pseudo-terminal to the firmware in MicroPython, side by side with a plain echo over the same one."""

import select
import subprocess
import sys
import time
from statistics import median

import numpy as np
import serial

from bubbleskin.bench.rows import Row
from bubbleskin.boards import DEFAULT
from bubbleskin.connect import connect
from bubbleskin.link import message
from bubbleskin.link.link import run_sync
from bubbleskin.toolchain.interpreter import find_micropython

_ROUNDS = 10
_EACH = 200
"""Requests in a round."""


def far_end() -> None:
    """The other end of the pseudo-terminal: prints its name, then is what each line on stdin says, and says when it is."""
    from bubbleskin.sim import open_board
    from bubbleskin.sim.serve import PtyEnd, serve

    end = PtyEnd()
    _, board = open_board("micropython", DEFAULT, {})
    for _ in range(10):
        board.tick()  # the plant's first steps load what numba has compiled
    print(end.name, flush=True)
    try:
        with _interpreter_that_echoes() as interpreter:
            for mode in sys.stdin:
                end.wait(0)
                print("ready", flush=True)
                if mode == "echo\n":
                    while not _told():
                        end.write(end.wait(0.02))
                elif mode == "relay\n":
                    while not _told():
                        end.write(_through(interpreter, end.wait(0.02)))
                else:
                    for _ in serve(board, end, lambda: not _told()):
                        pass
            assert interpreter.stdin
            interpreter.stdin.close()
    finally:
        board.close()


def _told() -> bool:
    return bool(select.select([sys.stdin], [], [], 0)[0])


_BLOCK = 2 + 256
_ECHO = f"""
import sys
take, give = sys.stdin.buffer, sys.stdout.buffer
block = bytearray({_BLOCK})
while take.readinto(block) == len(block):
    give.write(block)
"""


def _interpreter_that_echoes() -> subprocess.Popen[bytes]:
    """MicroPython, which gives back blocks of the size that the firmware takes, without a look at them."""
    command = [str(find_micropython()), "-c", _ECHO]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)


def _through(interpreter: subprocess.Popen[bytes], data: bytes) -> bytes:
    if not data:
        return b""
    assert interpreter.stdin
    assert interpreter.stdout
    interpreter.stdin.write((len(data).to_bytes(2, "little") + data).ljust(_BLOCK, b"\0"))
    block = b""
    while len(block) < _BLOCK:
        block += interpreter.stdout.read(_BLOCK - len(block))
    return block[2 : 2 + int.from_bytes(block[:2], "little")]


def rows() -> list[Row]:
    """Round trips and rates of acknowledged SHOWs, and of echoes of as many bytes, in turns."""
    program = "from bubbleskin.bench.link import far_end; far_end()"
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as other:
        assert other.stdin
        assert other.stdout
        name = other.stdout.readline().strip()
        echoes: list[float] = []  # the median of each round
        relayed: list[float] = []
        shows: list[float] = []
        pings: list[float] = []
        rates: list[float] = []
        slowest: list[float] = []

        def turn_to(mode: str) -> None:
            assert other.stdin
            assert other.stdout
            other.stdin.write(f"{mode}\n")
            other.stdout.readline()

        for _ in range(_ROUNDS):
            turn_to("echo")
            echoes.append(median(_echo(name)))
            turn_to("relay")
            relayed.append(median(_echo(name)))
            turn_to("board")
            one, two = _board(name)
            shows.append(median(one))
            pings.append(median(two))
            rates.append(len(one) / sum(one))
            slowest.append(float(np.quantile(one, 0.99)) * 1e3)
        other.stdin.close()
    # The best round of each counts: what else the machine does only makes it slower.
    echo, relay, show, ping = (min(medians) * 1e3 for medians in (echoes, relayed, shows, pings))
    return [
        Row("plain echo over the pty, round trip, median of the best round", echo, "ms"),
        Row("plain echo by MicroPython behind the same pty", relay, "ms"),
        Row("PING to the firmware in MicroPython over the same pty", ping, "ms"),
        Row("acknowledged SHOW over the same pty", show, "ms"),
        Row("  in MicroPython's plain echoes", show / relay, "×", "≤ 2"),
        Row("  in plain echoes of the pty alone", show / echo, "×", "≤ 2"),
        Row("acknowledged SHOWs a second, one after another", max(rates), "1/s", "≥ 300"),
        Row("  slowest in a hundred", min(slowest), "ms"),
    ]


def _echo(name: str) -> list[float]:
    frame = message.encode("SHOW", 1, (0,), [(8000,)] * 7)
    times = []
    with serial.Serial(name, timeout=1.0) as port:
        port.reset_input_buffer()
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
            run_sync(link.call("SHOW", (0,), [(8000 + count,)] * 7))
            shows.append(time.perf_counter() - begin)
        for count in range(_EACH // 4):
            begin = time.perf_counter()
            run_sync(link.call("PING", (count,)))
            pings.append(time.perf_counter() - begin)
        skin.vent()
    return shows, pings
