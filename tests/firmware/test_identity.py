"""The same readings and the same bytes of the link give the same commands, bit for bit, here and on MicroPython."""

import itertools
import random
import zlib
from array import array

import numpy as np
import pytest

from bubble_firmware import boards
from bubble_firmware.control.nominal import KNOTS
from bubble_protocol import steps
from bubble_protocol.schema import errors, faults, messages, sequences
from bubbleskin.link.message import encode, session_key
from bubbleskin.link.reader import Reader
from bubbleskin.sim import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware
from bubbleskin.sim.micropython import MicroPythonFirmware

BOOT_ID = 0x87654321


class Recorder:
    """A `Firmware` that keeps what another is given and what it decides."""

    def __init__(self, firmware):
        self.firmware = firmware
        self.given = []
        self.decided = []

    def tick(self, counts, link):
        self.given.append((array("H", counts), link))
        self.decided.append(self.firmware.tick(counts, link))
        return self.decided[-1]

    def close(self):
        self.firmware.close()


PONG = messages.PING | messages.REPLY
KEY = session_key(BOOT_ID, 1)
ALIVE = encode("PING", 1, (0,), (), KEY)
"""A host that lives says so."""


class Host:
    """Frames of one session, numbered as they come."""

    def __init__(self):
        self.hello = b"\xff\0" + encode("HELLO", 1, (2, 2, 1))
        self.numbers = itertools.count(1)

    def ask(self, name, fixed=(), repeated=()):
        number = 77 if name == "PING" else next(self.numbers)  # which is outside the order
        return encode(name, number, fixed, repeated, KEY)

    def show(self, over_ms, heights):
        return self.ask("SHOW", (over_ms,), [(height,) for height in heights])


def script(n):
    """(seconds, what the host sends): shapes below, on and above the plateau, quick and slow, and every request but INFO."""
    chance = random.Random(3)

    def shape(low, high):
        return [chance.randrange(low, high) for _ in range(n)]

    snaps_through = [(5000, 0), (7000, 24000), (8000, 23500), (9000, 25000), (14000, 40000)]
    tables = zlib.crc32(
        b"".join(np.array(table, "<u2").tobytes() for table in [KNOTS, snaps_through, *[KNOTS] * (n - 2)])
    )
    host = Host()
    ask = host.ask
    return [
        (0.00, host.hello + ask("SUBSCRIBE", (4,))),
        (0.05, host.show(0, shape(5500, 12500))),
        (1.00, ask("STATE") + ask("PING", (0xFEDCBA98,))),
        (1.20, host.show(500, shape(7000, 9000))),
        (2.40, host.show(0, shape(9000, 14000))),
        (3.20, ask("STOP")),
        (3.70, host.show(0, [5000, *shape(6000, 9500)[1:]])),
        (4.40, b"\x07garbage\x00" + ask("PING", (1,))[:-3]),
        (
            4.50,
            b"\0" + ask("TABLE_WRITE", (1, 0, 5), snaps_through) + ask("TABLE_COMMIT", (123,)),
        ),
        (4.60, ask("TABLE_COMMIT", (tables,)) + ask("TABLE_READ", (1, 0))),
        (4.90, ask("VENT")),
        (5.50, host.show(0, [15000] * n) + host.show(0, [9000] * (n - 1))),
        (5.60, host.show(1000, shape(10000, 14000))),
        (8.00, ask("CLEAR") + host.show(0, shape(5000, 14000))),
        (9.50, host.show(60000, [0] * n)),
    ]


FAULTS = [
    (6.8, "sensor_absent", 2, 1.0),
    (7.2, "sensor_absent", 2, 0.0),
    (7.0, "pop_off", 3, 1.0),
    (7.8, "pop_off", 3, 0.0),
]


@pytest.fixture(params=["wristband7", "wristband19"])
def trace(request):
    """10 s of a wristband whose bubbles differ: the board's data, what came into the firmware and what it decided."""
    board = SimulatedBoard(request.param, seed=BOOT_ID - 1, spread=0.1)
    board.firmware = recorder = Recorder(board.firmware)
    due = [(time, board.to_device.extend, (sent,)) for time, sent in script(board.data.BUBBLES)]
    due += [(time, board.inject, fault) for time, *fault in FAULTS]
    # At the end the host dies.
    due += [(0.1 * k + 0.012, board.to_device.extend, (ALIVE,)) for k in range(85)]
    due.sort(key=lambda entry: entry[0])
    while board.time < 10 - 1e-9:
        while due and board.time >= due[0][0] - 1e-9:
            _, do, arguments = due.pop(0)
            do(*arguments)
        board.tick()
    return board.data, recorder.given, recorder.decided


def replay(firmware, given):
    try:
        return [firmware.tick(array("H", counts), link) for counts, link in given]
    finally:
        firmware.close()


def assert_same(decided, again):
    """Pulses, pump, dump and bytes of the link, tick by tick."""
    for tick, (one, other) in enumerate(zip(decided, again, strict=True)):
        assert one == other, f"tick {tick}"


@pytest.mark.medium
@pytest.mark.usefixtures("micropython")  # to be skipped or to fail where there is none
def test_a_recorded_trace_replays_bit_for_bit(trace):
    data, given, decided = trace
    assert len(given) == 10_000_000 // data.TICK_US
    assert_same(decided, replay(InProcessFirmware(data, BOOT_ID), given))
    assert_same(decided, replay(MicroPythonFirmware(data, BOOT_ID), given))

    # The trace is one that says something: every answer, both kinds of valves on every bubble, faults.
    heard = list(Reader(KEY).feed(b"".join(outputs.link for outputs in decided)))
    telemetry = [message for message in heard if message.id == messages.TELEMETRY]
    answers = [message.sequence for message in heard if message.id not in (messages.TELEMETRY, PONG)]
    assert answers == [1, *range(1, 19)], "HELLO, then every request, each once"
    assert len(telemetry) > 10_000_000 // data.TICK_US // 4 - 5
    pulses = np.array([outputs.pulses for outputs in decided]).reshape(len(decided), -1, 2)
    doses = (pulses > 0) & (pulses < data.TICK_US)
    assert (doses[:, :, 0].sum(axis=0) > 10).all()
    assert doses[:, :, 1].sum() > 100
    assert {message.id for message in heard} >= {messages.TABLE_COMMIT | messages.REPLY, messages.ERROR}
    assert {fault for message in telemetry for fault in message.columns["faults"]} >= {0, faults.SENSOR_LOST}


def hostile(seed, board, ticks):
    """Readings that jump over the whole range, and any table and shape that the firmware takes."""
    chance = random.Random(seed)
    n = board.BUBBLES
    tables = [list(KNOTS)] * n
    host = Host()
    ask = host.ask
    for tick in range(ticks):
        calm = tick < 2 * ticks // 3  # nothing stands that would have the whole board vented
        if tick % 20 == 0:
            base = [chance.choice([0, 160, 1400, 2630, 4095, chance.randrange(4096)]) for _ in range(n + 1)]
            noise = chance.choice([1, 5, 60, 600])
            if calm and tick % 40:
                base[:n] = [board.SENSOR_ZERO] * n
        link = b"" if tick else host.hello
        if tick % 100 == 0:
            bubble = chance.randrange(n)
            heights = sorted(chance.sample(range(1, 13000), chance.randrange(1, 50)))
            last = chance.choice([14000, 14000, 16000])
            tables[bubble] = [
                (
                    height,
                    chance.choice([0, 42000, chance.randrange(42001)]) if height < last else chance.randrange(40001),
                )
                for height in [*heights, last]
            ]
            link += ask("TABLE_WRITE", (bubble, 0, len(tables[bubble])), tables[bubble])
        elif tick % 100 == 1:
            crc = zlib.crc32(b"".join(np.array(table, "<u2").tobytes() for table in tables))
            link = ask("TABLE_COMMIT", (crc,))
        elif tick % 40 == 2:
            over_ms = chance.choice([0, 200, chance.randrange(60001)])
            link = ask("CLEAR") + host.show(over_ms, [chance.randrange(14001) for _ in range(n)])
        elif tick % 100 == 50:
            link = ask(chance.choice(["STOP", "VENT", "STATE"]))
        counts = [max(0, min(4095, level + chance.randint(-noise, noise))) for level in base]
        if calm:
            counts[n] = 2550 + tick % 3
        yield array("H", counts), link


@pytest.mark.slow
@pytest.mark.usefixtures("micropython")
@pytest.mark.parametrize("seed", range(2))
def test_what_no_plant_would_do_is_computed_the_same(seed):
    data = boards.load("wristband7")
    given = list(hostile(seed, data, 8000))
    decided = replay(InProcessFirmware(data, BOOT_ID), given)
    assert_same(decided, replay(MicroPythonFirmware(data, BOOT_ID), given))
    heard = list(Reader(KEY).feed(b"".join(outputs.link for outputs in decided)))
    refused = {message["error"] for message in heard if message.id == messages.ERROR}
    assert refused <= {errors.BOARD_FAULT}, "a shape that is asked while a fault of the board isolates"
    assert len({tuple(outputs.pulses) for outputs in decided}) > 30


def sequence(n):
    """What the host sends for every kind of record: ramps of every easing, conditions that come and that do not, repeats."""
    chance = random.Random(5)
    blank = [0] * (n + 2)

    def record(easing, until, ramp, wait, tolerance, then=steps.GO_ON):
        targets = [steps.LEAVE if chance.random() < 0.2 else chance.randrange(4000, 14000) for _ in range(n)]
        return [steps.flags(easing, until, then), ramp, wait, tolerance, *targets]

    records = [record(easing, steps.TIME, 173, 31, 0) for easing in range(4)]
    records += [[steps.REPEAT, 3, *blank], *records[:2], [steps.END, 0, *blank]]
    records += [
        record(1, steps.SETTLE, 90, 3000, 300),
        record(2, steps.SETTLE, 0, 70, 60),
        record(0, steps.TIME, 333, 0, 0),
    ]
    records += [record(3, steps.SETTLE, 77, 50, 50, steps.VENT)]
    words = [word for record in records for word in record]
    crc = zlib.crc32(np.array(words, "<u2").tobytes())
    ask = Host().ask
    yield Host().hello
    yield ask("SEQUENCE_BEGIN", (0xFFFF, n, 0, len(records), crc))
    for first in range(0, len(records), 5):
        part = [(word,) for record in records[first : first + 5] for word in record]
        yield ask("SEQUENCE_WRITE", (0xFFFF, first), part)
    yield ask("SEQUENCE_ARM", (0xFFFF,))
    yield ask("SEQUENCE_START", (0xFFFF, 50))
    yield from [ALIVE] * 150
    yield ask("SEQUENCE_CONTROL", (0xFFFF, sequences.PAUSE))
    yield from [ALIVE] * 30
    yield ask("SEQUENCE_CONTROL", (0xFFFF, sequences.RESUME)) + ask("SEQUENCE_STATE")


@pytest.mark.medium
@pytest.mark.usefixtures("micropython")
@pytest.mark.parametrize("name", ["wristband7", "wristband19"])
def test_a_sequence_is_played_the_same(name):
    board = SimulatedBoard(name, seed=BOOT_ID - 1)
    board.firmware = recorder = Recorder(board.firmware)
    requests = sequence(board.data.BUBBLES)
    for _ in range(1200):
        board.to_device += next(requests, ALIVE)
        board.tick()
    assert_same(recorder.decided, replay(MicroPythonFirmware(board.data, BOOT_ID), recorder.given))
    heard = list(Reader(KEY).feed(b"".join(outputs.link for outputs in recorder.decided)))
    assert not [message for message in heard if message.id == messages.ERROR]
    events = [message for message in heard if message.id == messages.SEQUENCE_EVENT]
    assert {event["reason"] for event in events} == {0, sequences.BY_TIME, sequences.BY_SETTLING, sequences.BY_TIMEOUT}
    assert events[-1]["event"] == sequences.SEQUENCE_ENDED
    assert len(events) == 4 + 6 + 4 + 2 + 1
