"""On MicroPython the tick allocates nothing: a collection takes longer than a tick."""

import pytest

from bubble_firmware import boards
from bubbleskin.link import wire

SCRIPT = """
import gc, micropython
from bubble_firmware import boards
from bubble_firmware.app import App

class Hands:
    # Counts that follow the valves, with noise; the requests over and over, a few bytes in every tick.
    boot_id = 1
    late_ticks = 0
    alarms = boot_faults = 0
    self_test = False

    def __init__(self, board, requests):
        self.n = board.BUBBLES
        self.zero = board.SENSOR_ZERO
        self.level = bytearray(2 * self.n)
        self.flow = bytearray(self.n)  # what flows shows in the tube
        self.requests = requests
        self.at = 0
        self.noise = 1
        self.fills = self.vents = self.rests = self.sent = 0
        self.broken = False
        self.safe = 0

    def sense(self, counts):
        if self.broken:
            raise OSError(5)
        noise = self.noise
        level = self.level
        for i in range(self.n):
            noise = noise * 75 % 65537
            counts[i] = self.zero + (level[2 * i] | level[2 * i + 1] << 8) + (noise & 3) + self.flow[i]
        counts[self.n] = 2550 + (noise & 15)
        self.noise = noise

    def act(self, pulses, pump, dump):
        level = self.level
        for i in range(self.n):
            height = level[2 * i] | level[2 * i + 1] << 8
            fill = pulses[2 * i]
            vent = pulses[2 * i + 1]
            if fill:
                self.fills += 1
            elif vent:
                self.vents += 1
            else:
                self.rests += 1
            slow = 9 if height > 900 else 5
            height += (fill + 500 >> slow) - (vent + 500 >> slow)
            if height < 0:
                height = 0
            if height > 1900:
                height = 1900
            self.flow[i] = 0 if vent else 250 if fill else 90
            level[2 * i] = height & 255
            level[2 * i + 1] = height >> 8

    def vent(self):
        self.safe += 1

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

    def alive(self, mode, faults):
        pass

    def tidy(self):
        pass

    def slack(self):
        pass

    def restart(self, into):
        pass

    def clear(self):
        pass

    def phase_us(self):
        return 100

def ticks(app, count):
    while count:
        count -= 1
        micropython.heap_lock()
        app.tick()
        micropython.heap_unlock()

def measure(app, hands):
    hands.fills = hands.vents = hands.rests = hands.sent = 0
    before = gc.mem_alloc()
    ticks(app, {ticks})
    return gc.mem_alloc() - before

hands = Hands(boards.load({board!r}), bytes.fromhex({requests!r}))
app = App(boards.load({board!r}), hands)
ticks(app, 300)
gc.collect()
gc.disable()
grown = measure(app, hands)
decoder = app.session._decoder
print(grown, app.exceptions, decoder.good, hands.sent, hands.fills, hands.vents, hands.rests)

exceptions = app.exceptions
hands.broken = True
hands.safe = 0
print(measure(app, hands), app.exceptions - exceptions, hands.safe)
"""

ACTIVE = ("SUBSCRIBE", "SHOW up", "STATE", "PING", "INFO", "SHOW down", "PING", "STATE", "INFO", "CLEAR")
SEQUENCES = [
    pytest.param(ACTIVE, id="active"),
    pytest.param(("SHOW up", "HELLO", "STOP", "SHOW down", "VENT", "CLEAR", "TABLE_READ"), id="everything"),
    pytest.param(("SHOW up", "garbage", "too high", "wrong count", "wrong length", "unknown"), id="refused"),
    pytest.param(("TABLE_WRITE", "SHOW up", "STATE"), id="tables"),
    pytest.param(
        ("SHOW up", "FAULTS_READ", "SETTING_READ", "SETTING_WRITE", "no setting", "FAULTS_ACK", "VENT"), id="safety"
    ),
    pytest.param(("SHOW up", "PING", "long silence", "STATE"), id="deadman"),
]


def request(name, n):
    up = [(6000 + 900 * bubble % 8000,) for bubble in range(n)]
    down = [(13000 - 700 * bubble % 8000,) for bubble in range(n)]
    requests = {
        "SHOW up": lambda: wire.encode("SHOW", 1, (0,), up),
        "SHOW down": lambda: wire.encode("SHOW", 2, (300,), down),
        "PING": lambda: wire.encode("PING", 3, (0xFEDCBA98,)),
        "HELLO": lambda: wire.encode("HELLO", 4, (1, 1)),
        "SUBSCRIBE": lambda: wire.encode("SUBSCRIBE", 5, (20000 // boards.load(f"wristband{n}").TICK_US,)),  # 50 Hz
        "TABLE_READ": lambda: wire.encode("TABLE_READ", 6, (1, 10)),
        "TABLE_WRITE": lambda: wire.encode("TABLE_WRITE", 7, (1, 4, 60), [(9000, 65535)] * 40),
        "garbage": lambda: bytes(range(1, 200)) + b"\0",
        "too high": lambda: wire.encode("SHOW", 8, (0,), [(15000,)] * n),
        "wrong count": lambda: wire.encode("SHOW", 9, (0,), [(9000,)] * (n + 1)),
        "wrong length": lambda: wire.encode("HELLO", 10, (1, 1))[:-1] + b"\x01\0",
        "FAULTS_READ": lambda: wire.encode("FAULTS_READ", 13, (0,)),
        "FAULTS_ACK": lambda: wire.encode("FAULTS_ACK", 14, (3,)),
        "SETTING_WRITE": lambda: wire.encode("SETTING_WRITE", 15, (), [(0, 100), (1, 200)]),
        "no setting": lambda: wire.encode("SETTING_WRITE", 16, (), [(9, 100)]),
        "long silence": lambda: bytes(17 * 250),
        "unknown": lambda: wire.encode("PING_REPLY", 11, (0xFEDCBA98, 1, 1)),
    }
    return requests[name]() if name in requests else wire.encode(name, 12)


@pytest.mark.parametrize("sequence", SEQUENCES)
@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
def test_the_tick_allocates_nothing(micropython, board, sequence):
    n = boards.load(board).BUBBLES
    requests = b"".join(request(name, n) for name in sequence)
    said, failing = micropython(
        SCRIPT.format(board=board, requests=requests.hex(), bytes_per_tick=17, ticks=4000)
    ).splitlines()
    grown, exceptions, good, sent, fills, vents, rests = map(int, said.split())
    assert exceptions == 0, "MemoryError while the heap was locked"
    assert grown == 0
    few = 40 if "long silence" in sequence else 500
    assert good > few
    assert sent > few
    # Nor when every tick fails: what makes the outputs safe must not need memory, for that may be what failed.
    assert failing == "0 4000 4000"
    if sequence == ACTIVE:
        assert sent > good, "telemetry and every reply"
        assert min(fills, vents, rests) > 4000 * n // 20, "valves of both kinds are at work"
