"""Ports and devices to connect to: pseudo-terminals, served boards, and devices that behave as a test says."""

import contextlib
import threading
from collections.abc import Callable

import pytest

from bubbleskin.link.session import drive
from bubbleskin.link.wire import Reader
from bubbleskin.sim import SimulatedBoard, SimulatedTransport
from bubbleskin.sim.serve import PtyEnd, TcpEnd, serve
from bubbleskin.skin import AsyncSkin, Skin


class Background:
    """Something that runs in a thread until it is told to stop; an exception there is the test's failure."""

    def __init__(self, run: Callable[[Callable[[], bool]], None]):
        self._halt = threading.Event()
        self._thread = threading.Thread(target=run, args=(lambda: not self._halt.is_set(),), daemon=True)
        self._thread.start()

    def stop(self):
        self._halt.set()
        self._thread.join(5.0)
        assert not self._thread.is_alive()


class Served:
    """A simulated board that answers at `name` in real time, until `stop`; the port stays open after it."""

    def __init__(self, end, board="wristband7"):
        self.name = end.name
        self.board = SimulatedBoard(board)

        def run(running):
            for _ in serve(self.board, end, running):
                pass

        self._background = Background(run)
        self.stop = self._background.stop


@pytest.fixture
def port():
    """A pseudo-terminal: `name` to connect to; `wait(seconds)` and `write(data)` at its other end."""
    end = PtyEnd()
    yield end
    with contextlib.suppress(OSError):  # a test may have pulled the plug
        end.close()


@pytest.fixture
def behaving(port):
    """`behaving(f)`: a device at `port` that sends `f(what has come)`, over and over."""
    running = []

    def start(answer: Callable[[bytes], bytes]):
        def run(go_on):
            while go_on():
                port.write(answer(port.wait(0.01)))

        running.append(Background(run))
        return port.name

    yield start
    for background in running:
        background.stop()


@pytest.fixture(params=["pty", "tcp"])
def served(request):
    """A wristband served in real time, at a pseudo-terminal and at a TCP port."""
    end = PtyEnd() if request.param == "pty" else TcpEnd(0)
    served = Served(end)
    yield served
    served.stop()
    end.close()


@pytest.fixture
def served_port(port):
    """A wristband served in real time at a pseudo-terminal."""
    served = Served(port)
    yield served
    served.stop()


class Scripted:
    """A transport to a device that is a function: `answer(request)` gives the bytes it sends. Time is virtual."""

    blocks = False

    def __init__(self, answer):
        self.name = "scripted"
        self.requests = []
        self.closed = False
        self._answer = answer
        self._reader = Reader()
        self._out = b""
        self._now = 0.0

    def write(self, data):
        for request in self._reader.feed(data):
            self.requests.append(request)
            self._out += self._answer(request)

    def read(self, timeout):
        out, self._out = self._out, b""
        self._now += 0.001 if out else timeout
        return out

    def now(self):
        return self._now

    def close(self):
        self.closed = True


@pytest.fixture
def scripted():
    """`scripted(answer)`: a `Scripted` transport."""
    return Scripted


class Tap:
    """A transport on top of another: keeps what passes, and `change(data)` may change it on its way from the device."""

    blocks = False

    def __init__(self, transport, change=lambda data: data, change_sent=lambda data: data):
        self.name = transport.name
        self.sent = bytearray()
        self.received = bytearray()
        self._transport = transport
        self._change = change
        self._change_sent = change_sent

    def read(self, timeout):
        data = self._change(self._transport.read(timeout))
        self.received += data
        return data

    def write(self, data):
        self.sent += data
        self._transport.write(self._change_sent(data))

    def now(self):
        return self._transport.now()

    def close(self):
        self._transport.close()


@pytest.fixture
def tapped():
    """`tapped(board="wristband7", seed=0, spread=0.0, **changes)`: a skin on a simulated board, and the tap between."""
    boards = []

    def make(board="wristband7", seed=0, spread=0.0, timeout=2.0, **changes):
        simulated = SimulatedBoard(board, seed=seed, spread=spread, contact=False)
        boards.append(simulated)
        tap = Tap(SimulatedTransport(simulated, board), **changes)
        return Skin(drive(AsyncSkin.open(tap, timeout, simulated=simulated))), tap

    yield make
    for board in boards:
        board.close()
