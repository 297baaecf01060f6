"""Telemetry: chosen fields, losses counted, recordings that pandas reads, and the skin's clock."""

import asyncio
import os
import signal
import subprocess
import sys
import textwrap
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import bubbleskin as bs
from bubbleskin.errors import InvalidInput
from bubbleskin.link.message import Message
from bubbleskin.link.telemetry_queue import TelemetryQueue
from bubbleskin.telemetry.fields import NAMES, mask
from bubbleskin.telemetry.recording import Table


@pytest.fixture
def skin():
    with bs.connect("sim://wristband7?seed=1") as skin:
        yield skin


def states(skin, count, *args, **kwargs):
    found = []
    for state in skin.telemetry(*args, **kwargs):
        found.append(state)
        if len(found) == count:
            break
    return found


def test_chosen_fields_are_there_and_others_are_not(skin):
    apart = np.linspace(6, 9, 7)
    skin.show(apart)
    (*_, state) = states(skin, 5, 100, ["height", "target", "fill", "vent", "setpoint"])
    same = skin.state()
    np.testing.assert_allclose(state.height_mm, same.height_mm, atol=0.05)
    np.testing.assert_allclose(state.target_mm, apart, atol=1e-9)
    np.testing.assert_allclose(state.setpoint_mm, state.target_mm, atol=1e-9)
    assert ((state.fill_ms >= 0) & (state.vent_ms >= 0) & (state.fill_ms <= 5) & (state.vent_ms <= 5)).all()
    assert np.isnan(state.pressure_kpa).all()
    assert set(state.status) == {"unknown"}
    assert state.supply_kpa == pytest.approx(60, abs=3)


def test_chosen_pressure_status_and_faults_are_those_of_the_state(skin):
    skin.show(np.full(7, 9.0))
    skin.simulated.inject("sensor_absent", 3, 1)
    skin.sleep(1.0)
    (state,) = states(skin, 1, 20, ("pressure", "status", "faults"))
    same = skin.state()
    assert state.status == same.status
    assert state.faults == same.faults
    assert state.faults[3]
    np.testing.assert_allclose(np.delete(state.pressure_kpa, 3), np.delete(same.pressure_kpa, 3), atol=0.3)


@pytest.mark.parametrize("fields", [["heigth"], [], "nothing"])
def test_fields_that_there_are_not_are_refused(skin, fields):
    with pytest.raises(InvalidInput, match="field"):
        states(skin, 1, 20, fields)


def test_no_more_fields_than_a_message_has_room_for():
    assert mask(NAMES, 7) == 511
    with pytest.raises(InvalidInput, match="1 to 6"):
        mask(NAMES, 19)


def test_gaps_are_counted_and_a_late_message_of_the_subscription_before_is_not():
    queue = TelemetryQueue()
    heard = []
    queue.listeners.append(lambda message, lost: heard.append(lost))
    queue.begin()
    for sequence in (1, 2, 5, 5 + 0xFFF0, 6, 10):
        queue.append(Message(7, sequence & 0xFFFF, {}, {}))
    assert heard == [0, 0, 2, 2, 2, 5]
    queue.begin()
    queue.append(Message(7, 3, {}, {}))
    assert queue.lost == 2


def test_a_wrapped_sequence_number_is_no_gap():
    queue = TelemetryQueue()
    for sequence in range(1, 70000):
        queue.append(Message(7, sequence & 0xFFFF, {}, {}))
    assert queue.lost == 0


def test_losses_are_told(tapped):
    lose = []

    def change(data):
        return data.replace(data, b"") if lose and lose.pop() else data

    skin, _ = tapped(change=change)
    seen = []
    for state in skin.telemetry(200):
        seen.append(state)
        if len(seen) == 5:
            lose += [True] * 3
        if len(seen) == 10:
            break
    assert [state.lost for state in seen] == [0] * 5 + [3] * 5


# Recordings.


@pytest.mark.medium
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_recording_is_read_by_pandas_in_one_line(skin, tmp_path, suffix):
    path = tmp_path / f"x.{suffix}"
    with skin.record(path, rate_hz=50) as recording:
        skin.show(np.linspace(6, 12, 7), over=0.5)
        skin.sleep(1.0)
    frame = pd.read_csv(path, comment="#") if suffix == "csv" else pd.read_parquet(path)
    assert len(frame) == recording.rows > 60
    assert (recording.lost, frame.lost.max()) == (0, 0)
    np.testing.assert_allclose(np.diff(frame.time_s), 0.02, atol=1e-9)
    np.testing.assert_allclose(frame[[f"height_mm_{b}" for b in range(7)]].iloc[-1], skin.simulated.height_mm, atol=0.3)
    np.testing.assert_allclose(frame[[f"target_mm_{b}" for b in range(7)]].iloc[-1], np.linspace(6, 12, 7))
    assert set(frame.status_2) <= {"moving", "settled", "unsure", "resting"}
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_what_a_state_does_not_tell_leaves_its_columns_empty(skin, tmp_path, suffix):
    unknown = replace(states(skin, 1)[0], sd_mm=np.full(7, np.nan))
    told = replace(unknown, sd_mm=np.full(7, 0.1))
    short = replace(told, supply_kpa=np.nan, pressure_kpa=np.full(7, np.nan), faults=(("leak",), *[()] * 6))
    table = Table(tmp_path / f"x.{suffix}", skin.info, skin.layout, 20)
    for state in (unknown, told, short):
        table.write(state)
    table.close()
    frame = pd.read_csv(table.path, comment="#") if suffix == "csv" else pd.read_parquet(table.path)
    assert len(frame) == 3
    np.testing.assert_array_equal(frame.sd_mm_6, [np.nan, 0.1, 0.1])
    assert frame.supply_kpa.notna().tolist() == [True, True, False]
    assert frame.pressure_kpa_3.notna().tolist() == [True, True, False]
    assert frame.faults_0.iloc[2] == "leak"


def test_a_parquet_file_tells_its_origin(skin, tmp_path):
    skin.record(tmp_path / "x.parquet", seconds=0.2)
    about = pd.read_parquet(tmp_path / "x.parquet").attrs
    assert about["board"] == "wristband7"
    assert about["boot_id"] == f"{skin.info.boot_id:08x}"
    assert about["tables_crc"] == f"{skin.info.tables_crc:08x}"
    np.testing.assert_allclose(about["positions_mm"], skin.layout.positions_mm, atol=1e-6)


def test_a_csv_tells_its_origin(skin, tmp_path):
    skin.record(tmp_path / "x.csv", seconds=0.2)
    head = [line for line in (tmp_path / "x.csv").read_text().splitlines() if line.startswith("#")]
    assert '# board: "wristband7"' in head


def test_seconds_are_device_time_and_the_file_is_whole_at_once(skin, tmp_path):
    recording = skin.record(tmp_path / "x.csv", rate_hz=20, seconds=2.0, fields=["height", "fill"])
    frame = pd.read_csv(tmp_path / "x.csv", comment="#")
    assert len(frame) == recording.rows == 40
    assert "fill_ms_6" in frame
    assert "pressure_kpa_0" not in frame
    assert (frame.supply_kpa > 50).all()
    skin.sleep(1.0)
    assert recording.rows == 40, "it has unsubscribed"


def test_telemetry_and_recording_are_one_at_a_time(skin, tmp_path):
    with skin.record(tmp_path / "x.csv"), pytest.raises(InvalidInput, match="one telemetry"):
        states(skin, 1)
    assert states(skin, 1)


def test_closing_the_skin_finishes_the_recording(tmp_path):
    with bs.connect("sim://wristband7") as skin:
        skin.record(tmp_path / "x.parquet")
        skin.sleep(0.5)
    assert len(pd.read_parquet(tmp_path / "x.parquet")) == 10


def test_an_empty_recording_is_a_file(skin, tmp_path):
    with skin.record(tmp_path / "x.parquet"):
        pass
    assert len(pd.read_parquet(tmp_path / "x.parquet")) == 0


@pytest.mark.parametrize(("name", "why"), [("x.txt", "end it in"), ("no/x.csv", "cannot be written")])
def test_a_file_that_cannot_be_is_refused_before_anything_is_asked(skin, tmp_path, name, why):
    with pytest.raises(InvalidInput, match=why):
        skin.record(tmp_path / name)
    assert states(skin, 1)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a full disk is simulated by Linux")  # noqa: PTH110
def test_a_full_disk_does_not_hit_the_script_but_is_told_at_the_end(skin, tmp_path):
    (tmp_path / "x.csv").symlink_to("/dev/full")
    recording = skin.record(tmp_path / "x.csv")
    skin.show(np.full(7, 8.0))
    with pytest.raises(InvalidInput, match="ends after 0 rows"):
        recording.close()


def test_recording_in_asyncio(tmp_path):
    async def main():
        async with await bs.aconnect("sim://wristband7") as skin:
            async with await skin.record(tmp_path / "x.csv", rate_hz=40):
                await skin.show(np.full(7, 8.0))
            assert (await skin.synchronise()).pings >= 20

    asyncio.run(main())
    assert len(pd.read_csv(tmp_path / "x.csv", comment="#")) >= 3


@pytest.mark.slow
def test_a_killed_program_leaves_a_readable_file(tmp_path):
    program = textwrap.dedent(
        """
        import sys, bubbleskin as bs
        with bs.connect("sim://wristband7") as skin, skin.record(sys.argv[1] + "/x.parquet"):
            skin.sleep(2.0)
            print("recorded", flush=True)
            skin.sleep(1e9)
        """
    )
    child = subprocess.Popen([sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE)
    assert child.stdout
    assert child.stdout.readline() == b"recorded\n"
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    child.stdout.close()
    lines = (tmp_path / "x.partial.csv").read_text().rsplit("\n", 1)[0]
    (tmp_path / "whole.csv").write_text(lines + "\n")
    assert len(pd.read_csv(tmp_path / "whole.csv", comment="#")) >= 40


# The clock.


@pytest.mark.medium
def test_the_clock_of_a_simulated_wristband(skin):
    skin.sleep(1.234)
    clock = skin.clock
    truth = skin.simulated.time
    assert abs(clock.now() - truth) <= clock.uncertainty
    assert clock.uncertainty < 2.6e-3, "time stands still within a tick of 5 ms, so more cannot be known"
    assert clock.pings >= 10, "those that keep the link alive"
    skin.sleep(5.0)
    assert skin.clock is clock
    assert abs(clock.now() - skin.simulated.time) <= clock.uncertainty
