"""A served board and the programs that come to it: one that misbehaves harms itself, and nobody is left without a word."""

import contextlib
import importlib.util
import os
import socket
import sys
import threading
import time
from pathlib import Path

import pytest

import bubbleskin as bs
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.serve import TcpEnd, serve

BUFFERED = 4096
"""Bytes for the board that are kept."""


class Watched(SimulatedBoard):
    """`most`: bytes that have waited for the board at once."""

    most = 0

    def listen(self, phase_us):
        self.most = max(self.most, len(self.to_device))
        super().listen(phase_us)


class Served:
    """A wristband at a TCP port, in a thread."""

    def __init__(self):
        self._halt = threading.Event()
        self._end = TcpEnd(0)
        self.name = self._end.name
        self.board = Watched("wristband7", contact=False)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        for _ in serve(self.board, self._end, lambda: not self._halt.is_set()):
            pass

    def plain(self):
        """A program that has come and says nothing."""
        host, port = self.name.removeprefix("socket://").split(":")
        return socket.create_connection((host, int(port)))

    def stop(self):
        self._halt.set()
        self._thread.join(5.0)
        self._end.close()


@pytest.fixture
def served():
    served = Served()
    yield served
    served.stop()


@pytest.mark.medium
def test_a_flood_is_not_kept_nor_left_to_the_next_program(served):
    flood = served.plain()
    flood.settimeout(10.0)
    until = time.monotonic() + 10.0
    while served.board.most < BUFFERED // 2 and time.monotonic() < until:
        flood.sendall(bytes(range(256)) * 1000)
    flood.close()
    with bs.connect(served.name) as skin:
        assert skin.info.bubbles == 7
        skin.show([8.0] * 7)
    assert BUFFERED // 2 <= served.board.most <= BUFFERED


def test_what_was_begun_for_one_program_is_not_ended_by_another(served):
    begun = served.plain()
    begun.sendall(b"\x09\x04half a frame")
    begun.close()
    with bs.connect(served.name) as skin:
        assert skin.info.bubbles == 7


@pytest.mark.medium
def test_programs_that_say_nothing_hold_nobody_up(served):
    with contextlib.ExitStack() as stack:
        for _ in range(50):
            stack.enter_context(served.plain())
        with bs.connect(served.name) as skin:
            assert skin.info.bubbles == 7


@pytest.mark.medium
def test_one_that_has_fallen_silent_gives_way_and_is_told(served):
    with served.plain() as silent:
        silent.sendall(b"\1")
        time.sleep(1.2)
        with bs.connect(served.name) as skin:
            assert skin.info.bubbles == 7
        silent.settimeout(5.0)
        said = b""
        while part := silent.recv(1000):
            said += part
        assert b"has gone to another program" in said


@pytest.mark.medium
def test_while_a_program_has_the_board_others_are_told(served):
    with bs.connect(served.name) as skin:
        for _ in range(3):
            with pytest.raises(bs.LinkError, match="It says: Another program holds this simulated board"):
                bs.connect(served.name)
        skin.show([8.0] * 7)
    with bs.connect(served.name) as other:
        assert other.info.bubbles == 7


@pytest.mark.medium
def test_programs_come_and_go(served):
    for _ in range(10):
        bs.connect(served.name).close()


@pytest.mark.slow
def test_a_server_that_is_attacked_keeps_its_memory_and_serves_the_next():
    """200 MB of flood, 50 idle programs, 100 that come and go. How soon each is served, the tool says."""
    path = Path(__file__).parents[2] / "tools/stress/served_board.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    tool = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert tool.memory_mb(os.getpid()) > 10.0, "memory is measured"
    outcomes = tool.attack(1.0)
    served = [outcome.attack for outcome in outcomes]
    assert served == ["nothing", "junk", "flood", "idle", "reconnects", "honest reconnects"]
    assert all(abs(outcome.grown_mb) <= tool.GROWN_MB for outcome in outcomes), outcomes
