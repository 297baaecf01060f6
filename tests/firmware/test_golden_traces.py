"""The golden traces: what the firmware has been given, tick by tick, and digests of what it has decided.

A trace says what comes in: sensor counts as a simulated board has once measured them, or counts by a generator that knows
no plant; and the host's requests. Nothing is simulated again, so a trace judges the firmware alone, and every version of it
by the same. What goes out is valve times, pump, dump and telemetry in every tick; events and the fault log, too.

`python tools/record_golden_traces.py` has made golden_traces.json, and writes the digests anew (`--digests`) after a change
of the control law that is meant. Any other change has to leave them as they are, on every interpreter.
"""

import base64
import json
import lzma
import zlib
from array import array
from pathlib import Path

import numpy as np
import pytest

from bubble_firmware import boards
from bubble_firmware.control.nominal import KNOTS
from bubble_protocol.schema import faults, messages, modes, statuses
from bubbleskin.link.message import encode, session_key
from bubbleskin.link.reader import Reader
from bubbleskin.sim.board import InProcessFirmware
from bubbleskin.sim.micropython import MicroPythonFirmware

PATH = Path(__file__).parent / "golden_traces.json"
BOOT_ID = 1
BLOCK = 50  # ticks in one digest
ALIVE_TICKS = 20  # between two PINGs of a host that lives
ALL_COLUMNS = 0b11111111
MOST_COLUMNS = (
    0b00111011  # of 19 bubbles a frame has room for six: all but the valves, which are outputs anyway, and targets
)
OUTCOMES = (messages.TELEMETRY_FIELDS, messages.SEQUENCE_EVENT, messages.FAULTS_READ | messages.REPLY, messages.ERROR)


def packed(counts):
    """Counts, (ticks, sensors), as text: differences from tick to tick, one sensor after the other, compressed."""
    steps = np.diff(counts.astype(np.int16), axis=0, prepend=np.int16(0)).T
    return base64.b85encode(lzma.compress(steps.astype("<i2").tobytes(), preset=9)).decode()


def unpacked(text, sensors):
    """What `packed` has made a text of."""
    steps = np.frombuffer(lzma.decompress(base64.b85decode(text)), "<i2").reshape(sensors, -1)
    return np.cumsum(steps, axis=1, dtype=np.int16).T.astype(np.uint16)


class Chance:
    """Whole numbers by chance (xorshift), the same in every Python."""

    def __init__(self, seed):
        self.state = seed * 2654435761 & 0xFFFFFFFF or 1

    def below(self, limit):
        """0 to `limit` - 1."""
        state = self.state
        state ^= state << 13 & 0xFFFFFFFF
        state ^= state >> 17
        self.state = state ^ state << 5 & 0xFFFFFFFF
        return self.state % limit

    def one_of(self, choices):
        return choices[self.below(len(choices))]


def hostile(board, seed, ticks):
    """Counts, and requests as in a trace, that no plant and no SDK would give: leaps over the whole range, any table.

    The first bubbles stay quiet for long, so that what takes its time comes about, too. For two thirds of the time nothing
    stands that would have the whole board vented: the supply is steady, and the pressures go in between.
    """
    chance = Chance(seed)
    n = board.BUBBLES
    counts = np.zeros((ticks, n + 1), np.uint16)
    requests = []
    tables = [[list(knot) for knot in KNOTS] for _ in range(n)]
    level, noise = [board.SENSOR_ZERO] * (n + 1), 1
    for tick in range(ticks):
        calm = tick < 2 * ticks // 3
        if tick % 20 == 0:
            noise = chance.one_of([0, 1, 5, 60, 600])
            for sensor in range(n + 1):
                if sensor >= 3 or chance.below(8) == 0:
                    level[sensor] = chance.one_of([0, 160, 1400, 2630, 4095, 0xFFFF, 2000, 2200, chance.below(4096)])
            if chance.below(3):
                level[n] = 2550
            if calm and tick % 40:
                level[:n] = [board.SENSOR_ZERO] * n
        if tick % 150 == 20:
            bubble = chance.below(n)
            heights = sorted({1 + chance.below(13999) for _ in range(1 + chance.below(48))})
            pressures = [0, 42000, chance.below(42001)]
            knots = [[height, chance.one_of(pressures)] for height in heights]
            knots.append([14000 + chance.below(2001), 20000 + chance.below(20001)])
            tables[bubble] = knots
            requests.append([tick, "TABLE_WRITE", [bubble, 0, len(knots)], knots])
        elif tick % 150 == 21:
            crc = zlib.crc32(b"".join(np.array(table, "<u2").tobytes() for table in tables))
            requests.append([tick, "TABLE_COMMIT", [crc], []])
        elif tick % 40 == 2:
            requests.append([tick, "CLEAR", [], []])
            over_ms = chance.one_of([0, 200, chance.below(60001)])
            requests.append([tick, "SHOW", [over_ms], [[chance.below(14001)] for _ in range(n)]])
        elif tick % 100 == 50:
            requests.append([tick, chance.one_of(["STOP", "VENT", "STATE"]), [], []])
        for sensor in range(n + 1):
            noisy = level[sensor] + chance.below(2 * noise + 1) - noise
            counts[tick, sensor] = level[sensor] if level[sensor] == 0xFFFF else max(0, min(4095, noisy))
    steady = 2 * ticks // 3
    counts[:steady, n] = 2550 + np.arange(steady) % 3
    return counts, requests


def frames(trace, board):
    """{tick: bytes of the link}: HELLO, telemetry in every tick, the trace's requests, the log at its end, and a living host."""
    key = session_key(BOOT_ID, 1)
    found = {0: encode("HELLO", 1, (2, 2, 1))}
    columns = ALL_COLUMNS if board.BUBBLES < 10 else MOST_COLUMNS
    requests = [[1, "SUBSCRIBE_FIELDS", [1, columns], []], *trace["requests"]]
    requests += [[trace["ticks"] - 2, "FAULTS_READ", [0], []]]
    for tick in range(0, trace["ticks"], ALIVE_TICKS):
        if not any(first <= tick < end for first, end in trace.get("silent", [])):
            found[tick] = found.get(tick, b"") + encode("PING", 7, (0,), (), key)
    requests.sort(key=lambda request: request[0])
    for number, (tick, name, fixed, repeated) in enumerate(requests, 1):
        found[tick] = found.get(tick, b"") + encode(name, number, fixed, repeated, key)
    return found


def replay(trace, firmware):
    """What `firmware` decides: a digest for every `BLOCK` ticks, and the messages of `OUTCOMES`."""
    board = boards.load(trace["board"])
    if "hostile" in trace:
        counts, requests = hostile(board, trace["hostile"], trace["ticks"])
        trace = {**trace, "requests": requests}
    else:
        counts = unpacked(trace["counts"], board.BUBBLES + 1)
    links = frames(trace, board)
    reader = Reader(session_key(BOOT_ID, 1))
    digests, told, digest, unsent = [], [], 0, b""
    for tick in range(trace["ticks"]):
        unsent += links.get(tick, b"")
        outputs = firmware.tick(array("H", counts[tick].tolist()), unsent[:256])
        unsent = unsent[256:]
        said = [*outputs.pulses, outputs.pump, int(outputs.dump)]
        for message in reader.feed(outputs.link):
            if message.id in OUTCOMES:
                told.append(message)
                said += [message.id, *message.fields.values()]
                for column in message.columns.values():
                    said += column.tolist()
        digest = zlib.crc32(np.array(said, "<i8").tobytes(), digest)
        if tick % BLOCK == BLOCK - 1:
            digests.append(digest)
            digest = 0
    return digests, told


TRACES = json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else []
each_trace = pytest.mark.parametrize("trace", TRACES, ids=lambda trace: trace["name"])


def assert_golden(trace, firmware):
    try:
        digests, told = replay(trace, firmware)
    finally:
        firmware.close()
    wrong = [block for block, pair in enumerate(zip(digests, trace["digests"], strict=True)) if pair[0] != pair[1]]
    assert not wrong, f"it decides otherwise than recorded from tick {BLOCK * wrong[0]} to {BLOCK * wrong[0] + BLOCK}"
    return told


@pytest.mark.promise("same-everywhere")
@pytest.mark.medium
@each_trace
def test_this_interpreter_decides_as_recorded(trace):
    assert_golden(trace, InProcessFirmware(boards.load(trace["board"]), BOOT_ID))


@pytest.mark.promise("same-everywhere")
@pytest.mark.slow
@pytest.mark.usefixtures("micropython")  # to be skipped or to fail where there is none
@each_trace
def test_micropython_decides_as_recorded(trace):
    assert_golden(trace, MicroPythonFirmware(boards.load(trace["board"]), BOOT_ID))


@pytest.mark.slow
def test_the_traces_say_something():
    """Every mode, every status, faults of a bubble and those of the board that need no hardware come up in them."""
    seen_modes, seen_statuses, seen_faults, seen_board_faults = set(), set(), 0, 0
    for trace in TRACES:
        board = boards.load(trace["board"])
        _, told = replay(trace, InProcessFirmware(board, BOOT_ID))
        columns = 8 if board.BUBBLES < 10 else 5
        for message in told:
            if message.id == messages.TELEMETRY_FIELDS:
                values = message.columns["value"].reshape(-1, columns)
                status, fault = (3, 4) if columns == 8 else (2, 3)
                seen_modes.add(message["mode"])
                seen_statuses |= set(values[:, status].tolist())
                seen_faults |= int(np.bitwise_or.reduce(values[:, fault]))
                seen_board_faults |= message["board_faults"]
    # BOOT is over in the first tick where there is no hardware to test; STOPPED takes a pressed emergency stop.
    assert seen_modes == {mode for mode, *_ in modes.MODES} - {modes.BOOT, modes.STOPPED}
    assert seen_statuses == {status for status, *_ in statuses.STATUSES}
    # No trace keeps a fill valve open for as long as a board forbids: test_safety has that.
    assert seen_faults == sum(bit for bit, *_ in faults.FAULTS) - faults.VALVE_TIME
    assert seen_board_faults & (faults.SUPPLY_LOST | faults.OVERFILLED) == faults.SUPPLY_LOST | faults.OVERFILLED
