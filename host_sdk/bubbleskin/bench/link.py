"""The link over a pseudo-terminal to the firmware in MicroPython, side by side with a plain echo over the same one."""

import select
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median

import numpy as np
import serial

from bubbleskin.bench.rows import Row, share_of
from bubbleskin.boards import DEFAULT
from bubbleskin.link import message
from bubbleskin.link.link import Link, run_sync
from bubbleskin.link.serial import SerialTransport
from bubbleskin.toolchain.interpreter import find_micropython

_ROUNDS = 10
_REQUESTS = 200
"""In a round."""


def far_end() -> None:
    """The other end of the pseudo-terminal: prints its name, then does what each line on stdin names, and prints "ready".

    "echo" gives bytes back, "relay" has MicroPython give them back, "board" is the firmware in MicroPython.
    """
    from bubbleskin.sim import open_board
    from bubbleskin.sim.serve import PtyEnd, serve

    end = PtyEnd()
    _, board = open_board("micropython", DEFAULT, {})
    for _ in range(10):
        board.tick()  # The plant's first steps load what numba has compiled.
    print(end.name, flush=True)
    try:
        with _interpreter_that_echoes() as interpreter:
            for mode in sys.stdin:
                end.wait(0)
                print("ready", flush=True)
                if mode == "echo\n":
                    while not _has_order():
                        end.write(end.wait(0.02))
                elif mode == "relay\n":
                    while not _has_order():
                        end.write(_through(interpreter, end.wait(0.02)))
                else:
                    for _ in serve(board, end, lambda: not _has_order()):
                        pass
            assert interpreter.stdin
            interpreter.stdin.close()
    finally:
        board.close()


def _has_order() -> bool:
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
    """`data` given back by the interpreter, as one block that begins with its length."""
    if not data:
        return b""
    assert interpreter.stdin
    assert interpreter.stdout
    interpreter.stdin.write((len(data).to_bytes(2, "little") + data).ljust(_BLOCK, b"\0"))
    block = b""
    while len(block) < _BLOCK:
        block += interpreter.stdout.read(_BLOCK - len(block))
    return block[2 : 2 + int.from_bytes(block[:2], "little")]


@contextmanager
def _other_end() -> Iterator[tuple[str, Callable[[str], None]]]:
    """`far_end` in a process of its own: its pseudo-terminal's name, and how to tell it what to be."""
    program = f"from {__name__} import far_end; far_end()"
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as process:
        orders, answers = process.stdin, process.stdout
        assert orders
        assert answers

        def turn_to(mode: str) -> None:
            orders.write(f"{mode}\n")
            answers.readline()

        yield answers.readline().strip(), turn_to
        orders.close()


def rows(size: float = 1.0) -> Iterator[Row]:
    """Round trips and rates of acknowledged SHOWs, and of echoes of as many bytes, in turns."""
    count = share_of(_REQUESTS, size)
    medians: dict[str, list[float]] = defaultdict(list)
    rates, slowest = [], []
    with _other_end() as (port, turn_to):
        for _ in range(share_of(_ROUNDS, size)):
            for mode in ("echo", "relay"):
                turn_to(mode)
                medians[mode].append(median(_echoes(port, count)))
            turn_to("board")
            shows, pings = _requests(port, count)
            medians["show"].append(median(shows))
            medians["ping"].append(median(pings))
            rates.append(len(shows) / sum(shows))
            slowest.append(float(np.quantile(shows, 0.99)) * 1e3)
    # The best round of each counts: what else the machine does only makes it slower.
    echo, relay, show, ping = (min(medians[name]) * 1e3 for name in ("echo", "relay", "show", "ping"))
    yield Row("plain echo over the pty, round trip, median of the best round", echo, "ms")
    yield Row("plain echo by MicroPython behind the same pty", relay, "ms")
    yield Row("PING to the firmware in MicroPython over the same pty", ping, "ms")
    yield Row("acknowledged SHOW over the same pty", show, "ms")
    yield Row("  in MicroPython's plain echoes", show / relay, "×", "≤ 2")
    yield Row("  in plain echoes of the pty alone", show / echo, "×", "≤ 2")
    yield Row("acknowledged SHOWs a second, one after another", max(rates), "1/s", "≥ 300")
    yield Row("  slowest in a hundred", min(slowest), "ms")


def _echoes(name: str, count: int) -> list[float]:
    """Round trips (s) of a SHOW's frame that is given back."""
    frame = message.encode("SHOW", 1, (0,), [(8000,)] * 7)
    times = []
    with serial.Serial(name, timeout=1.0) as port:
        port.reset_input_buffer()
        for _ in range(count):
            begin = time.perf_counter()
            port.write(frame)
            port.read(len(frame))
            times.append(time.perf_counter() - begin)
    return times


def _requests(name: str, count: int) -> tuple[list[float], list[float]]:
    """Round trips (s) of so many SHOWs, and of a quarter as many PINGs."""

    def timed(request: str, fixed: tuple[int, ...], repeated: list[tuple[int]]) -> float:
        begin = time.perf_counter()
        run_sync(link.call(request, fixed, repeated))
        return time.perf_counter() - begin

    link = Link(SerialTransport(name), 2.0)
    try:
        run_sync(link.hello())
        shows = [timed("SHOW", (0,), [(8000 + k,)] * 7) for k in range(count)]
        pings = [timed("PING", (k,), []) for k in range(max(1, count // 4))]
        run_sync(link.call("VENT"))
    finally:
        run_sync(link.close())
    return shows, pings
