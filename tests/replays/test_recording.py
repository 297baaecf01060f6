"""The file of a full recording: what is in it, what a kill leaves of it, and what is told of files that are none."""

import asyncio
import base64
import json
import os
import resource
import signal
import subprocess
import sys
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

import bubbleskin as bs
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim import SimulatedBoard, SimulatedTransport, history
from bubbleskin.sim.trace_file import LOOK, TICK, read
from bubbleskin.skin import Skin


@pytest.fixture
def skin():
    with bs.connect("sim://wristband7") as skin:
        yield skin


def test_it_begins_when_power_came_whenever_it_is_asked_for(skin, tmp_path):
    """The trouble has been, and then it is recorded."""
    skin.show([9.0] * 7, wait=False)
    skin.sleep(0.3)
    ticks = round(skin.simulated.time / skin.simulated.tick_s)
    with skin.record(tmp_path / "late.jsonl", full=True) as recording:
        assert recording.rows == ticks
        skin.sleep(0.1)
    trace = read(recording.path)
    assert (trace.ticks, trace.closed) == (ticks + 20, True)
    assert recording.rows == ticks + 20
    assert next(trace.calls()).link  # HELLO
    assert trace.head.board == skin.info.board
    assert bs.replay(recording.path).identical


def test_seconds_give_a_finished_file(skin, tmp_path):
    recording = skin.record(tmp_path / "whole.jsonl", seconds=0.5, full=True)
    trace = read(recording.path)
    assert trace.closed
    assert trace.ticks * skin.info.tick >= 0.5
    skin.sleep(0.1)
    assert read(recording.path).ticks == trace.ticks


def test_it_is_the_same_for_asyncio(tmp_path):
    async def script():
        async with await bs.aconnect("sim://wristband7") as skin:
            async with await skin.record(tmp_path / "a.jsonl", full=True) as recording:
                await skin.sleep(0.1)
            await skin.record(tmp_path / "b.jsonl", seconds=0.1, full=True)
            return recording

    recording = asyncio.run(script())
    for name in ("a.jsonl", "b.jsonl"):
        assert read(tmp_path / name).closed
    assert bs.replay(tmp_path / "b.jsonl").ticks > recording.rows


def test_two_files_and_telemetry_go_on_at_once(skin, tmp_path):
    with skin.record(tmp_path / "a.jsonl", full=True) as first, skin.record(tmp_path / "b.csv") as rows:
        skin.sleep(0.2)
        second = skin.record(tmp_path / "b.jsonl", full=True)
        skin.sleep(0.2)
    assert rows.rows
    skin.sleep(0.1)
    skin.close()  # finishes the other one
    assert read(first.path).closed
    assert read(second.path).closed
    assert read(second.path).ticks > read(first.path).ticks
    second.close()


def test_a_real_board_is_refused_with_what_to_do(tmp_path):
    board = SimulatedBoard()
    link = SimulatedTransport(board, "/dev/ttyACM0")
    with (
        Skin(run_sync(AsyncSkin.open(link, 2.0))) as skin,
        pytest.raises(bs.InvalidInput, match=r"/dev/ttyACM0 cannot be recorded in full: .* rate_hz=200 .* sim://"),
    ):
        skin.record(tmp_path / "real.jsonl", full=True)
    with pytest.raises(bs.InvalidInput, match=r"keep_history\(\)"):
        board.record(tmp_path / "real.jsonl")
    with (
        bs.connect("sim://wristband7?history=0") as skin,
        pytest.raises(bs.InvalidInput, match="Connect without history=0"),
    ):
        skin.record(tmp_path / "real.jsonl", full=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.chip
def test_the_emulated_chip_is_refused_with_what_to_do(tmp_path):
    with bs.connect("rp2040://wristband7?contact=0") as skin, pytest.raises(bs.InvalidInput, match="--on rp2040"):
        skin.record(tmp_path / "chip.jsonl", full=True)


def test_what_cannot_be_meant_is_refused_and_the_skin_goes_on(skin, tmp_path):
    for arguments, said in (
        ({"path": tmp_path / "a.csv"}, "ends in .jsonl"),
        ({"path": tmp_path / "a.jsonl", "fields": ["height"]}, "leave out rate_hz and fields"),
        ({"path": tmp_path / "a.jsonl", "rate_hz": 50}, "leave out rate_hz and fields"),
        ({"path": tmp_path / "a.jsonl", "seconds": -1}, "seconds"),
        ({"path": tmp_path / "nowhere" / "a.jsonl"}, "cannot be written: No such file"),
        ({"path": 5}, "path of the recording is 5"),
    ):
        with pytest.raises(bs.InvalidInput, match=said):
            skin.record(**arguments, full=True)
    with pytest.raises(bs.InvalidInput, match="full"):
        skin.record(tmp_path / "a.jsonl", full=1)
    assert not list(tmp_path.iterdir())
    skin.state()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a full disk is simulated by Linux")  # noqa: PTH110
def test_a_full_disk_is_told_and_does_not_stop_the_board(skin, tmp_path):
    (tmp_path / "full.jsonl").symlink_to("/dev/full")
    with pytest.raises(bs.InvalidInput, match="cannot be written: No space left"):
        skin.record(tmp_path / "full.jsonl", full=True)
    recording = skin.record(tmp_path / "a.jsonl", full=True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (6000, hard))  # in the middle of a block
    try:
        skin.sleep(5.5)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    with pytest.raises(bs.InvalidInput, match=r"a\.jsonl ends after \d+ ticks: File too large"):
        recording.close()
    found = bs.replay(recording.path)
    assert (found.identical, found.ticks) == (True, recording.rows)
    assert 200 < recording.rows < 900
    recording.close()


def test_more_than_is_kept_is_refused_later_and_goes_on_in_a_file(skin, tmp_path, monkeypatch):
    monkeypatch.setattr(history, "BYTES_MOST", 5000)
    with skin.record(tmp_path / "a.jsonl", full=True) as recording:
        skin.sleep(6.0)
        with pytest.raises(bs.InvalidInput, match=r"that is \d+ ticks ago.* Connect anew"):
            skin.record(tmp_path / "b.jsonl", full=True)
    assert recording.path.stat().st_size > 5000
    assert bs.replay(recording.path).identical


@pytest.mark.medium
def test_a_program_that_is_killed_loses_a_second_at_most(tmp_path):
    script = (
        "import os, bubbleskin as bs\n"
        "skin = bs.connect('sim://wristband7')\n"
        "skin.record('killed.jsonl', full=True)\n"
        "skin.show([9.0] * 7, wait=False)\n"
        "skin.sleep(3.3)\n"
        f"os.kill(os.getpid(), {signal.SIGKILL})\n"
    )
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, timeout=60, check=False)
    found = bs.replay(tmp_path / "killed.jsonl")
    assert found.identical
    assert 460 < found.ticks <= 662
    assert found.notes == ("The recording was not closed; its last block may be missing.",)


@pytest.mark.medium
def test_a_board_that_is_served_is_recorded(tmp_path, start):
    """Its bytes come between ticks, and Ctrl-C finishes the file."""
    path = tmp_path / "served.jsonl"
    with start("sim", "--port", 0, "--json", "--record", path) as process:
        with bs.connect(json.loads(process.stdout.readline())["device"]) as skin:
            skin.show([8.0] * 7, wait=False)
            skin.sleep(0.3)
        process.send_signal(signal.SIGINT)
        assert process.wait(30.0) == 130
    trace = read(path)
    assert trace.closed
    assert bool(any(call.kind == LOOK and call.link for call in trace.calls()))
    assert bs.replay(path).identical


@given(st.data())
def test_wherever_it_is_cut_the_blocks_before_are_read(trouble, tmp_path_factory, data):
    whole = trouble.read_bytes()
    lines = whole.splitlines(keepends=True)
    at = data.draw(st.integers(len(lines[0]), len(whole) - 1))
    path = tmp_path_factory.getbasetemp() / "cut.jsonl"
    path.write_bytes(whole[:at])
    trace = read(path)
    blocks = whole[:at].count(b"\n") - 1
    assert not trace.closed
    assert len(trace.blocks) == blocks
    assert trace.ticks == sum(call.kind == TICK for call in trace.calls())


@given(st.data())
def test_a_byte_that_has_changed_is_told_or_harmless(trouble, tmp_path_factory, data):
    """Never another exception; and what is read at all is what was written, but for words of its first line."""
    whole = bytearray(trouble.read_bytes())
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.getbasetemp() / "changed.jsonl"
    path.write_bytes(whole)
    try:
        trace = read(path)
    except bs.InvalidInput:
        return
    whole_before = read(trouble)
    if at > trouble.read_bytes().index(b"\n"):
        assert list(trace.calls()) == list(whole_before.calls())[: sum(1 for _ in trace.calls())]


def changed(lines, number, **values):
    """The lines with other values in one of them."""
    tree = json.loads(lines[number]) | values
    return b"\n".join([*lines[:number], json.dumps(tree).encode(), *lines[number + 1 :]]) + b"\n"


def test_files_that_are_none_are_told_by_place(trouble, tmp_path, command):
    lines = trouble.read_bytes().splitlines()
    first = json.loads(lines[1])
    bomb = base64.b64encode(zlib.compress(bytes(50_000_000))).decode()
    for content, said in (
        (b"", "is no full recording"),
        (b"time_s,mode\n0,idle\n", "is no full recording"),
        (b"[1]\n", "is no full recording"),
        (b"\xff\xfe\0\n", "is no full recording"),
        (changed(lines, 0, format=2), "has the format 2; this bubbleskin reads 1"),
        (changed(lines, 0, board=5), "board"),
        (changed(lines, 0, bubbles=0), "bubbles"),
        (changed(lines, 0, bubbles=8), "line 2: the block does not hold what it says"),
        (changed(lines, 0, board="wristband9"), "the board 'wristband9', which is not one of ours"),
        (changed(lines, 0, flash_bytes=5), "whole sectors"),
        (changed(lines, 0, flash_bytes=8192), "flash cannot be unpacked"),
        (changed(lines, 0, flash="AAAA"), "flash cannot be unpacked"),
        (changed(lines, 0, boot_id=-1), "boot_id"),
        (changed(lines, 1, data="%%%"), "line 2 cannot be unpacked"),
        (changed(lines, 1, data=bomb), "line 2 cannot be unpacked"),
        (changed(lines, 1, calls=first["calls"] + 1), "line 2"),
        (changed(lines, 1, calls=10**9), "line 2: calls"),
        (changed(lines, 1, tick="0"), "line 2: tick"),
        (b"\n".join([lines[0], *lines[2:]]) + b"\n", "line 2: the block begins after 2 ticks, and 0 have been"),
        (b"\n".join([*lines, lines[1]]) + b"\n", "the recording ends in the line before"),
        (b"\n".join([*lines[:3], b"{}"]) + b"\n", "line 4: this is no block"),
        (b"\n".join([*lines[:3], b"nonsense"]) + b"\n", "line 4 is not JSON"),
        (b"\n".join([*lines[:2], b'{"end":9999}']) + b"\n", "has 9999 ticks and has 2"),
    ):
        path = tmp_path / "wrong.jsonl"
        path.write_bytes(content)
        status, out, err = command("replay", path)
        assert (status, out, err.count("\n")) == (2, "", 1), err
        assert said in err


def test_a_recording_of_another_firmware_says_so(trouble, tmp_path):
    path = tmp_path / "old.jsonl"
    path.write_bytes(
        changed(trouble.read_bytes().splitlines(), 0, firmware="0.0.9", firmware_sha256="0" * 64, board_crc=1)
    )
    found = bs.replay(path)
    assert found.identical
    assert found.notes == (
        "The firmware that was recorded, 0.0.9, is another than this.",
        "The data of wristband7 are others than those that were recorded.",
    )
