"""On MicroPython, with right CRCs and numbers: every message, every field at its limits and past them, every length."""

import itertools

import pytest

from bubble_firmware import boards
from bubble_protocol import codec
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, HEADER, PAYLOAD_MAX, finish_frame, put_header
from bubble_protocol.schema import messages
from bubbleskin.link.message import encode, session_key

SESSION = 0x13579BDF

SCRIPT = """
import gc, sys
from bubble_firmware import boards
from bubble_firmware.control import state_layout as layout
from bubble_firmware.app import App
from bubble_firmware.hal.base import Hal

class LineHal(Hal):
    line = b""
    answers = 0
    wide = 0
    ticks = 0
    def read_sensors(self, counts):
        for i in range(len(counts)):
            counts[i] = 1000 + 40 * i  # below what has the whole board vented
        # The reservoir breathes by 1.6 kPa: one that stands still is not believed, and vents everything.
        self.ticks = (self.ticks + 1) & 63
        counts[-1] = 2520 + 2 * abs(self.ticks - 32)
    def write_outputs(self, pulses, pump, dump):
        for i in range(len(pulses)):
            if pulses[i] > {tick_us}:
                self.wide += 1
    def receive(self, buffer):
        line = self.line
        size = min(len(line), len(buffer))
        for i in range(size):
            buffer[i] = line[i]
        self.line = line[size:]
        return size
    def send(self, frame, length):
        if frame[1] not in (0x07, 0x1C, 0x26):  # TELEMETRY, TELEMETRY_FIELDS, SEQUENCE_EVENT
            self.answers += 1
        return True

board = boards.load("{board}")
hal = LineHal(board)
app = App(board, hal)
rows = app.bubbles.rows
limit = board.HEIGHT_MAX_UM
unanswered = beyond = frames = 0
free = 0
for line in sys.stdin:
    frame = bytes.fromhex(line.strip())
    before = hal.answers
    hal.line = frame
    app.tick()
    while hal.line:
        app.tick()
    frames += 1
    unanswered += hal.answers != before + 1
    for bubble in range(board.BUBBLES):
        at = bubble * layout.ROW_WORDS
        if not 0 <= rows[at + layout.TARGET] <= limit or rows[at + layout.SETPOINT] > limit << 4:
            beyond += 1
    if frames == 300:
        line = frame = None
        gc.collect()
        free = gc.mem_free()
    if not frames % 100:
        app.tick()
line = frame = None
gc.collect()
print(frames, unanswered, beyond, hal.wide, app.stats.exceptions, free - gc.mem_free())
"""


def sealed(message_id, number, payload):
    frame = bytearray(FRAME_MAX)
    put_header(frame, message_id, number & 0xFFFF)
    frame[4 : 4 + len(payload)] = payload
    return bytes(frame[: finish_frame(frame, HEADER + len(payload), crc32_into, session_key(1, SESSION))])


def of_kind(kind, low, high):
    """Values of a field: its limits, one past each, and the extremes of its kind."""
    if kind == messages.TEXT:
        return [b"\0" * 16, b"\xff" * 16]
    size = kind & 15
    top = (1 << 8 * size) - 1
    numbers = {0, 1, top, top >> 1, (top >> 1) + 1}
    for limit in (low, high):
        if limit is not None:
            numbers |= {limit - 1, limit, limit + 1}
    return [(number & top).to_bytes(size, "little") for number in sorted(numbers)]


def payloads(message, bubbles):
    """One field at an edge and the others in the middle, for several numbers of entries; then everything of every length."""
    counts = {0, 1, bubbles - 1, bubbles, bubbles + 1, 40} if message.repeated else {0}
    for count in counts:
        fields = [*message.fixed, *message.repeated * count]
        middle = [of_kind(*field[1:2], *field[3:5])[2 if field[1] != messages.TEXT else 0] for field in fields]
        for place, field in enumerate(fields[: len(message.fixed) + 2 * len(message.repeated)]):
            for value in of_kind(field[1], field[3], field[4]):
                yield b"".join([*middle[:place], value, *middle[place + 1 :]])
    for size in range(PAYLOAD_MAX + 1):
        for byte in (0, 1, 0xFF):
            yield bytes([byte]) * size


def frames(board, every):
    """One payload of so many of each message. HELLO, then everything; whoever opens another session would end this one."""
    yield encode("HELLO", 0, (2, 2, SESSION))
    numbers = itertools.count(1)
    heights = [(13000 - 100 * bubble).to_bytes(2, "little") for bubble in range(board.BUBBLES)]
    yield sealed(messages.SHOW, next(numbers), b"".join([b"\0\0", *heights]))
    for message in codec.BY_ID.values():
        for payload in itertools.islice(payloads(message, board.BUBBLES), 0, None, every):
            if message.id == messages.HELLO:
                session = SESSION.to_bytes(4, "little") if len(payload) >= 6 else bytes(4)
                payload = (payload[:2] + session)[: len(payload)] + payload[6:]
            aside = message.id in (messages.HELLO, messages.PING)
            if len(payload) <= PAYLOAD_MAX:
                yield sealed(message.id, 0 if aside else next(numbers), payload)
    for message_id in range(256):
        if message_id not in codec.BY_ID:
            yield sealed(message_id, next(numbers), b"")
            yield sealed(message_id, next(numbers), bytes(range(40)))
    yield sealed(messages.PING, 0, b"last")


@pytest.mark.promise("hostile")
@pytest.mark.parametrize(
    ("name", "every"),
    [
        pytest.param("wristband7", 10, id="quick", marks=pytest.mark.slow),
        pytest.param("wristband7", 1, id="all", marks=pytest.mark.slow),
        pytest.param("wristband19", 1, id="all of 19", marks=pytest.mark.slow),
    ],
)
def test_nothing_at_or_past_a_limit_does_harm(micropython, name, every):
    board = boards.load(name)
    lines = [frame.hex() for frame in frames(board, every)]
    said = micropython(SCRIPT.format(board=name, tick_us=board.TICK_US), stdin="\n".join(lines) + "\n", timeout=600)
    sent, unanswered, beyond, wide, exceptions, grown = map(int, said.split())
    assert sent == len(lines) > 10_000 / every
    assert unanswered == 0, "each was answered once"
    assert (beyond, wide, exceptions) == (0, 0, 0)
    assert grown == 0
