"""A script that thinks keeps its shape: the wristband hears from it. One that has ended or let go does not."""

import asyncio
import gc
import threading
import time
import warnings

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.link.transport import Transport

pytestmark = pytest.mark.timeout(30)

GAP = 0.1
TICK = 0.005


class Times(Transport):
    """A transport that notes when something is written."""

    def __init__(self, transport):
        self.times = []
        self._transport = transport
        self.name, self.blocks = transport.name, transport.blocks

    def write(self, data):
        self.times.append(self.now())
        self._transport.write(data)

    def read(self, timeout):
        return self._transport.read(timeout)

    def now(self):
        return self._transport.now()

    def close(self):
        self._transport.close()


def heard(served):
    return served.board.firmware.app.server.decoder.good


def keepers():
    return [thread for thread in threading.enumerate() if thread.name == "bubbleskin keep-alive"]


@pytest.mark.promise("kept-alive")
@pytest.mark.medium
@pytest.mark.parametrize("event_loop", [False, True])
def test_as_virtual_time_passes(event_loop):
    from bubbleskin.async_skin import AsyncSkin
    from bubbleskin.link.link import run_sync
    from bubbleskin.sim import SimulatedBoard, SimulatedTransport

    board = SimulatedBoard("wristband7")
    line = Times(SimulatedTransport(board, "sim"))

    async def script():
        skin = await AsyncSkin.open(line, 2.0, event_loop=event_loop)
        await skin.show(np.full(7, 10.0))
        await skin.sleep(5.0)
        await skin.show(np.full(7, 11.0), over=2.0)
        await skin.sleep(0.05)

    if event_loop:
        asyncio.run(script())
    else:
        run_sync(script())
    assert len(line.times) > 60
    assert np.diff(line.times).max() <= GAP + TICK + 1e-9
    assert board.firmware.app.server.decoder.good >= len(line.times) - 1
    assert not keepers(), "no thread where time is virtual"


@pytest.mark.promise("kept-alive")
@pytest.mark.medium
def test_while_a_script_thinks(served_port):
    with bs.connect(served_port.name) as skin:
        skin.show(np.full(7, 9.0), wait=False)
        before = heard(served_port)
        time.sleep(1.5)  # it thinks
        assert heard(served_port) >= before + 4
        assert skin.state().target_mm.tolist() == [9.0] * 7
    before = heard(served_port)
    time.sleep(0.5)
    assert heard(served_port) == before, "a skin that is closed lets go"


@pytest.mark.medium
def test_while_an_event_loop_does_something_else(served_port):
    async def script():
        async with await bs.aconnect(served_port.name):
            before = heard(served_port)
            await asyncio.sleep(1.5)
            assert heard(served_port) >= before + 4

    asyncio.run(script())


@pytest.mark.medium
def test_a_skin_that_nobody_holds_is_let_go(served_port):
    skin = bs.connect(served_port.name)
    assert len(keepers()) == 1
    keeper = keepers()[0]
    held = [skin]
    del skin
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # that it was not closed; whoever has the link last says so, and that may be the thread
        held.clear()
        gc.collect()
        keeper.join(5.0)
    assert not keeper.is_alive()


@pytest.mark.medium
def test_every_round_trip_is_told(served_port):
    with bs.connect(served_port.name) as skin:
        told = []
        skin.link.on_ping = lambda *trip: told.append(trip)
        time.sleep(1.0)
        assert len(told) >= 3
        assert all(0 < received_at - sent_at < 1 for sent_at, _, received_at in told)
        ticks = [reply["ticks"] for _, reply, _ in told]
        assert ticks == sorted(ticks)
