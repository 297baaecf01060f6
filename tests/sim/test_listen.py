"""Requests between two ticks: answered at once, on the device's clock, on CPython and MicroPython alike."""

import pytest

from bubble_protocol import messages
from bubbleskin.link import wire
from bubbleskin.sim.board import SimulatedBoard, load_board
from bubbleskin.sim.micropython import MicroPythonFirmware


@pytest.fixture(params=["cpython", "micropython"])
def board(request):
    firmware = MicroPythonFirmware(load_board("wristband7"), boot_id=1) if request.param == "micropython" else None
    board = SimulatedBoard("wristband7", firmware=firmware)
    yield board
    board.close()


def heard(board):
    found = list(wire.Reader().feed(bytes(board.from_device)))
    board.from_device.clear()
    return found


def test_a_request_between_ticks_is_answered_with_the_time_it_was_read(board):
    for _ in range(3):
        board.tick()
    time = board.time
    board.to_device += wire.encode("PING", 1, (7,))
    board.listen(1234)
    (reply,) = heard(board)
    assert (reply["token"], reply["ticks"], reply["phase_us"]) == (7, 2, 1234)
    assert board.time == time, "no time passes"
    board.to_device += wire.encode("PING", 2, (8,))
    board.tick()
    (reply,) = heard(board)
    assert (reply["ticks"], reply["phase_us"]) == (3, 0)


def test_a_show_between_ticks_acts_from_the_next(board):
    board.tick()
    before = board.pulses.copy()
    board.to_device += wire.encode("SHOW", 1, (0,), [(9000,)] * 7)
    board.listen(3000)
    assert [message.id for message in heard(board)] == [messages.SHOW | messages.REPLY]
    assert (board.pulses == before).all()
    for _ in range(8):  # the vents close, the lines become quiet
        board.tick()
    assert (board.pulses[:, 0] > 0).all()


def test_telemetry_comes_in_ticks_only(board):
    board.to_device += wire.encode("SUBSCRIBE", 1, (1,))
    board.tick()
    heard(board)
    for _ in range(5):
        board.listen(100)
    assert heard(board) == []
    board.tick()
    assert [message.id for message in heard(board)] == [messages.TELEMETRY]
