"""Ports and devices to connect to: pseudo-terminals, served boards, and devices that behave as a test says."""

import contextlib
import threading
from collections.abc import Callable

import pytest

from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import NO_KEY, Decoder, finish_frame
from bubble_protocol.schema import messages
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.link.message import encode, session_key
from bubbleskin.link.reader import Reader
from bubbleskin.link.transport import Transport
from bubbleskin.sim import SimulatedBoard, SimulatedTransport
from bubbleskin.sim.serve import PtyEnd, TcpEnd, serve
from bubbleskin.skin import Skin


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


BOOT_ID = 2


def greeting(request, low=PROTOCOL_MIN, high=PROTOCOL_MAX, board=b"wristband7", bubbles=7, window=8):
    """The reply to HELLO of a device that speaks protocols `low` to `high`."""
    name = list(board.ljust(16, b"\0"))
    values = (low, high, 1, BOOT_ID, 0, 1, 0, *name, bubbles, 5000, 5000, 14000, 42000, window, 0, 3)
    return encode("HELLO_REPLY", request.sequence, values)


def rekeyed(data, key):
    """Frames without a key, with this one."""
    decoder = Decoder(crc32_into)
    out = b""
    at = 0
    while at < len(data):
        at = decoder.feed(data, at, len(data))
        if decoder.length:
            frame = decoder.frame
            out += bytes(frame[: finish_frame(frame, decoder.length, crc32_into, key)])
    return out


class Scripted(Transport):
    """A transport to a device that is a function: `answer(request)` gives the bytes it sends, without the session's key.

    HELLO is answered here, unless `answer` does. `requests` has no PINGs that keep the link alive. Time is virtual.
    """

    blocks = False

    def __init__(self, answer):
        self.name = "scripted"
        self.requests = []
        self.closed = False
        self._answer = answer
        self._reader = Reader()
        self._key = NO_KEY
        self._out = b""
        self._now = 0.0

    def write(self, data):
        for request in self._reader.feed(data):
            if request.id == messages.HELLO:
                self._key = session_key(BOOT_ID, request["session"])
                self._reader.use(self._key)
            if request.id == messages.PING and request["token"] == 0:
                continue
            self.requests.append(request)
            answer = self._answer(request)
            if request.id == messages.HELLO and not answer:
                answer = greeting(request)
            self._out += rekeyed(answer, self._key)

    def read(self, timeout):
        out, self._out = self._out, b""
        self._now += 0.001 if out else timeout
        return out

    def now(self):
        return self._now

    def close(self):
        self.closed = True


@pytest.fixture
def hello():
    """`greeting`, for devices that are functions."""
    return greeting


@pytest.fixture
def scripted():
    """`scripted(answer)`: a `Scripted` transport."""
    return Scripted


class Tap(Transport):
    """A transport on top of another: keeps what passes, and `change(data)` may change it on its way from the device."""

    blocks = False
    skin = None

    def __init__(self, transport, change=lambda data: data, change_sent=lambda data: data):
        self.name = transport.name
        self.sent = bytearray()
        self.received = bytearray()
        self.transport = transport
        self.change = change
        self.change_sent = change_sent

    def read(self, timeout):
        data = self.change(self.transport.read(timeout))
        self.received += data
        return data

    def write(self, data):
        self.sent += data
        self.transport.write(self.change_sent(data))

    def understood(self, data):
        """The messages of the open session in `data`, but for the PINGs that keep the link alive and their replies."""
        reader = Reader(self.skin.link.window.key)
        return [message for message in reader.feed(bytes(data)) if message.id & 0x7F != messages.PING]

    def now(self):
        return self.transport.now()

    def close(self):
        self.transport.close()


@pytest.fixture
def tapped():
    """`tapped(board="wristband7", seed=0, spread=0.0, **changes)`: a skin on a simulated board, and the tap between."""
    boards, skins = [], []

    def make(board="wristband7", seed=0, spread=0.0, timeout=2.0, **changes):
        simulated = SimulatedBoard(board, seed=seed, spread=spread, contact=False)
        boards.append(simulated)
        tap = Tap(SimulatedTransport(simulated, board), **changes)
        tap.skin = Skin(run_sync(AsyncSkin.open(tap, timeout, simulated=simulated)))
        skins.append(tap.skin)
        return tap.skin, tap

    yield make
    for skin in skins:
        skin.close()
    for board in boards:
        board.close()
