"""Device time goes on from 0 after 2^30 ticks: whatever is under way goes on as if nothing had happened, on all interpreters."""

import zlib
from array import array

import numpy as np
import pytest

import bubble_firmware.control.state_layout as layout
from bubble_firmware import boards
from bubble_firmware.device_clock import LATEST, ticks_add, ticks_diff
from bubble_protocol import steps
from bubble_protocol.schema import errors, messages, modes, sequences
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.link import message as wire
from bubbleskin.link.reader import Reader
from bubbleskin.sim import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware
from bubbleskin.sim.micropython import MicroPythonFirmware

BOARD = boards.load("wristband7")
BOOT_ID = 3
SESSION = 5
KEY = wire.session_key(BOOT_ID, SESSION)
TICKS = 900
START = 60  # ticks after boot


def test_differences_of_ticks_are_right_across_the_end_and_stay_small():
    for earlier in (0, 1, LATEST // 2, LATEST // 2 + 1, LATEST - 1, LATEST):
        for periods in (0, 1, 1000, LATEST // 2):
            later = ticks_add(earlier, periods)
            assert later == (earlier + periods) % (LATEST + 1)
            assert ticks_diff(later, earlier) == periods
            assert ticks_diff(earlier, later) == -periods
            assert ticks_add(later, -periods) == earlier
    assert ticks_add(-1, 1) == 0


def requests(before):
    """{tick: bytes of the link} for a firmware whose device time was `before` at boot: a sequence that starts at a tick."""
    blank = [0] * (BOARD.BUBBLES + 2)

    def record(until, ramp, wait, tolerance, *targets):
        return [steps.flags(steps.SMOOTH, until, steps.GO_ON), ramp, wait, tolerance, *targets * BOARD.BUBBLES]

    records = [
        record(steps.TIME, 173, 31, 0, 9000),
        [steps.REPEAT, 2, *blank],
        record(steps.TIME, 90, 60, 0, 11000),
        record(steps.SETTLE, 300, 700, 200, 7000),
        [steps.END, 0, *blank],
        record(steps.TIME, 250, 40, 0, 10000),
    ]
    number = 0
    found = {0: wire.encode("HELLO", 1, (PROTOCOL_MIN, PROTOCOL_MAX, SESSION))}

    def ask(tick, name, fixed=(), repeated=()):
        nonlocal number
        number += 1
        found[tick] = found.get(tick, b"") + wire.encode(name, number, fixed, repeated, KEY)

    ask(2, "SEQUENCE_BEGIN", (1, BOARD.BUBBLES, 0, len(records), zlib.crc32(np.array(records, "<u2").tobytes())))
    ask(4, "SEQUENCE_WRITE", (1, 0), [(word,) for one in records for word in one])
    ask(6, "SEQUENCE_ARM", (1,))
    ask(8, "SEQUENCE_START", (1, ticks_add(before, START)))
    ask(120, "SEQUENCE_CONTROL", (1, sequences.PAUSE))
    ask(150, "SEQUENCE_CONTROL", (1, sequences.RESUME))
    for tick in range(0, TICKS, 20):
        found[tick] = found.get(tick, b"") + wire.encode("PING", 7, (0,), (), KEY)
    return found


class Recorder:
    """A firmware that keeps the counts that it is given."""

    def __init__(self, firmware):
        self.firmware = firmware
        self.counts = []

    def tick(self, counts, link):
        self.counts.append(array("H", counts))
        return self.firmware.tick(counts, link)


@pytest.fixture(scope="module")
def counts():
    """What the sensors say while the sequence is played by a firmware that has just booted."""
    board = SimulatedBoard(seed=4)
    board.firmware = recorder = Recorder(InProcessFirmware(BOARD, BOOT_ID))
    link = requests(-1)
    for tick in range(TICKS):
        board.to_device += link.get(tick, b"")
        board.tick()
    return recorder.counts


def play(firmware, counts, before):
    """Pulses, pump and dump of every tick, and the messages, their times counted from boot."""
    link = requests(before)
    reader = Reader(KEY)
    decided, told = [], []
    try:
        for tick in range(TICKS):
            outputs = firmware.tick(counts[tick], link.get(tick, b""))
            decided.append((list(outputs.pulses), outputs.pump, outputs.dump))
            for message in reader.feed(outputs.link):
                assert message.id != messages.ERROR
                if message.id == messages.SEQUENCE_EVENT:
                    told.append((message["event"], message["reason"], ticks_diff(message["ticks"], before)))
    finally:
        firmware.close()
    return decided, told


ENDS = [0, 1, START - 2, START, START + 1, START + 20, 100, 120, 130, 150, 200, 300, 400, 500]


def assert_the_same(one, other):
    assert one[1] == other[1]
    assert one[1][-1][:2] == (sequences.SEQUENCE_ENDED, sequences.COMPLETE)
    for tick, pair in enumerate(zip(one[0], other[0], strict=True)):
        assert pair[0] == pair[1], tick


@pytest.mark.promise("time-wraps")
@pytest.mark.parametrize("left", ENDS)
def test_a_sequence_goes_on_across_the_end_of_device_time(counts, left):
    """`left` ticks after boot device time ends: before the start, in it, in ramps, waits and a pause."""
    ever = play(InProcessFirmware(BOARD, BOOT_ID), counts, -1)
    before = LATEST - left
    assert_the_same(ever, play(InProcessFirmware(BOARD, BOOT_ID, boot_ticks=before), counts, before))


@pytest.mark.promise("time-wraps")
@pytest.mark.medium
@pytest.mark.usefixtures("micropython")  # to be skipped or to fail where there is none
@pytest.mark.parametrize("left", [0, START, 130, 300])
def test_so_it_does_on_micropython(counts, left):
    ever = play(InProcessFirmware(BOARD, BOOT_ID), counts, -1)
    before = LATEST - left
    assert_the_same(ever, play(MicroPythonFirmware(BOARD, BOOT_ID, boot_ticks=before), counts, before))


@pytest.mark.parametrize("left", [3, 4, 5, 6, 50])
def test_a_start_is_soonest_or_late_across_the_end_of_device_time(seven, left):
    clock = seven.rig.app.clock
    clock.ticks = LATEST - left
    seven.load(seven.all(9000, after=50))
    while clock.ticks != LATEST and left < 50:
        seven.tick()
    error, *_ = seven.refusal("SEQUENCE_START", seven.id, LATEST - 1 if left < 50 else LATEST - 50)
    assert error == errors.TOO_LATE
    at = seven.start()
    assert ticks_diff(at, clock.ticks) in (0, 1)
    seven.tick(3)
    assert seven.rig.app.safety.mode == modes.ACTIVE
    seven.until_ended(200)


@pytest.mark.promise("time-wraps")
@pytest.mark.parametrize("left", [0, 1, 5, 100])
def test_an_isolation_lasts_as_long_across_the_end_of_device_time(rig7, left):
    rig7.tick(5)
    rig7.app.clock.ticks = LATEST - left
    rig7.hal.counts[0] = 0
    rig7.tick(3)
    rig7.sense(0, 0)
    ticks = 3
    rig7.ask("CLEAR")
    while rig7.app.bubbles.faults(0):
        rig7.tick()
        ticks += 1
    assert abs(ticks * rig7.board.TICK_US - 1_000_000) <= 3 * rig7.board.TICK_US


def test_an_isolation_of_months_is_over_when_it_is_acknowledged(rig7):
    rig7.tick(5)
    rig7.hal.counts[0] = 0
    rig7.tick(3)
    rig7.sense(0, 0)
    rig7.app.clock.ticks = LATEST // 4 * 3
    assert rig7.ask("CLEAR")["isolated_ms"] == 0
    assert not rig7.app.bubbles.faults(0)


def held(left):
    """Pulses of leaking bubbles that are held for 3 s, where control's own count of ticks ends `left` ticks after boot."""
    firmware = InProcessFirmware(BOARD, BOOT_ID)
    bubbles = firmware.app.bubbles
    bubbles.state[layout.TICK] = before = LATEST - left
    for bubble in range(BOARD.BUBBLES):
        for word in (layout.REFERENCE_TICK, layout.LEAK_TICK):
            bubbles.rows[bubble * layout.ROW_WORDS + word] = before
        bubbles.rows[bubble * layout.ROW_WORDS + layout.LEAK_RATE] = 800
    board = SimulatedBoard(seed=4, firmware=firmware, contact=False, rubber="real", leak=0.01)
    decided = []
    for tick in range(3_000_000 // BOARD.TICK_US):
        if tick == 20:
            firmware.app.commands.show(array("i", range(7000, 10500, 500)), 0, 1)
        firmware.app.deadman.host_activity()
        board.tick()
        decided.append(list(bubbles.pulses))
        assert bubbles.state[layout.TICK] <= LATEST, "no interpreter's words are left"
    return decided


@pytest.mark.promise("time-wraps")
@pytest.mark.parametrize("left", [0, 100, 300, 500])
def test_heights_are_held_across_the_end_of_controls_time(left):
    assert held(left) == held(LATEST // 2)
