"""A host that dies: the board holds and vents by itself, on its own clock."""

import contextlib
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol.schema import modes
from bubbleskin.sim import SimulatedBoard
from bubbleskin.sim.serve import PtyEnd, serve

HOST = """
import sys
import bubbleskin as bs
skin = bs.connect(sys.argv[1])
skin.show([12.0] * skin.info.bubbles, over=20.0, wait=False)
print("moving", flush=True)
skin.sleep(60)
"""


def test_in_virtual_time_a_host_that_stops_is_noticed_to_the_tick():
    with bs.connect("sim://wristband7") as skin:
        skin.show(np.full(7, 12.0), over=20.0, wait=False)
        board, tick = skin.simulated, skin.info.tick
        asked = board.time  # answered in the tick that has just passed
        while board.firmware.app.safety.mode == modes.ACTIVE:
            board.tick()
        held = board.time - tick  # the tick that decided it began then
        while board.firmware.app.safety.mode == modes.HOLDING:
            board.tick()
        vented = board.time - tick
        assert held - asked == pytest.approx(0.25 - tick)
        assert vented - asked == pytest.approx(1.0 - tick)
        first, second = skin.fault_log()
        assert (first.name, first.bubble, first.value) == ("host_silent", None, 0.25)
        assert second.value == 1.0
        assert second.time - first.time == pytest.approx(0.75)
        assert skin.show(np.full(7, 9.0)).mode == "active", "it goes on"


@pytest.mark.promise("silence")
@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_killed_process_is_noticed():
    """SIGKILL in the middle of a move; the times are the board's own."""
    board = SimulatedBoard("wristband7")
    end = PtyEnd()
    running = True
    seen = []

    def run():
        app = board.firmware.app
        for _ in serve(board, end, lambda: running):
            seen.append((app.clock.ticks, app.deadman.silent_ticks, app.safety.mode))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        host = subprocess.Popen([sys.executable, "-c", HOST, end.name], stdout=subprocess.PIPE, text=True)
        try:
            assert host.stdout.readline() == "moving\n"
            assert board.firmware.app.safety.mode == modes.ACTIVE
            host.send_signal(signal.SIGKILL)
            host.wait()
            killed = board.firmware.app.clock.ticks
        finally:
            with contextlib.suppress(ProcessLookupError):
                host.kill()
            host.stdout.close()
        for _ in range(600):
            if board.firmware.app.clock.ticks > killed + 300:
                break
            threading.Event().wait(0.05)
        with bs.connect(end.name) as skin:
            log = skin.fault_log()
    finally:
        running = False
        thread.join()
        end.close()
    held, vented = log[-2:]
    assert (held.name, held.value, vented.name, vented.value) == ("host_silent", 0.25, "host_silent", 1.0)
    heard = max(tick - silent for tick, silent, _ in seen if silent <= 1 and tick < held.time / 0.005)
    assert held.time == pytest.approx((heard + 49) * 0.005, abs=0.006), "50 ticks after the last that heard of it"
    assert vented.time - held.time == pytest.approx(0.75)


def test_who_connects_while_a_shape_stands_is_told(served_port, port, caplog):
    with bs.connect(port.name) as skin:
        skin.show([9.0] * 7, wait=False)
        assert not caplog.records, "nothing stood before"
    with bs.connect(port.name) as skin:
        (told,) = caplog.records
        assert "A shape stands on" in told.getMessage()
        skin.vent()
