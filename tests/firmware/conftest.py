"""The firmware in this interpreter, on hardware that follows a test's script."""

import struct
import zlib
from itertools import pairwise

import numpy as np
import pytest

from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.control.state_layout import ROW_WORDS, SETPOINT
from bubble_firmware.hal.base import Hal
from bubble_protocol import codec, steps
from bubble_protocol.schema import faults, messages, settings
from bubble_protocol.schema.messages import HELLO, PING
from bubble_protocol.schema.sequences import SEQUENCE_ENDED, STEP_BEGUN
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.link import message as wire
from bubbleskin.link.reader import Reader
from bubbleskin.sim import SimulatedBoard

SESSION = 0x89ABCDEF


class ScriptedHal(Hal):
    """A board by script: what is sensed is set, what is done is kept, the link is bytes both ways."""

    boot_id = 0xFEDCBA98

    def __init__(self, board):
        super().__init__(board)
        self.counts = [board.SENSOR_ZERO] * board.BUBBLES + [
            board.SUPPLY_ZERO + board.SUPPLY_PA // board.SUPPLY_PA_PER_COUNT
        ]
        self.to_device = b""
        self.from_device = bytearray()
        self.pulses = None
        self.pump = self.dump = None
        self.safe = False  # whether the outputs are
        self.noise = 0
        self.noisy = True
        self.sags = True
        self.taken = 0
        self.full = False  # no room for what is sent
        self.broken = set()  # names of methods that raise

    def _use(self, name):
        if name in self.broken:
            raise OSError(f"{name} is broken")

    def read_sensors(self, counts):
        """A sensor has noise: now and then a count more, where that is none of the ends."""
        self._use("read_sensors")
        self.noise = (self.noise + 1) % 8
        more = self.noise == 0 and self.noisy
        counts[:] = type(counts)("H", [count + (more and 8 < count < 4000) for count in self.counts])
        if self.sags and self.pulses and any(self.pulses[::2]):  # what bubbles take shows in the reservoir
            self.taken = (self.taken + 1) % 16
            counts[-1] = max(counts[-1] - 10 * self.taken, 9) if counts[-1] > 9 else counts[-1]

    def write_outputs(self, pulses, pump, dump):
        self._use("write_outputs")
        self.pulses, self.pump, self.dump, self.safe = pulses.tolist(), pump, dump, False

    def safe_outputs(self):
        self.pulses, self.pump, self.dump, self.safe = None, 0, False, True

    def receive(self, buffer):
        self._use("receive")
        data, self.to_device = self.to_device[: len(buffer)], self.to_device[len(buffer) :]
        buffer[: len(data)] = data
        return len(data)

    def send(self, frame, length):
        self._use("send")
        if self.full:
            return False
        self.from_device += frame[:length]
        return True


class Rig:
    """An `App` on such hardware."""

    def __init__(self, name):
        self.board = boards.load(name)
        self.hal = ScriptedHal(self.board)
        self.app = App(self.board, self.hal)
        self._reader = Reader()
        self._sequence = 0
        self.open(SESSION)

    def open(self, session):
        """Open a session, without a tick; the greeting."""
        self.hal.to_device += wire.encode("HELLO", 0, (PROTOCOL_MIN, PROTOCOL_MAX, session))
        self.app.server.poll()
        self.session = session
        self.key = wire.session_key(self.hal.boot_id, session)
        self._reader.use(self.key)
        self._sequence = 0
        return self.heard()[-1]

    def encode(self, name, sequence, fixed=(), repeated=()):
        """A frame of the open session."""
        return wire.encode(name, sequence, fixed, repeated, self.key)

    def tick(self, ticks=1):
        """Let periods pass, with a host that lives."""
        for _ in range(ticks):
            self.app.deadman.host_activity()
            self.app.tick()

    def heard(self):
        """All messages since the last time."""
        messages = list(self._reader.feed(bytes(self.hal.from_device)))
        self.hal.from_device.clear()
        return messages

    def next_sequence(self, message_id):
        """The number of the next request; HELLO and PING are outside the order and take none."""
        if message_id in (HELLO, PING):
            return 0xF00D
        self._sequence = (self._sequence + 1) & 0xFFFF
        return self._sequence

    def ask(self, name, fixed=(), repeated=()):
        """Send a request, tick once; the one answer."""
        sequence = self.next_sequence(codec.BY_NAME[name].id)
        self.hal.to_device += self.encode(name, sequence, fixed, repeated)
        self.heard()
        self.tick()
        (answer,) = self.heard()
        assert answer.sequence == sequence
        return answer

    def refused(self, name, fixed=(), repeated=()):
        """Send a request that must be refused: (error, field, element, asked, low, high)."""
        answer = self.ask(name, fixed, repeated)
        assert answer.id == codec.BY_NAME["ERROR"].id, f"{name} was not refused"
        assert answer["request"] == codec.BY_NAME[name].id
        return tuple(answer[field] for field in ("error", "field", "element", "asked", "low", "high"))

    def show(self, *heights_um, over_ms=0):
        """Ask for heights; one is for all bubbles."""
        heights = heights_um if len(heights_um) > 1 else heights_um * self.board.BUBBLES
        answer = self.ask("SHOW", (over_ms,), [(height,) for height in heights])
        assert answer.id == codec.BY_NAME["SHOW_REPLY"].id

    def clear(self):
        """Ask for CLEAR and wait until what it acknowledges has been isolated for long enough."""
        self.tick(self.isolation_ticks(self.ask("CLEAR")))

    def isolation_ticks(self, answer):
        """How many more ticks what CLEAR or FAULTS_ACK acknowledges stays isolated, by their answer."""
        return -(-answer["isolated_ms"] * 1000 // self.board.TICK_US)

    def state(self):
        """STATE's columns."""
        return self.ask("STATE").columns

    def sense(self, bubble, pascals):
        """What a bubble's sensor reads from now on."""
        self.hal.counts[bubble] = self.board.SENSOR_ZERO + round(pascals / self.board.SENSOR_PA_PER_COUNT)

    def supply(self, pascals):
        """What the reservoir's sensor reads from now on; it gets there no faster than air flows, tick by tick."""
        target = self.board.SUPPLY_ZERO + pascals // self.board.SUPPLY_PA_PER_COUNT
        while abs(target - self.hal.counts[-1]) > 160:
            self.hal.counts[-1] += 160 if target > self.hal.counts[-1] else -160
            self.tick()
        self.hal.counts[-1] = target

    def pulse(self, bubble):
        """(fill, vent) of the coming period, µs."""
        return tuple(self.hal.pulses[2 * bubble : 2 * bubble + 2])

    def write_table(self, bubble, knots, part=48):
        """Send a table in parts; the answers."""
        edges = [*range(0, len(knots), part), len(knots)]
        return [
            self.ask("TABLE_WRITE", (bubble, start, len(knots)), knots[start:end]).id for start, end in pairwise(edges)
        ]


@pytest.fixture(params=["wristband7", "wristband19"])
def rig(request):
    return Rig(request.param)


@pytest.fixture(scope="session")
def new_rig():
    """Makes rigs, for tests that need one for each example."""
    return Rig


@pytest.fixture
def rig7():
    return Rig("wristband7")


class Sequencer:
    """Sends sequences to a rig, and reads what it tells of them."""

    def __init__(self, rig):
        self.rig = rig
        self.n = rig.board.BUBBLES
        self.id = 7
        self.size = steps.HEAD + self.n
        self.told = []

    @staticmethod
    def step(*targets, ramp=0, after=0, tolerance=None, timeout=0, then=steps.GO_ON, easing=steps.LINEAR):
        """One record: targets in µm, times in ms; with a tolerance it waits until settled."""
        if tolerance is None:
            return [steps.flags(easing, steps.TIME, 0), ramp, after, 0, *targets]
        return [steps.flags(easing, steps.SETTLE, then), ramp, timeout, tolerance, *targets]

    def record(self, words):
        return (
            (words + [0] * self.size)[: self.size]
            if len(words) < 5
            else words[:4] + words[4:] * (self.n if len(words) == 5 else 1)
        )

    def repeat(self, times):
        return self.record([steps.REPEAT, times])

    def end(self):
        return self.record([steps.END])

    def all(self, um, **how):
        return self.record(self.step(um, **how))

    def ask(self, name, *fixed, repeated=()):
        """The answer to a request; events that come with it are kept."""
        rig = self.rig
        rig.hal.to_device += rig.encode(name, rig.next_sequence(codec.BY_NAME[name].id), fixed, repeated)
        self.listen()
        rig.app.tick()
        return self.listen()

    def listen(self):
        answer = None
        for message in self.rig.heard():
            if message.id == messages.SEQUENCE_EVENT:
                self.told.append(message)
            else:
                answer = message
        return answer

    def refusal(self, name, *fixed, repeated=()):
        answer = self.ask(name, *fixed, repeated=repeated)
        assert answer.id == messages.ERROR, f"{name} was not refused"
        return tuple(answer[field] for field in ("error", "field", "element", "asked", "low", "high"))

    def begin(self, total, crc=0, board=0, bubbles=None):
        return self.ask("SEQUENCE_BEGIN", self.id, self.n if bubbles is None else bubbles, board, total, crc)

    def write(self, first, records):
        return self.ask("SEQUENCE_WRITE", self.id, first & 0xFFFF, repeated=[(w,) for r in records for w in r])

    def upload(self, records, total=None):
        words = [word for record in records for word in record]
        total = len(records) if total is None else total
        assert self.begin(total, zlib.crc32(struct.pack(f"<{len(words)}H", *words))).id != messages.ERROR
        most = 121 // self.size
        for first in range(0, len(records), most):
            assert self.write(first, records[first : first + most]).id != messages.ERROR

    def load(self, *records):
        self.upload(list(records))
        answer = self.ask("SEQUENCE_ARM", self.id)
        assert answer.id == messages.SEQUENCE_ARM | messages.REPLY

    def start(self, at=0):
        answer = self.ask("SEQUENCE_START", self.id, at)
        assert answer.id == messages.SEQUENCE_START | messages.REPLY
        return answer["start_ticks"]

    def play(self, *records):
        self.load(*records)
        return self.start()

    def tick(self, ticks=1):
        for _ in range(ticks):
            self.rig.tick()
            answer = self.listen()
            assert answer is None

    def until_ended(self, most=20000):
        for _ in range(most):
            if self.told and self.told[-1]["event"] == SEQUENCE_ENDED:
                return
            self.tick()
        raise AssertionError("the sequence has not ended")

    @property
    def events(self):
        """(event, reason, record, tick) of all that was told."""
        return [(one["event"], one["reason"], one["record"], one["ticks"]) for one in self.told]

    def begun(self):
        return [one["ticks"] for one in self.told if one["event"] == STEP_BEGUN]

    def state(self):
        return self.ask("SEQUENCE_STATE").fields

    def setpoints(self):
        """µm, where the ramps are now."""
        rows = self.rig.app.bubbles.rows
        return [rows[i * ROW_WORDS + SETPOINT] / 16 for i in range(self.n)]


@pytest.fixture
def sequencer(rig):
    return Sequencer(rig)


@pytest.fixture
def seven(rig7):
    return Sequencer(rig7)


class Attacked:
    """A simulated board whose host clears every `pace` seconds and asks for one shape and another; what became of it."""

    ILL = 2  # the bubble that fails
    SHOW_TICKS = 130  # between two shapes

    def __init__(self, pace, heights_um, budget=None):
        self.board = SimulatedBoard(contact=False)
        self.app = self.board.firmware.app
        self.key = wire.session_key(self.board.firmware.boot_id, SESSION)
        self.number = 0
        self.pace = max(1, round(pace / self.board.tick_s))
        self.pressure_pa = np.zeros(self.board.data.BUBBLES)  # greatest, true
        self.height_mm = np.zeros(self.board.data.BUBBLES)
        self.supply_pa = 0.0
        self.above_pa_s = self.most_above_pa_s = 0.0
        self.seen = 0
        self.isolated = {}  # for how many ticks: of a bubble, and of the board, -1
        self.board.to_device += wire.encode("HELLO", 0, (PROTOCOL_MIN, PROTOCOL_MAX, SESSION))
        self.board.tick()
        if budget:
            self.send("SETTING_WRITE", (), [(settings.BUDGET_KPA_S, budget)])
        self.heights_um = heights_um
        self.show(0)
        self.run(1.0, attack=False)

    def check_isolation(self):
        """What has a fault is vented in the tick that finds it, and for long enough."""
        bubbles, faulty = self.app.bubbles, self.app.faults.board & faults.VENTING
        self.seen |= bubbles.faults(self.ILL)
        ill = {bubble for bubble in range(bubbles.count) if bubbles.faults(bubble)} | ({-1} if faulty else set())
        for bubble in range(bubbles.count):
            if bubble in ill or faulty:
                assert tuple(bubbles.pulses[2 * bubble : 2 * bubble + 2]) == (0, self.board.data.TICK_US)
        for gone in self.isolated.keys() - ill:
            assert self.isolated.pop(gone) * self.board.data.TICK_US >= faults.ISOLATION_MS * 1000
        for one in ill:
            self.isolated[one] = self.isolated.get(one, 0) + 1

    def send(self, name, fixed=(), repeated=()):
        self.number += 1
        self.board.to_device += wire.encode(name, self.number, fixed, repeated, self.key)

    def show(self, which):
        self.send("SHOW", (0,), [(self.heights_um[which],)] * self.board.data.BUBBLES)

    def run(self, seconds, attack=True):
        board, plant = self.board, self.board.plant
        for tick in range(round(seconds / board.tick_s)):
            if not tick % 20:
                self.send("PING", (0,))
                self.number -= 1  # PING takes no number
            if attack and not tick % self.pace:
                self.send("CLEAR")
            if attack and not tick % self.SHOW_TICKS:
                self.show(tick // self.SHOW_TICKS % len(self.heights_um))
            board.tick()
            board.from_device.clear()
            self.check_isolation()
            self.pressure_pa = np.maximum(self.pressure_pa, plant.pressure_pa)
            self.height_mm = np.maximum(self.height_mm, plant.height_mm)
            self.supply_pa = max(self.supply_pa, plant.supply_pa)
            self.above_pa_s += (plant.pressure_pa[self.ILL] - board.data.BUDGET_FREE_PA) * board.tick_s
            self.above_pa_s = max(self.above_pa_s, 0.0)
            self.most_above_pa_s = max(self.most_above_pa_s, self.above_pa_s)


@pytest.fixture(scope="session")
def attack():
    """Makes attacked boards."""
    return Attacked
