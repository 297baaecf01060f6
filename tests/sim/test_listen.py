"""Requests between two ticks: answered at once, on the device's clock, on CPython and MicroPython alike."""

import pytest

from bubble_protocol import frame
from bubble_protocol.schema import messages
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin import boards
from bubbleskin.link.message import encode, session_key
from bubbleskin.link.reader import Reader
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.micropython import MicroPythonFirmware

SESSION = 5


@pytest.fixture(params=["cpython", "micropython"])
def host(request):
    firmware = MicroPythonFirmware(boards.load("wristband7"), boot_id=1) if request.param == "micropython" else None
    board = SimulatedBoard("wristband7", firmware=firmware)
    yield Host(board)
    board.close()


class Host:
    """A board, and a session with it that its second tick has opened."""

    def __init__(self, board):
        self.board = board
        self._reader = Reader()
        self._key = frame.NO_KEY
        for _ in range(2):
            board.tick()
        self.say("HELLO", 1, (PROTOCOL_MIN, PROTOCOL_MAX, SESSION))
        board.tick()
        (reply,) = self.heard()
        self._key = session_key(reply["boot_id"], SESSION)
        self._reader.use(self._key)

    def say(self, name, sequence, fixed, repeated=()):
        self.board.to_device += encode(name, sequence, fixed, repeated, self._key)

    def heard(self):
        found = list(self._reader.feed(bytes(self.board.from_device)))
        self.board.from_device.clear()
        return found


def test_a_request_between_ticks_is_answered_with_the_time_it_was_read(host):
    board = host.board
    time = board.time
    host.say("PING", 1, (7,))
    board.listen(1234)
    (reply,) = host.heard()
    assert (reply["token"], reply["ticks"], reply["phase_us"]) == (7, 2, 1234)
    assert board.time == time, "no time passes"
    host.say("PING", 2, (8,))
    board.tick()
    (reply,) = host.heard()
    assert (reply["ticks"], reply["phase_us"]) == (3, 0)


def test_a_show_between_ticks_acts_from_the_next(host):
    board = host.board
    board.tick()
    before = board.pulses.copy()
    host.say("SHOW", 1, (0,), [(9000,)] * 7)
    board.listen(3000)
    assert [message.id for message in host.heard()] == [messages.SHOW | messages.REPLY]
    assert (board.pulses == before).all()
    for _ in range(8):  # the vents close, the lines become quiet
        board.tick()
    assert (board.pulses[:, 0] > 0).all()


def test_telemetry_comes_in_ticks_only(host):
    board = host.board
    host.say("SUBSCRIBE", 1, (1,))
    board.tick()
    host.heard()
    for _ in range(5):
        board.listen(100)
    assert host.heard() == []
    board.tick()
    assert [message.id for message in host.heard()] == [messages.TELEMETRY]
