"""STOP and VENT overtake all that waits and all that is under way; each caller is told what became of its request."""

import asyncio

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import Link, run_sync
from bubbleskin.sim import Impairment, LossyTransport, SimulatedBoard, SimulatedTransport

pytestmark = pytest.mark.timeout(60)


def journal(board):
    """The first height of every SHOW that is applied, in order."""
    applied, show = [], board.firmware.app.commands.show

    def tapped(values, first, over_ms):
        applied.append(values[first])
        show(values, first, over_ms)

    board.firmware.app.commands.show = tapped
    return applied


@pytest.mark.promise("overtaking")
@pytest.mark.parametrize("urgent", ["stop", "vent"])
@pytest.mark.parametrize("seed", range(4))
def test_overtaken_or_applied_and_nothing_after(urgent, seed):
    board = SimulatedBoard("wristband7")
    applied = journal(board)
    line = LossyTransport(SimulatedTransport(board, "sim"), Impairment(drop=0.2, reorder=0.1), seed=seed)

    async def script():
        skin = await AsyncSkin.open(line, 2.0, event_loop=True)
        shows = [asyncio.create_task(skin.show(np.full(7, 6.0 + k / 10), wait=False)) for k in range(30)]
        await skin.sleep(0.01)
        await getattr(skin, urgent)()
        mode, so_far = board.firmware.app.safety.mode, len(applied)
        outcomes = await asyncio.gather(*shows, return_exceptions=True)
        assert len(applied) == so_far < 30, "nothing is applied after it"
        state = await skin.state()
        return mode, outcomes, state

    mode, outcomes, state = asyncio.run(script())
    for number, outcome in enumerate(outcomes):
        height = 6000 + 100 * number
        if outcome is None:
            assert applied.count(height) == 1
        else:
            assert type(outcome) is bs.Overtaken
            assert "was not applied" in str(outcome) or "It was not applied" in str(outcome)
            assert height not in applied
    assert {type(outcome) for outcome in outcomes} >= {bs.Overtaken}
    assert state.mode == {"stop": "holding", "vent": "idle"}[urgent]
    assert applied == sorted(applied)
    assert mode is not None


def test_in_one_batch():
    board = SimulatedBoard("wristband7")
    applied = journal(board)
    link = Link(SimulatedTransport(board, "sim"), 2.0)
    show = ("SHOW", (0,), [(9000,)] * 7)
    with pytest.raises(bs.Overtaken, match="SHOW was overtaken by VENT; it was not applied"):
        run_sync(link.calls([show, ("VENT", (), ()), ("SHOW", (0,), [(8000,)] * 7)]))
    assert applied == [8000]


@pytest.mark.promise("cancelled")
@pytest.mark.parametrize("before", range(0, 60, 7))
def test_a_cancelled_call_leaves_no_gap(before):
    """Cancelled before it was sent it never is; after that it is seen through, so that the window stays open."""
    board = SimulatedBoard("wristband7")
    applied = journal(board)
    line = LossyTransport(SimulatedTransport(board, "sim"), Impairment(drop=0.2), seed=before)

    async def script():
        skin = await AsyncSkin.open(line, 2.0, event_loop=True)
        shows = [asyncio.create_task(skin.show(np.full(7, 6.0 + k / 10), wait=False)) for k in range(40)]
        for _ in range(before):
            await asyncio.sleep(0)
        for task in shows[::2]:
            task.cancel()
        await asyncio.gather(*shows, return_exceptions=True)
        for _ in range(20):
            await skin.state()
        return [task.cancelled() for task in shows]

    cancelled = asyncio.run(script())
    assert applied == sorted(set(applied))
    for number, gone in enumerate(cancelled):
        assert gone or 6000 + 100 * number in applied
