"""A full recording replays identical on every interpreter, and a change is named at its tick."""

import json
import shutil
from array import array
from pathlib import Path

import pytest

import bubble_firmware
import bubble_protocol
import bubbleskin as bs
from bubble_protocol.schema import messages
from bubbleskin import boards
from bubbleskin.link.message import encode, session_key
from bubbleskin.replays.compare import NOT_COMPARED, Decided, first_difference
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware
from bubbleskin.sim.micropython import MicroPythonFirmware
from bubbleskin.sim.trace_file import LOOK, LOOP, POWER_FAILED, TICK, Call, read
from bubbleskin.sim.wiring import Wiring

ALL = "sim://wristband7?seed=2&spread=0.1&loss=0.03"


@pytest.fixture
def other_version(tmp_path):
    """`other_version(file, old, new)`: a checkout whose firmware has `new` in place of `old`."""

    def make(name, old, new):
        for package in (bubble_protocol, bubble_firmware):
            top = Path(package.__path__[0])
            room = tmp_path / ("protocol" if package is bubble_protocol else "firmware")
            shutil.copytree(top, room / top.name, ignore=shutil.ignore_patterns("__pycache__"))
        file = tmp_path / "firmware" / "bubble_firmware" / name
        text = file.read_text(encoding="utf-8")
        assert old in text
        file.write_text(text.replace(old, new), encoding="utf-8")
        return tmp_path

    return make


def test_it_is_identical_here(trouble):
    """It holds power that fails, a restart and a fault, or this would say little."""
    told = []
    found = bs.replay(trouble, progress=lambda done, all_: told.append((done, all_)))
    assert found.identical, str(found)
    assert (found.resets, found.notes) == (1, ())
    assert "ticks with 1 power failure, " in str(found)
    assert found.ticks == read(trouble).ticks > 500
    assert told[-1] == (found.ticks, found.ticks)
    assert bool(any(call.kind == POWER_FAILED and call.sent for call in read(trouble).calls()))


@pytest.mark.medium
@pytest.mark.usefixtures("micropython")
@pytest.mark.parametrize(
    "url", [ALL, "sim://wristband19?seed=1&loss=0.03&contact=0", "micropython://wristband7?seed=4&loss=0.03"]
)
def test_it_is_identical_on_both_interpreters(recorded, url):
    """A recording on MicroPython says how large flash was there, or `stored()` would be told otherwise here."""
    for on in ("cpython", "micropython"):
        found = bs.replay(recorded(url), on)
        assert found.identical, str(found)


@pytest.mark.slow
@pytest.mark.usefixtures("micropython")
def test_sixty_seconds_are_identical_on_both_interpreters(recorded):
    path = recorded(ALL, 60.0)
    for on in ("cpython", "micropython"):
        found = bs.replay(path, on)
        assert found.identical, str(found)
        assert found.duration_s >= 60.0


@pytest.mark.chip
def test_it_is_identical_on_the_chip(tmp_path):
    path = tmp_path / "trouble.jsonl"
    with bs.connect("sim://wristband7?seed=2&spread=0.1") as skin, skin.record(path, full=True):
        skin.health()
        skin.show([9.0] * 7, wait=False)
        skin.sleep(0.2)
        skin.vent()
        skin.sleep(0.3)
        skin.save()
        skin.simulated.reset()
        with pytest.raises(bs.DeviceRestarted):
            skin.state()
        skin.restart()
        skin.stored()
    found = bs.replay(path, "rp2040")
    assert found.identical, str(found)
    assert found.resets == 1


@pytest.mark.medium
def test_a_change_of_one_tick_is_named_at_its_tick(trouble, other_version, command):
    """A valve that is open for 1 µs more, in one tick."""
    guilty = "        if self.clock.ticks == 333:\n            bubbles.pulses[6] += 1\n"
    place = "        monitor.block_backflow(supply.pressure_pa)\n"
    folder = other_version("app.py", place, place + guilty)
    found = bs.replay(trouble, firmware=folder)
    assert not found.identical
    assert (found.difference.tick, found.difference.what) == (333, "fill valve of bubble 3 (µs)")
    assert found.difference.time_s == pytest.approx(1.665)
    assert found.difference.replayed == found.difference.recorded + 1
    assert str(folder) in found.notes[0]
    status, out, _ = command("replay", trouble, "--firmware", folder)
    assert status == 1
    assert "differs on cpython at tick 333 (1.665 s): fill valve of bubble 3" in out


@pytest.mark.medium
@pytest.mark.usefixtures("micropython")
def test_a_change_that_shows_only_in_a_message_is_named_with_its_field(trouble, other_version):
    folder = other_version("tick_stats.py", "self.exceptions = 0", "self.exceptions = 7")
    found = bs.replay(trouble, "micropython", firmware=folder)
    assert found.difference.what == "INFO_REPLY.exceptions"
    assert (found.difference.recorded, found.difference.replayed) == (0, 7)


@pytest.mark.medium
def test_another_version_that_decides_the_same_is_identical(trouble, other_version):
    """Free heap and version numbers are not what it decides."""
    folder = other_version("../../protocol/bubble_protocol/version.py", "FIRMWARE = (0, 1, 0)", "FIRMWARE = (0, 2, 0)")
    found = bs.replay(trouble, firmware=folder)
    assert found.identical, str(found)


def test_a_firmware_that_does_not_start_is_told(trouble, other_version):
    folder = other_version("app.py", "class App:", "class App(Nothing):")
    with pytest.raises(bs.LinkError, match=r"The firmware that replays has ended .*Nothing"):
        bs.replay(trouble, firmware=folder)


KEY = session_key(1, 1)
SENT = encode("SHOW_REPLY", 5, (70,), (), KEY) + encode("INFO_REPLY", 6, (0,) * 17, (), KEY)
CALL = Call(TICK, 0, b"", b"", (0, 5000, 1200, 0), 300, False, SENT)
SAME = Decided(*CALL[4:])


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({}, None),
        ({"pulses": (0, 65535, 1200, 0)}, None),  # open throughout
        ({"pulses": (0, 5000, 1201, 0)}, ("fill valve of bubble 1 (µs)", 1200, 1201)),
        ({"pulses": (0, 4999, 1200, 0), "pump": 0}, ("vent valve of bubble 0 (µs)", 5000, 4999)),
        ({"pump": 301}, ("pump (of 65535)", 300, 301)),
        ({"dump": True}, ("dump valve", False, True)),
        (
            {"sent": SENT.replace(encode("SHOW_REPLY", 5, (70,), (), KEY), b"")},
            ("message sent", "SHOW_REPLY 5", "INFO_REPLY 6"),
        ),
        ({"sent": SENT + SENT[: SENT.index(0) + 1]}, ("message sent", "none", "SHOW_REPLY 5")),
        ({"sent": SENT.replace(b"F", b"G")}, ("SHOW_REPLY.ticks", 70, 71)),
    ],
)
def test_what_differs_is_named(changed, found):
    assert first_difference(CALL, SAME._replace(**changed), 5000) == found


def test_what_an_interpreter_says_of_itself_is_no_difference():
    assert (messages.INFO | messages.REPLY, "heap_free") in NOT_COMPARED
    info = [0] * 17
    info[7] = 4711
    sent = SENT[: SENT.index(0) + 1] + encode("INFO_REPLY", 6, info, (), KEY)
    assert first_difference(CALL, SAME._replace(sent=sent), 5000) is None
    info[6] = 1
    sent = SENT[: SENT.index(0) + 1] + encode("INFO_REPLY", 6, info, (), KEY)
    assert first_difference(CALL, SAME._replace(sent=sent), 5000) == ("INFO_REPLY.telemetry_dropped", 0, 1)


def test_repeated_fields_crcs_and_noise_are_named():
    def difference(one, other):
        return first_difference(CALL._replace(sent=one), SAME._replace(sent=other), 5000)

    rows = [(160, 17, 1000, 0)] * 3
    other = [*rows[:2], (160, 18, 1000, 0)]
    what, before, now = difference(encode("TRIM_READ_REPLY", 1, (), rows), encode("TRIM_READ_REPLY", 1, (), other))
    assert what.startswith("TRIM_READ_REPLY.")
    assert what.endswith("[2]")
    assert (before, now) == (17, 18)
    keyed = encode("SHOW_REPLY", 5, (70,), (), session_key(1, 2))
    assert difference(encode("SHOW_REPLY", 5, (70,), (), KEY), keyed)[0].startswith("byte ")
    assert difference(b"\x02\x7e\0", b"\x02\x7d\0") == ("message sent", "bytes 027e", "bytes 027d")


def test_flash_is_compared_when_power_fails():
    call = Call(POWER_FAILED, 0, b"", b"", (), 0, False, b"\1\2\3\4")
    assert first_difference(call, Decided((), 0, False, b""), 5000) is None  # not seen there
    assert first_difference(call, Decided((), 0, False, b"\1\2\3\5"), 5000) == (
        "CRC-32 of flash",
        "01020304",
        "01020305",
    )


@pytest.mark.medium
@pytest.mark.usefixtures("micropython")
def test_what_has_no_room_in_a_tick_has_none_on_both_interpreters():
    """Many replies asked for again at once are more than a tick can send."""
    data = boards.load("wristband7")
    counts = array("H", [data.SENSOR_ZERO] * 7 + [2550])
    link = encode("HELLO", 1, (2, 2, 1)) + encode("SETTING_READ", 1, (), (), KEY)
    again = encode("SETTING_READ", 1, (), (), KEY)
    both = []
    for firmware in (InProcessFirmware(data, 1), MicroPythonFirmware(data, 1)):
        firmware.tick(counts, link)
        both.append(firmware.tick(counts, again * (256 // len(again))).link)
        firmware.close()
    assert both[0] == both[1]
    assert 512 < len(both[0]) <= 1024


@pytest.mark.medium
@pytest.mark.usefixtures("micropython")
def test_what_stood_in_flash_when_power_came_is_there_again(tmp_path):
    url = f"sim://wristband7?store={tmp_path / 'flash.bin'}"
    with bs.connect(url) as skin:
        skin.configure(rezero_mm=0.7)
        skin.save()
    path = tmp_path / "trouble.jsonl"
    with bs.connect(url) as skin, skin.record(path, full=True):
        assert skin.settings()["rezero_mm"].value == pytest.approx(0.7)
        skin.save()
    for on in ("cpython", "micropython"):
        found = bs.replay(path, on)
        assert found.identical, str(found)


def test_what_is_asked_for_wrongly_is_told(trouble, tmp_path, command):
    for arguments, said in (
        ({"on": "esp32"}, "one of 'cpython', 'micropython', 'rp2040'"),
        ({"firmware": tmp_path}, "has no bubble_protocol"),
        ({"on": "rp2040", "firmware": Path("firmware").parent}, "this version's firmware"),
        ({"board": "wristband19"}, "7 bubbles and ticks of 5000 µs, not of wristband19"),
        ({"board": tmp_path / "nowhere.py"}, "no board file"),
        ({"progress": 5}, "progress"),
        ({"board": 5}, "path of the board is 5"),
        ({"firmware": 5}, "path of the firmware is 5"),
    ):
        with pytest.raises(bs.InvalidInput, match=said):
            bs.replay(trouble, **arguments)
    status, _, err = command("replay", tmp_path / "nothing.jsonl")
    assert (status, err.count("\n")) == (2, 1)
    assert "Cannot read the full recording" in err
    status, out, _ = command("replay", trouble, "--json")
    facts = json.loads(out)
    assert (status, facts["identical"], facts["difference"], facts["board"]) == (0, True, None, "wristband7")


@pytest.mark.medium
def test_a_board_of_ones_own_is_replayed_with_its_file(tmp_path):
    text = Path(boards.load("wristband7").__file__).read_text(encoding="utf-8")
    (tmp_path / "pad.py").write_text(text.replace('"wristband7"', '"pad"'), encoding="utf-8")
    path = tmp_path / "trouble.jsonl"
    with bs.connect(f"sim://{tmp_path / 'pad.py'}") as skin:
        skin.record(path, seconds=0.2, full=True)
    with pytest.raises(bs.InvalidInput, match="'pad', which is not one of ours; give its file"):
        bs.replay(path)
    assert bs.replay(path, board=tmp_path / "pad.py").identical
    (tmp_path / "pad.py").write_text(text.replace('"wristband7"', '"pad"') + "SUPPLY_PA -= 1000\n", encoding="utf-8")
    assert bs.replay(path, board=tmp_path / "pad.py").notes == (
        "The data of pad are others than those that were recorded.",
    )


@pytest.mark.medium
def test_what_comes_between_two_ticks_is_replayed(tmp_path):
    """A board that is served is told of bytes between ticks."""
    board = SimulatedBoard()
    board.keep_history()
    recording = board.record(tmp_path / "served.jsonl")
    for number in range(50):
        board.to_device += encode("HELLO", 1, (2, 2, 1)) if not number else encode("PING", number, (number,), (), KEY)
        board.listen(1000 + number)
        board.tick()
    recording.close()
    calls = list(read(recording.path).calls())
    assert [call.phase_us for call in calls if call.kind == LOOK] == [1000 + number for number in range(50)]
    assert bs.replay(recording.path).identical
    with pytest.raises(bs.InvalidInput, match=r"begins when power comes, and that was 0\.25 s ago"):
        board.keep_history()


def test_an_emergency_stop_is_replayed_where_there_is_a_pin(tmp_path):
    for estop, moves in (("closed", [1, 0]), ("open", [1, 0, 1])):
        board = SimulatedBoard(wiring=Wiring(estop=estop))
        board.keep_history()
        recording = board.record(tmp_path / f"{estop}.jsonl")
        for pressed in (None, 1, 0):
            if pressed is not None:
                board.inject("estop", 0, pressed)
            for _ in range(40):
                board.tick()
        recording.close()
        assert [call.phase_us for call in read(recording.path).calls() if call.kind == LOOP] == moves
        assert bs.replay(recording.path).identical
    with pytest.raises(bs.InvalidInput, match="no pin for an emergency stop"):
        bs.replay(recording.path, firmware=Path(bs.__file__).parents[2])
