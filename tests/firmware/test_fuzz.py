"""The firmware in the real MicroPython against bytes that nobody should send."""

import random

import pytest

from bubble_protocol import codec
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, HEADER, PAYLOAD_MAX, finish_frame, put_header
from bubble_protocol.schema import messages
from bubbleskin.link.message import encode, session_key

SCRIPT = """
import gc, random, sys
from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.hal.base import Hal
from bubble_protocol import frame as framing
from bubble_protocol.crc import crc32_into

TELEMETRY = 0x07

class LineHal(Hal):
    # The link is `line[:length]`, 256 bytes of it in every tick.
    def __init__(self, board):
        super().__init__(board)
        self.line = bytearray(8192)
        self.length = 0
        self.at = 0
        self.answers = 0
        self.answered = False  # the good frame
        self.vented = 0
        self.ticks = 0

    def read_sensors(self, counts):
        for i in range(len(counts)):
            counts[i] = 1000 + 40 * i  # below what has the whole board vented
        # The reservoir breathes by 1.6 kPa: one that stands still is not believed, and vents everything.
        self.ticks = (self.ticks + 1) & 63
        counts[-1] = 2520 + 2 * abs(self.ticks - 32)

    def safe_outputs(self):
        self.vented += 1

    def receive(self, buffer):
        line = self.line
        at = self.at
        size = min(self.length - at, len(buffer))
        for i in range(size):
            buffer[i] = line[at + i]
        self.at += size
        return size

    def send(self, frame, length):
        # COBS hides a zero by the distance to the next: an id is never one, so it stands as it is.
        if frame[1] != TELEMETRY:
            self.answers += 1
        return True

    def restart(self, into):
        self.vented -= 1  # a restart vents, as it should


class Watch:
    # Stands before the dispatcher and asks of every frame accepted whether it was sent.
    def __init__(self, server, sent):
        self.take = server.take
        self.frame = server.decoder.frame
        self.decoder = server.decoder
        self.sent = sent
        self.found = bytearray(256)
        self.accepted = 0
        self.forged = 0

    def __call__(self, message_id, sequence):
        self.accepted += 1
        content = bytes(self.frame[1 : 1 + self.decoder.length])
        if self.sent is not None and content not in self.sent:
            self.forged += 1
        self.take(message_id, sequence)


rnd = random.getrandbits
board = boards.load("wristband7")
hal = LineHal(board)
app = App(board, hal)
server = app.server
decoder = server.decoder
frames = [bytes.fromhex(line) for line in sys.stdin.read().split()]
greeting = frames.pop(0)
good = frames[0]
key = server.window.key
for i in range(len(greeting)):
    hal.line[i] = greeting[i]
hal.length = len(greeting)
app.tick()
sent = set()
for frame in frames:
    at = 0
    while at < len(frame):
        at = decoder.feed(frame, at, len(frame))
    sent.add(bytes(decoder.frame[1 : 1 + decoder.length]))
watch = Watch(server, sent)
server.take = watch


def run(length):
    hal.length = length
    hal.at = 0
    while hal.at < length:
        app.tick()


def put(at, data):
    line = hal.line
    for i in range(len(data)):
        line[at + i] = data[i]
    return at + len(data)


def good_is_understood():
    # A delimiter, then the good frame: answered, and nothing else is.
    line = hal.line
    line[0] = 0
    end = put(1, good)
    app.tick()
    answers = hal.answers
    was = decoder.good
    run(end)
    return hal.answers > answers and decoder.good > was


def random_bytes(total):
    # Even ones, and ones with many delimiters and small COBS steps, which make short frames.
    missed = 0
    line = hal.line
    while total > 0:
        style = rnd(2)
        for i in range(2000):
            byte = rnd(8)
            if style == 1 and byte > 200:
                byte = 0
            elif style == 2:
                byte &= 7
            elif style == 3 and i & 15 == 0:
                byte = 1 + rnd(4)
            line[i] = byte
        run(2000)
        total -= 2000
        if not good_is_understood():
            missed += 1
    return missed


def mutate(work, n):
    # One to three small errors in work[:n]; the new length.
    for _ in range(1 + rnd(2) % 3):
        if n == 0:
            return n
        kind = rnd(3)
        at = rnd(16) % n
        if kind <= 1:
            work[at] ^= 1 << rnd(3)
        elif kind == 2:
            work[at] = rnd(8)
        elif kind == 3:
            work[at] = 0
        elif kind == 4:  # lost
            for i in range(at, n - 1):
                work[i] = work[i + 1]
            n -= 1
        elif kind == 5:  # doubled
            i = n
            while i > at:
                work[i] = work[i - 1]
                i -= 1
            n += 1
        elif kind == 6:  # cut off
            n = at
        else:  # two exchanged
            other = rnd(16) % n
            byte = work[at]
            work[at] = work[other]
            work[other] = byte
    return n


def mutated(total):
    missed = 0
    line = hal.line
    work = bytearray(300)
    end = 0
    while total > 0:
        end = 0
        for _ in range(16):
            frame = frames[rnd(16) % len(frames)]
            for i in range(len(frame)):
                work[i] = frame[i]
            n = mutate(work, len(frame))
            for i in range(n):
                line[end + i] = work[i]
            end += n
        total -= 16
        run(end)
        if not good_is_understood():
            missed += 1
    return missed


def well_formed(total):
    # Any id, any payload, a right CRC: the dispatcher's turn. Each is answered once.
    watch.sent = None
    frame = bytearray(framing.FRAME_MAX)
    answers = hal.answers
    for turn in range(total):
        size = rnd(5) if rnd(1) else rnd(8) % 248
        if rnd(2) == 0:
            size = {right_size} if rnd(1) else 3 + 4 * rnd(4)
        framing.put_header(frame, rnd(4) if rnd(3) else rnd(8), server.window.expected)
        few = rnd(1)
        for i in range(size):
            frame[4 + i] = rnd(8) >> (5 if few else 0)
        if frame[1] == 1:  # HELLO: of the session that is open, or of none
            for i in range(4):
                frame[6 + i] = 0xAB if size >= 6 and not few else 0
        end = framing.finish_frame(frame, framing.HEADER + size, crc32_into, key)
        line = hal.line
        for i in range(end):
            line[i] = frame[i]
        run(end)
    watch.sent = sent
    return total - (hal.answers - answers)


def main(seed, bytes_, mutations, requests):
    random.seed(seed)
    random_bytes(4000)
    mutated(64)
    well_formed(64)
    good_is_understood()
    gc.collect()
    before = gc.mem_free()
    watch.accepted = 0
    bad = decoder.bad
    print("random", random_bytes(bytes_), watch.accepted, decoder.bad - bad)
    bad = decoder.bad
    watch.accepted = 0
    print("mutated", mutated(mutations), watch.accepted, decoder.bad - bad)
    print("requests", well_formed(requests), not good_is_understood())
    print("forged", watch.forged)
    print("exceptions", app.stats.exceptions, hal.vented - 1)
    gc.collect()
    print("heap", before, gc.mem_free())


main({seed}, {bytes}, {mutations}, {requests})
"""


SESSION = 0xABABABAB


def valid_frames():
    """HELLO, then every request and some replies, short and as long as they get; the first is the good one."""
    chance = random.Random(5)
    key = session_key(1, SESSION)
    frames = [encode("HELLO", 1, (2, 2, SESSION)), encode("PING", 0x1234, (0x00C0FFEE,), key=key)]
    for message in codec.BY_ID.values():
        room = (PAYLOAD_MAX - message.fixed_size) // message.stride if message.stride else 0
        for count in {0, min(7, room), room}:
            size = message.fixed_size + count * message.stride
            frame = bytearray(FRAME_MAX)
            put_header(frame, message.id, chance.randrange(1 << 16))
            frame[4 : 4 + size] = bytes(chance.choice([0, 1, chance.randrange(256)]) for _ in range(size))
            if message.id == messages.HELLO:  # which must not open another session
                frame[4 : 4 + size] = bytes([0, 2, 0xAB, 0xAB, 0xAB, 0xAB])
            frames.append(bytes(frame[: finish_frame(frame, HEADER + size, crc32_into, key)]))
    return frames


@pytest.mark.parametrize(
    ("bytes_", "mutations", "requests"),
    [
        pytest.param(60_000, 6_000, 2_000, id="quick", marks=pytest.mark.slow),
        pytest.param(1_000_000, 100_000, 30_000, id="full", marks=pytest.mark.slow),
    ],
)
def test_no_bytes_harm_the_firmware(micropython, bytes_, mutations, requests):
    """No exception, no frame taken that was not sent, the next good frame understood, the heap as before."""
    script = SCRIPT.format(seed=1, bytes=bytes_, mutations=mutations, requests=requests, right_size=2 + 2 * 7)
    said = micropython(script, stdin="\n".join(frame.hex() for frame in valid_frames()), timeout=600)
    print(said)
    lines = dict(line.split(maxsplit=1) for line in said.splitlines())
    missed, accepted, bad = map(int, lines["random"].split())
    assert missed == 0
    assert accepted == bytes_ // 2000, "of random bytes only the good frames between them are taken"
    assert bad > bytes_ // 500
    missed, accepted, bad = map(int, lines["mutated"].split())
    assert missed == 0
    assert accepted < mutations / 4
    assert bad > mutations / 3
    assert lines["requests"] == "0 False"
    assert lines["forged"] == "0"
    assert lines["exceptions"] == "0 0"
    before, after = map(int, lines["heap"].split())
    assert after == before
    assert messages.TELEMETRY == 0x07


@pytest.mark.medium
def test_every_well_formed_frame_is_answered_once(rig):
    """Here, where an integer too large for its place is an exception: any id, any payload."""
    chance = random.Random(2)
    fitting = [2 * rig.board.BUBBLES + 2, 3 + 4 * 20, 1, 2, 4]
    frame = bytearray(FRAME_MAX)
    for _ in range(2000):
        size = chance.choice([*fitting, chance.randrange(248)])
        message_id = chance.choice([chance.randrange(16), chance.randrange(256)])
        put_header(frame, message_id, rig.app.server.window.expected)
        largest = chance.choice([8, 64, 256])
        frame[4 : 4 + size] = bytes(chance.randrange(largest) for _ in range(size))
        if message_id == messages.HELLO:  # which must not open another session
            frame[6:10] = rig.session.to_bytes(4, "little") if size >= 6 else bytes(4)
        rig.hal.to_device += frame[: finish_frame(frame, HEADER + size, crc32_into, rig.key)]
        rig.tick(2)
        answers = [message for message in rig.heard() if message.id != messages.TELEMETRY]
        assert len(answers) == 1
    assert rig.app.stats.exceptions == 0
