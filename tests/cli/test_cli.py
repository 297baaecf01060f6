"""The command as its user meets it: what it prints, its exit statuses, one line for every mistake."""

import json
import os
import pty
import signal
import subprocess
import sys
import tty

import pytest

import bubbleskin as bs
from bubbleskin.cli.command import main

SIM = ["--device", "sim://wristband7"]


@pytest.fixture
def run(command):
    """The command, as tests here call it."""
    return command


def assert_one_sentence(outcome, status, *words):
    code, out, err = outcome
    assert code == status, err
    assert not out
    assert err.count("\n") == 1
    assert err.endswith(".\n")
    assert "Traceback" not in err
    for word in words:
        assert word in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["show", "8", "9", *SIM], ["2 heights", "7 bubbles"]),
        (["show", *["8"] * 6, "-3", *SIM], ["bubble 6", "negative", "14 mm"]),
        (["show", *["8"] * 6, "nan", *SIM], ["bubble 6", "not a number"]),
        (["show", *["8"] * 6, "15", *SIM], ["bubble 6", "above the limit of 14 mm"]),
        (["show", *["8"] * 6, "high", *SIM], ["'high'", "not a height"]),
        (["show", "dome", *SIM], ["--shape dome"]),
        (["show", "face.npy", *SIM], ["--file face.npy"]),
        (["show", *SIM], ["one way"]),
        (["show", "--all", "8", "--shape", "dome", *SIM], ["one way"]),
        (["show", "--all", "8", "--over", "-1", *SIM], ["--over is -1"]),
        (["show", "--shape", "cube", *SIM], ["cube", "dome"]),
        (["show", "--file", "nowhere.csv", *SIM], ["nowhere.csv"]),
        (["info", "--device", "sim://wristband8"], ["wristband8", "wristband7"]),
        (["info", "--device", "sim://wristband7?speed=3"], ["speed", "realtime"]),
        (["info", "--device", "sim://wristband7?seed=x"], ["seed of sim://wristband7 is 'x'"]),
        (["info", "--device", ""], ["empty"]),
        (["monitor", "--rate", "0", *SIM], ["rate_hz is 0"]),
        (["monitor", "--rate", "nan", *SIM], ["--rate is nan"]),
        (["sim", "--spread", "2"], ["spread is 2"]),
        (["sim", "--plant", "nowhere.toml"], ["nowhere.toml"]),
        (["sim", "--rubber", "wood"], ["wood", "real"]),
        (["sim", "--port", "70000"], ["70000"]),
        (["dance"], ["dance", "--help"]),
        (["bench", "everything"], ["everything"]),
    ],
)
def test_a_users_mistake_is_one_sentence_and_status_2(run, arguments, words):
    assert_one_sentence(run(*arguments), 2, *words)


@pytest.mark.parametrize(
    ("device", "words"),
    [("/dev/no-such-port", ["There is no", "sim://"]), ("socket://127.0.0.1:9", ["Nothing listens"])],
)
def test_a_devices_failure_is_one_sentence_and_status_1(run, device, words):
    assert_one_sentence(run("info", "--device", device), 1, *words)


@pytest.mark.medium
def test_what_is_no_wristband_is_named_as_such(run):
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    try:
        assert_one_sentence(run("info", "--device", os.ttyname(theirs)), 1, "does not answer as a wristband")
    finally:
        os.close(ours)
        os.close(theirs)


def test_info_for_scripts(run):
    status, out, _ = run("info", "--json", *SIM)
    facts = json.loads(out)
    assert status == 0
    assert facts["board"] == "wristband7"
    assert facts["bubbles"] == 7
    assert facts["faults"] == {}


def test_the_device_may_come_from_the_environment(run, monkeypatch):
    monkeypatch.setenv("BUBBLESKIN_DEVICE", "sim://wristband19")
    status, out, _ = run("info", "--json")
    assert status == 0
    assert json.loads(out)["bubbles"] == 19


def test_show_reaches_what_it_says(run, tmp_path):
    field = tmp_path / "field.csv"
    field.write_text("6,10\n6,10\n")
    for how in (
        ["--all", "9.5"],
        ["--shape", "plane"],
        ["--file", str(field)],
        ["6", "6", "6", "10", "10", "10", "12"],
    ):
        status, out, err = run("show", *how, "--json", *SIM)
        assert status == 0, err
        shape = json.loads(out)
        assert max(abs(a - b) for a, b in zip(shape["height_mm"], shape["target_mm"], strict=True)) < 0.2


def test_monitor_prints_a_line_for_each_state(run):
    status, out, _ = run("monitor", "--rate", "50", "--seconds", "0.5", "--json", *SIM)
    states = [json.loads(line) for line in out.splitlines()]
    assert status == 0
    assert len(states) == 26
    assert states[-1]["time"] - states[0]["time"] == pytest.approx(0.5)


@pytest.mark.slow
def test_demo_prints_heights_and_draws(run, tmp_path):
    picture = tmp_path / "demo.png"
    status, out, _ = run("demo", "--output", str(picture))
    assert status == 0
    assert "dome" in out
    assert "tilted plane" in out
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_sim_serves_other_programs_until_it_is_interrupted(start):
    with start("sim", "--json", "--port", 0) as server:
        try:
            device = json.loads(server.stdout.readline())["device"]
            show = [sys.executable, "-m", "bubbleskin", "show", "--shape", "dome", "--device", device]
            shown = subprocess.run(show, capture_output=True, text=True, timeout=60, check=False)
            assert shown.returncode == 0, shown.stderr
        finally:
            server.send_signal(signal.SIGINT)
            _, err = server.communicate(timeout=20)
    assert server.returncode == 130
    assert err.strip() == "Stopped."


@pytest.mark.medium
def test_tables_go_to_the_wristband_and_come_back(run, tmp_path):
    theirs, ours, mixed = (str(tmp_path / name) for name in ("theirs.toml", "ours.toml", "mixed.toml"))
    assert run("table", "--preset", "paper", "--mu-kpa", "45", "-o", ours, "--upload", *SIM)[0] == 0
    assert run("table", "--from-device", "-o", theirs, *SIM)[0] == 0  # a new simulation: the nominal tables
    status, out, _ = run("table", "--show", theirs, "--compare", ours)
    assert status == 1
    assert "bubble 6" in out
    assert_one_sentence(run("table", "--show", theirs, "--from-device", *SIM), 2, "one place")
    wrong = run("table", "--board", "wristband19", "--bubbles", "19", "-o", mixed, "--upload", *SIM)
    assert wrong[0] == 2
    assert "this is a wristband7" in wrong[2]


@pytest.mark.medium
def test_tables_that_look_wrong_are_uploaded_anyway(run, tmp_path):
    odd = str(tmp_path / "odd.toml")
    straight = bs.Table([5000, 14000], [0, 36000])
    bs.Calibration("wristband7", (straight,) * 7).save(odd)
    status, _, said = run("table", "--show", odd, "--upload", *SIM)
    assert (status, said.count("\n")) == (2, 1)
    assert "not one of rubber" in said
    assert "--anyway" in said
    assert run("table", "--show", odd, "--upload", "--anyway", *SIM)[0] == 0
    assert_one_sentence(run("table", "--show", odd, "--anyway", *SIM), 2, "--anyway goes with --upload")


# Sequences.


def test_play_says_what_it_played(run):
    code, out, err = run("play", "pulse", "--loops", "1", *SIM)
    assert code == 0, err
    assert "Played pulse: 8 steps in 3.900 s" in out


def test_play_takes_files_and_prints_json(run, tmp_path):
    path = tmp_path / "line.csv"
    path.write_text("time_s,b0,b1,b2,b3,b4,b5,b6\n0,6,6,6,6,6,6,6\n0.5,9,9,9,9,9,9,9\n", encoding="utf-8")
    code, out, err = run("play", str(path), "--json", "--loops", "2", *SIM)
    assert code == 0, err
    played = json.loads(out)
    assert played["steps"] == [0, 1, 0, 1]
    assert played["ended"] - played["began"][0] == pytest.approx(2.0)
    assert played["timeouts"] == []


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (["nothing"], ["'nothing'", "pulse", "flat-twin"]),
        (["nowhere.json"], ["nowhere.json", "Cannot read"]),
        (["pulse", "--loops", "-1"], ["--loops is -1"]),
        (["pulse", "--at", "nan"], ["at is nan"]),
    ],
)
def test_what_cannot_be_played_is_one_sentence(run, what, words):
    assert_one_sentence(run("play", *what, *SIM), 2, *words)


def test_a_start_that_has_passed_is_the_devices_refusal(run):
    assert_one_sentence(run("play", "pulse", "--at", "0.01", *SIM), 1, "has passed")


def test_ctrl_c_stops_and_vents(run, monkeypatch):
    skins = []

    def interrupted(skin, *arguments, **named):
        skins.append(skin)
        skin.show([9.0] * 7)
        raise KeyboardInterrupt

    done = []
    monkeypatch.setattr("bubbleskin.skin.Skin.play", interrupted)
    monkeypatch.setattr("bubbleskin.skin.Skin.stop", lambda skin: done.append("stop"))
    monkeypatch.setattr("bubbleskin.skin.Skin.vent", lambda skin: done.append("vent"))
    code, _, err = run("play", "pulse", *SIM)
    assert (code, err.strip()) == (130, "Stopped.")
    assert done == ["stop", "vent"]


def test_monitor_records_what_it_shows(tmp_path, capsys):
    path = tmp_path / "x.csv"
    with pytest.raises(SystemExit) as ended:
        main(["monitor", "--device", "sim://wristband7", "--seconds", "0.5", "--record", str(path)])
    assert ended.value.code == 0
    out = capsys.readouterr().out
    assert "11 states are in" in out
    assert "0 lost" in out
    rows = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    assert len(rows) == 12
    assert rows[0].startswith("time_s,mode,lost,supply_kpa,board_faults,height_mm_0")


@pytest.mark.slow
def test_a_real_board_fails_only_with_permission_and_is_well_afterwards(run, start):
    """One that is served: nobody who opens it knows that it is simulated."""
    with start("sim", "--json", "--port", 0) as server:
        try:
            device = json.loads(server.stdout.readline())["device"]
            assert_one_sentence(
                run("inject", "sensor", "3", "missing", "--device", device), 2, "--permit", "nobody wears it"
            )
            stuck = run("inject", "fill", "3", "stuck", "--device", device, "--permit")
            assert_one_sentence(stuck, 2, "cannot make a fill valve stuck")
            with bs.connect(device) as skin:
                assert (skin.state().mode, skin.state().target_mm.max()) == ("idle", 5.0), "nothing has moved for that"
            for words, name in (("sensor 3 missing", "sensor_lost"), ("supply missing", "supply_lost")):
                options = ["--device", device, "--permit", "--json", "--seconds", "1"]
                status, out, err = run("inject", *words.split(), *options)
                assert status == 0, err
                assert {each["name"] for each in json.loads(out)["found"]} == {name}, "and nothing of before"
            with bs.connect(device) as skin:
                assert skin.faults() == {}
                assert skin.health().board_faults == ()
        finally:
            server.send_signal(signal.SIGINT)
            server.communicate(timeout=20)
