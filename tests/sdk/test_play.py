"""Playing a sequence over links that lose things, as a stream, from files, and beside other tasks."""

import asyncio
import contextlib
from dataclasses import dataclass

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol.schema import faults, messages
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim import SimulatedBoard, SimulatedTransport
from bubbleskin.skin import Skin

pytestmark = pytest.mark.timeout(60)

UP, DOWN = [9.0] * 7, [6.0] * 7
TWO = bs.Sequence([bs.Step(UP, 0.1, name="up"), bs.Step(DOWN, 0.1)])


def without(unwanted, times=10**9):
    """A change that drops the first `times` messages of an id. COBS leaves an id as it is, for it is never zero."""
    left = [times]

    def change(data):
        kept = b""
        for frame in data.split(b"\0")[:-1]:
            if len(frame) > 1 and frame[1] == unwanted and left[0]:
                left[0] -= 1
            else:
                kept += frame + b"\0"
        return kept

    return change


def test_without_a_single_event_it_still_ends(tapped):
    skin, _ = tapped(change=without(messages.SEQUENCE_EVENT))
    played = skin.play(TWO)
    assert (played.steps, played.lost) == ((), 1)
    assert skin.playing().reason == "complete"


def test_events_that_are_lost_are_counted(tapped):
    skin, _ = tapped(change=without(messages.SEQUENCE_EVENT, 2))
    played = skin.play(bs.Sequence([bs.Step(UP, 0.05)], loops=5))
    assert len(played.steps) == 3
    drops = iter([False, True, False, True, False, False])
    skin, _ = tapped(
        change=lambda data: b"" if len(data) > 1 and data[1] == messages.SEQUENCE_EVENT and next(drops) else data
    )
    played = skin.play(bs.Sequence([bs.Step(UP, 0.05)], loops=5))
    assert len(played.steps) + played.lost == 5


@pytest.mark.parametrize("name", ["BEGIN", "WRITE", "ARM", "START", "STATE", "CONTROL"])
def test_a_lost_reply_is_mended(tapped, name):
    request = getattr(messages, f"SEQUENCE_{name}")
    skin, _ = tapped(change=without(request | messages.REPLY, 1))
    long = bs.Sequence([bs.Step(UP, 0.5), *[bs.Step(DOWN, 0.1)] * 30])
    skin.play(long, wait=False)
    skin.pause()
    skin.resume()
    skin.sleep(4.0)
    assert (skin.playing().reason, skin.playing().step) == ("complete", 30)


def test_an_upload_cut_half_way_and_a_new_one(tapped):
    skin, tap = tapped()
    board = skin.simulated
    skin.show(DOWN)
    written = [0]

    def cut(data):
        if len(data) > 1 and data[1] == messages.SEQUENCE_WRITE:
            written[0] += 1
            if written[0] > 3:
                raise bs.LinkError("the plug is pulled.")
        return data

    tap.change_sent = cut
    with pytest.raises(bs.LinkError):
        skin.play(bs.Sequence([bs.Step(UP, 0.1)] * 100))
    again = Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, "again"), 2.0, simulated=board)))
    state = again.state()
    assert state.mode == "active", "what was shown still is"
    assert state.height_mm == pytest.approx(DOWN, abs=0.2)
    assert again.playing().state == "loading"
    assert again.play(TWO).steps == (0, 1)


# Streams. A memory of a few records makes them short.


@pytest.fixture
def narrow(tapped):
    """A skin on a board whose memory holds 40 records."""
    skin, tap = tapped()
    skin.simulated.firmware.app.player.sequence.capacity = 40
    return skin, tap


def test_what_does_not_fit_is_streamed_without_repeats(narrow):
    skin, _ = narrow
    rng = np.random.default_rng(2)
    steps = [bs.Step(rng.uniform(5.5, 9, 7).round(3), 0.02) for _ in range(30)]
    sequence = bs.Sequence([bs.Repeat(steps, 2), *steps[:20]], loops=2)
    with pytest.raises(
        bs.InvalidInput, match=r"takes 54 records and the memory of this wristband7 holds 40.*wait=True"
    ):
        skin.play(sequence, wait=False)
    played = skin.play(sequence)
    assert played.steps == tuple(sequence.unrolled())
    assert played.lost == 0
    assert np.diff(played.began) == pytest.approx(0.02, abs=1e-9)


def test_a_stream_without_end_plays_until_it_is_stopped(narrow):
    skin, _ = narrow
    sequence = bs.Sequence([bs.Step([6.0 + k / 100] * 7, 0.02) for k in range(50)], loops=0)
    seen = []

    def stop_soon(playing):
        seen.append(playing.step)
        if len(seen) == 120:
            skin.stop()

    with pytest.raises(bs.DeviceFault, match=r"ended in step \d+: it was stopped or vented"):
        skin.play(sequence, progress=stop_soon)
    assert seen[:120] == [*range(50), *range(50), *range(20)]


def test_a_stream_that_runs_dry_is_a_fault_that_is_named(narrow):
    skin, tap = narrow
    tap.change_sent = lambda data: (
        b"" if skin.simulated.time < held[0] and len(data) > 1 and data[1] == messages.SEQUENCE_WRITE else data
    )
    held = [0.0]

    def hold_up(playing):
        if playing.begun_steps == 5:
            held[0] = skin.simulated.time + 1.0

    with pytest.raises(bs.DeviceFault, match=r"ran dry after step \d+: .* The last shape is held"):
        skin.play(bs.Sequence([bs.Step(UP, 0.01)] * 200), progress=hold_up)
    assert skin.state().mode == "active"


# What may be played, and what went wrong.


def test_files_and_plans_can_be_played(tapped, tmp_path):
    skin, _ = tapped()

    @dataclass
    class Plan:
        sequence: bs.Sequence

    TWO.to_json(tmp_path / "two.json")
    (tmp_path / "two.csv").write_text(
        "time_s,b0,b1,b2,b3,b4,b5,b6\n0,9,9,9,9,9,9,9\n0.1,6,6,6,6,6,6,6\n", encoding="utf-8"
    )
    for what in (Plan(TWO), tmp_path / "two.json", str(tmp_path / "two.csv"), TWO):
        assert skin.play(what).steps == (0, 1)


def test_a_fault_of_the_board_is_named(tapped):
    skin, _ = tapped()

    def press(playing):
        skin.simulated.firmware.active_faults = faults.ESTOP

    with pytest.raises(bs.DeviceFault, match=r"ended in step 0 \(up\): faults of the board: emergency_stop"):
        skin.play(TWO, progress=press)
    with pytest.raises(bs.DeviceRefused, match="emergency stop"):
        skin.play(TWO)


def test_playing_says_what_another_connection_started(tapped):
    skin, _ = tapped()
    assert skin.playing().state == "empty"
    skin.play(bs.Sequence([bs.Step(UP, 0.1)], loops=0), wait=False)
    board = skin.simulated
    other = Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, "other"), 2.0, simulated=board)))
    assert other.playing().state == "playing"
    assert other.playing().step == -1, "it does not know the steps"
    other.pause()
    assert other.playing().state == "paused"
    other.play(TWO)
    assert other.playing().reason == "complete"


def test_pause_and_stop_from_another_task():
    async def run():
        board = SimulatedBoard("wristband7")
        async with await AsyncSkin.open(
            SimulatedTransport(board, "board"), 2.0, event_loop=True, simulated=board
        ) as skin:
            playing = asyncio.create_task(skin.play(bs.Sequence([bs.Step(UP, 0.2), bs.Step(DOWN, 0.2)], loops=0)))
            await skin.sleep(0.5)
            await skin.pause()
            begun = (await skin.playing()).begun
            await skin.sleep(0.5)
            paused = await skin.playing()
            assert paused.state == "paused"
            assert paused.begun == pytest.approx(begun + 0.5, abs=0.05), "its time stands still"
            await skin.resume()
            await skin.sleep(0.5)
            await skin.stop()
            with pytest.raises(bs.DeviceFault, match="stopped"):
                await playing

    asyncio.run(run())


def test_a_name_of_the_library_is_played():
    with bs.connect("sim://wristband7?contact=0") as skin:
        assert len(skin.play("breathing").steps) == 6
        assert skin.play(bs.Sequence([bs.Step([7] * 7)])).steps == (0,), "a step needs no more than targets"


def test_a_play_that_is_cancelled_in_asyncio_stops_the_wristband():
    async def main():
        async with await bs.aconnect("sim://wristband7?contact=0") as skin:
            playing = asyncio.create_task(skin.play(bs.sequences.pulse(skin.layout, loops=0)))
            while (await skin.playing()).state != "playing":
                await skin.sleep(0.05)
            playing.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await playing
            return (await skin.state()).mode, (await skin.playing()).state

    assert asyncio.run(main()) == ("holding", "ended"), "what STOP makes of it"


def test_targets_in_metres_are_refused_before_they_are_played():
    with bs.connect("sim://wristband7?contact=0") as skin:
        with pytest.raises(bs.InvalidInput, match=r"greatest height is 0\.009 mm.* metres, give them times 1000"):
            skin.play(bs.Sequence([bs.Step([0.006] * 7, 0.1), bs.Step([0.009] * 6 + [None], 0.1)]))
        skin.play(bs.Sequence([bs.Step([0.0] * 7, 0.1), bs.Step(None, until=bs.After(0.1))]))
