"""The firmware in this interpreter, on hands that follow a test's script."""

from itertools import pairwise

import pytest

from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_protocol import codec
from bubbleskin.link import wire


class Hands:
    """A board's hands by script: what is sensed is set, what is done is kept, the link is bytes both ways."""

    boot_id = 0xFEDCBA98
    late_ticks = 0
    alarms = boot_faults = 0
    self_test = False

    def alive(self, mode, faults):
        pass

    def clear(self):
        pass

    def slack(self):
        pass

    def tidy(self):
        pass

    def restart(self, into):
        pass

    def __init__(self, board):
        self.counts = [board.SENSOR_ZERO] * board.BUBBLES + [
            board.SUPPLY_ZERO + board.SUPPLY_PA // board.SUPPLY_PA_PER_COUNT
        ]
        self.to_device = b""
        self.from_device = bytearray()
        self.pulses = None
        self.pump = self.dump = None
        self.in_vent = False
        self.noise = 0
        self.full = False  # no room for what is sent
        self.broken = set()  # names of hands that raise

    def _use(self, name):
        if name in self.broken:
            raise OSError(f"{name} is broken")

    def sense(self, counts):
        """A sensor has noise: now and then a count more, where that is none of the ends."""
        self._use("sense")
        self.noise = (self.noise + 1) % 8
        more = self.noise == 0
        counts[:] = type(counts)("H", [count + (more and 8 < count < 4000) for count in self.counts])

    def act(self, pulses, pump, dump):
        self._use("act")
        self.pulses, self.pump, self.dump, self.in_vent = pulses.tolist(), pump, dump, False

    def vent(self):
        self.pulses, self.pump, self.dump, self.in_vent = None, 0, False, True

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

    def phase_us(self):
        return 0


class Rig:
    """An `App` on such hands."""

    def __init__(self, name):
        self.board = boards.load(name)
        self.hands = Hands(self.board)
        self.app = App(self.board, self.hands)
        self._reader = wire.Reader()
        self._sequence = 0

    def tick(self, ticks=1):
        """Let periods pass, with a host that lives."""
        for _ in range(ticks):
            self.app.heard()
            self.app.tick()

    def heard(self):
        """All messages since the last time."""
        messages = list(self._reader.feed(bytes(self.hands.from_device)))
        self.hands.from_device.clear()
        return messages

    def ask(self, name, fixed=(), repeated=()):
        """Send a request, tick once; the one answer."""
        self._sequence += 1
        self.hands.to_device += wire.encode(name, self._sequence, fixed, repeated)
        self.heard()
        self.tick()
        (answer,) = self.heard()
        assert answer.sequence == self._sequence
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

    def state(self):
        """STATE's columns."""
        return self.ask("STATE").columns

    def sense(self, bubble, pascals):
        """What a bubble's sensor reads from now on."""
        self.hands.counts[bubble] = self.board.SENSOR_ZERO + round(pascals / self.board.SENSOR_PA_PER_COUNT)

    def pulse(self, bubble):
        """(fill, vent) of the coming period, µs."""
        return tuple(self.hands.pulses[2 * bubble : 2 * bubble + 2])

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
