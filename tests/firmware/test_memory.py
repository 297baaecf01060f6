"""On MicroPython the tick allocates nothing: a collection takes longer than a tick."""

import struct
import zlib
from pathlib import Path

import pytest

from bubble_firmware import boards
from bubble_firmware.control import nominal
from bubble_protocol import codec, steps
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, HEADER, finish_frame, put_header
from bubble_protocol.schema import messages, sequences
from bubbleskin.link import message

TOOLS = str(Path(__file__).parents[2] / "tools/stress")
SCRIPT = """
import gc, micropython, sys
from bubble_firmware import boards
from bubble_firmware.app import App
sys.path.append({tools!r})
from following_hal import FollowingHal

class TalkingHal(FollowingHal):
    # The requests over and over, a few bytes in every tick and between ticks.
    def __init__(self, board, requests):
        super().__init__(board)
        self.requests = requests
        self.at = self.sent = 0

    def receive(self, buffer):
        requests = self.requests
        at = self.at
        for i in range({bytes_per_tick}):
            buffer[i] = requests[at]
            at += 1
            if at == len(requests):
                at = 0
        self.at = at
        return {bytes_per_tick}

    def send(self, frame, length):
        self.sent += 1
        return self.sent & 15 != 0

def ticks(app, count):
    while count:
        count -= 1
        micropython.heap_lock()
        app.tick()
        app.listen()
        micropython.heap_unlock()

def measure(app, hal, count):
    hal.fills = hal.vents = hal.rests = hal.sent = 0
    before = gc.mem_alloc()
    ticks(app, count)
    return gc.mem_alloc() - before

hal = TalkingHal(boards.load({board!r}), bytes.fromhex({requests!r}))
app = App(boards.load({board!r}), hal)
ticks(app, 300)
gc.collect()
gc.disable()
grown = measure(app, hal, {ticks})
decoder = app.server.decoder
print(grown, app.stats.exceptions, decoder.good, hal.sent, hal.fills, hal.vents, hal.rests, app.player.event_number)
print(app.store.wear[0], app.store.wear[1])

exceptions = app.stats.exceptions
hal.broken = True
hal.safe = 0
print(measure(app, hal, {failing}), app.stats.exceptions - exceptions, hal.safe)
"""

ACTIVE = ("SUBSCRIBE", "SHOW up", "STATE", "PING", "INFO", "SHOW down", "PING", "STATE", "INFO", "CLEAR")
OUT_OF_ORDER = ("SUBSCRIBE", "SHOW up", "STATE", "INFO", "SHOW down", "STATE", "STOP ahead", "STATE")
RESETS = ("TABLE_COMMIT", "STORE_RESET", "bad CRC", "HELLO 9", "TABLE_COMMIT", "INFO")
SAVING = ("TRIM_WRITE", "STORE_SAVE", "TRIM_READ", "TRIM_WRITE other", "STORE_SAVE", "STORE_INFO")
SEQUENCE = ("SEQUENCE_BEGIN", "SEQUENCE_WRITE", "SEQUENCE_ARM", "SEQUENCE_START", "SEQUENCE_STATE", *["PING"] * 20)
SEQUENCE += (
    "SEQUENCE_CONTROL pause",
    "SEQUENCE_STATE",
    "SEQUENCE_CONTROL resume",
    *["STATE"] * 10,
    "SEQUENCE_CONTROL end",
)
INJECTING = (
    "VENT",
    "INJECT permit",
    "INJECT stuck",
    "INJECT open",
    "SHOW up",
    "INJECT shut",
    "INJECT permit",
    "INJECT mend",
)
EXTREMES = tuple(f"{name} {end}" for name in ("all", "repeated") for end in ("least", "greatest"))
"""Every request with its fields at the ends of what the wire can say: `all` of them, or only what is repeated."""

SEQUENCES = [
    pytest.param(ACTIVE, id="active"),
    pytest.param(("SHOW up", "HELLO", "STOP", "SHOW down", "VENT", "CLEAR", "TABLE_READ"), id="everything"),
    pytest.param(("SHOW up", "garbage", "too high", "wrong count", "wrong length", "unknown"), id="refused"),
    pytest.param(("SUBSCRIBE_FIELDS", "SHOW up", "PING", "SHOW down", "INFO"), id="telemetry columns"),
    pytest.param(("TABLE_WRITE", "SHOW up", "STATE"), id="tables"),
    pytest.param(OUT_OF_ORDER, id="out of order, twice, overtaken"),
    pytest.param(("STORE_INFO", "TRIM_READ", "SHOW up", "STORE_SAVE", "TRIM_WRITE"), id="store"),
    pytest.param(SAVING, id="saving"),
    pytest.param(SEQUENCE, id="sequence"),
    pytest.param(("SEQUENCE_BEGIN stream", "SEQUENCE_WRITE stream", *SEQUENCE[1:5], "SHOW up"), id="sequences refused"),
    pytest.param(
        ("SHOW up", "FAULTS_READ", "SETTING_READ", "SETTING_WRITE", "no setting", "FAULTS_ACK", "VENT"), id="safety"
    ),
    pytest.param(("SETTING_WRITE", "SHOW up", "PING", "long silence", "STATE"), id="deadman"),
    pytest.param(("SHOW up", "bad CRC", "bad table", "bad CRC", "VENT", "STORE_RESET", "too large"), id="hostile"),
    pytest.param(RESETS, id="resets and commits"),
    pytest.param(INJECTING, id="failures on request"),
    *[pytest.param((name, "SHOW up", "VENT"), id=name, marks=pytest.mark.slow) for name in EXTREMES],
]
FAILING = 500
"""Ticks that all fail."""
SESSIONS = 17
"""One more than the device remembers: the first may come again after the last."""


def request(name, n, number, session):
    key = message.session_key(1, session)
    up = [(6000 + 900 * bubble % 8000,) for bubble in range(n)]
    down = [(13000 - 700 * bubble % 8000,) for bubble in range(n)]

    def of(what, *values):
        return message.encode(what, number, *values, key=key)

    def wrong_length():
        frame = bytearray(FRAME_MAX)
        put_header(frame, messages.SUBSCRIBE, number)
        return bytes(frame[: finish_frame(frame, HEADER + 1, crc32_into, key)])

    requests = {
        "SHOW up": lambda: of("SHOW", (0,), up),
        "SHOW down": lambda: of("SHOW", (300,), down),
        "PING": lambda: of("PING", (0xFEDCBA98,)),
        "HELLO": lambda: of("HELLO", (2, 2, session)),
        "SUBSCRIBE": lambda: of("SUBSCRIBE", (20000 // boards.load(f"wristband{n}").TICK_US,)),  # 50 Hz
        "SUBSCRIBE_FIELDS": lambda: of("SUBSCRIBE_FIELDS", (2, 0b11100111 if n == 7 else 0b11100011)),
        "TABLE_READ": lambda: of("TABLE_READ", (1, 10)),
        "TABLE_WRITE": lambda: of("TABLE_WRITE", (1, 4, 60), [(9000, 65535)] * 40),
        "TRIM_WRITE": lambda: of("TRIM_WRITE", (), [(170, 1100, 900, 4000)] * n),
        "TRIM_WRITE other": lambda: of("TRIM_WRITE", (), [(150, 1300, 1100, 3900)] * n),
        "garbage": lambda: bytes(range(1, 200)) + b"\0",
        "too high": lambda: of("SHOW", (0,), [(15000,)] * n),
        "wrong count": lambda: of("SHOW", (0,), [(9000,)] * (n + 1)),
        "wrong length": wrong_length,
        "unknown": lambda: of("PING_REPLY", (0xFEDCBA98, 1, 1)),
        "FAULTS_READ": lambda: of("FAULTS_READ", (0,)),
        "FAULTS_ACK": lambda: of("FAULTS_ACK", (3,)),
        "SETTING_WRITE": lambda: of("SETTING_WRITE", (), [(0, 100), (1, 200)]),
        "no setting": lambda: of("SETTING_WRITE", (), [(9, 100)]),
        "long silence": lambda: bytes(9 * 100),  # ticks; longer than SETTING_WRITE allows
    }
    requests |= {
        "bad CRC": lambda: of("TABLE_COMMIT", (0x80000001,)),
        "TABLE_COMMIT": lambda: of("TABLE_COMMIT", (nominal_crc(n),)),
        "bad table": lambda: of("TABLE_WRITE", (n - 1, 0, 60), [(9000, 65535)] * 40),
        "too large": lambda: of("FAULTS_ACK", (0x7FFFFFFF,)),
        "HELLO 9": lambda: of("HELLO", (9, 9, session)),
        "INJECT permit": lambda: of("INJECT", (0, 0, 1)),
        "INJECT stuck": lambda: of("INJECT", (2, n - 1, 1)),
        "INJECT open": lambda: of("INJECT", (5, 1, 1)),
        "INJECT shut": lambda: of("INJECT", (4, 2, 1)),
        "INJECT mend": lambda: of("INJECT", (2, n - 1, 0)),
        "SEQUENCE_BEGIN": lambda: of("SEQUENCE_BEGIN", (3, n, 0, 5, program_crc(n))),
        "SEQUENCE_WRITE": lambda: of("SEQUENCE_WRITE", (3, 0), program(n)),
        "SEQUENCE_ARM": lambda: of("SEQUENCE_ARM", (3,)),
        "SEQUENCE_START": lambda: of("SEQUENCE_START", (3, 0)),
        "SEQUENCE_CONTROL pause": lambda: of("SEQUENCE_CONTROL", (3, sequences.PAUSE)),
        "SEQUENCE_CONTROL resume": lambda: of("SEQUENCE_CONTROL", (3, sequences.RESUME)),
        "SEQUENCE_CONTROL end": lambda: of("SEQUENCE_CONTROL", (3, sequences.END)),
        "SEQUENCE_BEGIN stream": lambda: of("SEQUENCE_BEGIN", (4, n, 0, 0, 0xFFFFFFFF)),
        "SEQUENCE_WRITE stream": lambda: of("SEQUENCE_WRITE", (4, 0), program(n)),
    }
    if isinstance(name, tuple):
        return of(*name)
    return requests[name]() if name in requests else of(name)


def every_request(which):
    """(name, fixed, repeated) of every request but those of no order and RESTART, its fields at an end of what they can be."""
    ends = {
        messages.U8: (0, 0xFF),
        messages.U16: (0, 0xFFFF),
        messages.I32: (-0x80000000, 0x7FFFFFFF),
        messages.U32: (0, 0xFFFFFFFF),
    }
    for what in codec.BY_ID.values():
        if (
            what.id & messages.REPLY
            or what.id | messages.REPLY not in codec.BY_ID
            or what.name in ("HELLO", "PING", "RESTART")
        ):
            continue
        end = which.endswith("greatest")
        lows = [field[3] or 0 for field in what.fixed]
        fixed = [ends[field[1]][end] for field in what.fixed] if which.startswith("all") else lows
        yield what.name, tuple(fixed), [tuple(ends[field[1]][end] for field in what.repeated)] * bool(what.repeated)


def rounds(sequence, n):
    """The requests in session after session, over and over: one session's numbers do not come round in so short a time."""
    for session in range(0x89ABCDEF, 0x89ABCDEF + SESSIONS):
        yield request("HELLO", n, 1, session)
        number, frames = 0, []
        for name in (one for some in sequence for one in (every_request(some) if some in EXTREMES else [some])):
            number += name not in ("HELLO", "HELLO 9", "PING", "garbage", "long silence")
            if name == "STOP ahead":
                number += 2
                frames.append(request("STOP", n, number, session))
                frames.append(request("STATE", n, number - 1, session))
            else:
                frames.append(request(name, n, number, session))
        if sequence == OUT_OF_ORDER:
            frames = [frames[at] for at in (0, 4, 1, 3, 2, 1, 5, 6, 6, 7, 5, 8, 0)]
        yield b"".join(frames)


def nominal_crc(n):
    return zlib.crc32(b"".join(struct.pack("<2H", *knot) for knot in nominal.KNOTS) * n)


def program(n):
    """A repeat of a ramp, of a step that waits until settled, and of one that only waits: words."""
    up = [steps.flags(steps.SMOOTH, steps.TIME, 0), 90, 30, 0, *[6000 + 900 * bubble % 8000 for bubble in range(n)]]
    down = [
        steps.flags(steps.OUT, steps.SETTLE, steps.GO_ON),
        50,
        100,
        300,
        *[13000 - 700 * bubble % 8000 for bubble in range(n)],
    ]
    wait = [steps.flags(steps.LINEAR, steps.TIME, 0), 0, 15, 0, *[steps.LEAVE] * n]
    blank = [0] * (n + 2)
    return [
        (word,) for record in ([steps.REPEAT, 0, *blank], up, down, wait, [steps.END, 0, *blank]) for word in record
    ]


def program_crc(n):
    words = [word for (word,) in program(n)]
    return zlib.crc32(struct.pack(f"<{len(words)}H", *words))


@pytest.mark.promise("memory")
@pytest.mark.medium
@pytest.mark.parametrize("sequence", SEQUENCES)
@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
def test_the_tick_allocates_nothing(micropython, board, sequence):
    n = boards.load(board).BUBBLES
    requests = b"".join(rounds(sequence, n))
    ticks = {SAVING: 600, RESETS: 300, ACTIVE: 4000}.get(sequence, 4000 if sequence[0] in EXTREMES else 1500)
    said, wear, failing = micropython(
        SCRIPT.format(tools=TOOLS, board=board, requests=requests.hex(), bytes_per_tick=9, ticks=ticks, failing=FAILING)
    ).splitlines()
    grown, exceptions, good, sent, fills, vents, rests, events = map(int, said.split())
    assert exceptions == 0, "MemoryError while the heap was locked"
    assert grown == 0
    few = 40 if "long silence" in sequence else ticks // 8
    assert good > few
    assert sent > few
    # Nor when every tick fails: what makes the outputs safe must not need memory, for that may be what failed.
    grown, exceptions, safe = map(int, failing.split())
    assert (grown, exceptions) == (0, FAILING)
    assert safe >= FAILING
    if sequence == SAVING:
        assert min(map(int, wear.split())) > 5, "flash was written, both slots in turn"
    if sequence == SEQUENCE:
        assert events > 100, "steps were played"
    if sequence == ACTIVE:
        assert sent > good, "telemetry and every reply"
        assert min(fills, vents, rests) > ticks * n // 20, "valves of both kinds are at work"
