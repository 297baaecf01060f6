"""One recorded trace, three interpreters: CPython, MicroPython's unix port and the RP2040 give the same commands.

What runs is the whole firmware but for its hardware: sensor counts and bytes of the link of every tick are those of
a recording, and of its outputs only a checksum is kept. On the RP2040 it is the frozen code of the UF2.
"""

import zlib
from array import array

import pytest

from bubble_firmware import boards
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import Skin
from bubbleskin.toolchain.frozen import BARE

pytestmark = pytest.mark.chip

REPLAY = """
import binascii
from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.hal.base import Hal

class Replay(Hal):
    def __init__(self, board):
        super().__init__(board)
        self.sum = 0
        self.counts = self.link = b""
    def read_sensors(self, counts):
        for i in range(len(counts)):
            counts[i] = self.counts[2 * i] | self.counts[2 * i + 1] << 8
    def write_outputs(self, pulses, pump, dump):
        self.sum = binascii.crc32(bytes((pump & 255, pump >> 8, 1 if dump else 0)), binascii.crc32(pulses))
    def safe_outputs(self):
        self.sum = 0
    def receive(self, buffer):
        for i in range(len(self.link)):
            buffer[i] = self.link[i]
        return len(self.link)

board = boards.load({board!r})
hal = Replay(board)
app = App(board, hal)

def replay(ticks):
    sums = []
    for counts, link in ticks:
        hal.counts = binascii.unhexlify(counts)
        hal.link = binascii.unhexlify(link)
        app.tick()
        sums.append("%08x" % hal.sum)
    print(" ".join(sums))
"""

TICKS = 240
CHUNK = 12  # ticks sent at once


class Recording:
    """A `Firmware` that notes what goes in and what comes out of another."""

    def __init__(self, name: str):
        self._firmware = InProcessFirmware(boards.load(name), boot_id=1)
        self.ticks: list[tuple[str, str]] = []
        self.sums: list[str] = []

    def tick(self, counts: array, link: bytes):
        outputs = self._firmware.tick(counts, link)
        self.ticks.append((counts.tobytes().hex(), link.hex()))
        tail = bytes([outputs.pump & 255, outputs.pump >> 8, outputs.dump])
        self.sums.append(f"{zlib.crc32(tail, zlib.crc32(outputs.pulses.tobytes())):08x}")
        return outputs

    def close(self):
        pass


@pytest.fixture(scope="module", params=["wristband7", "wristband19"])
def recording(request):
    """Differing bubbles take two shapes, hold, and one of them gets a leak."""
    recording = Recording(request.param)
    board = SimulatedBoard(request.param, seed=5, spread=0.08, firmware=recording)
    skin = Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, "recorded"), 2.0, simulated=board)))
    n = skin.info.bubbles
    skin.show([7.0 + 5.0 * i / n for i in range(n)], wait=False)
    skin.sleep(TICKS * 0.4 * board.tick_s)
    board.inject("leak", 2, 4e-7)
    skin.show([12.0 - 5.0 * i / n for i in range(n)], over=0.1, wait=False)
    skin.sleep(TICKS * 0.5 * board.tick_s)
    skin.stop()
    skin.sleep(TICKS * 0.2 * board.tick_s)
    del recording.ticks[TICKS:], recording.sums[TICKS:]
    assert len(set(recording.sums)) > TICKS / 4  # it is not all the same
    return request.param, recording


def chunks(ticks):
    return [f"replay({ticks[k : k + CHUNK]!r})\n" for k in range(0, len(ticks), CHUNK)]


@pytest.mark.promise("same-everywhere")
def test_micropython_gives_the_same_commands(recording, micropython):
    name, recorded = recording
    assert micropython(REPLAY.format(board=name) + "".join(chunks(recorded.ticks))).split() == recorded.sums


@pytest.mark.promise("same-everywhere")
def test_the_rp2040_gives_the_same_commands(recording, uf2):
    from bubbleskin.sim.rp2040.chip import Chip
    from bubbleskin.sim.rp2040.prompt import Prompt

    name, recorded = recording
    prompt = Prompt(Chip(uf2(BARE)))
    prompt.run(REPLAY.format(board=name))
    for number, chunk in enumerate(chunks(recorded.ticks)):
        first = number * CHUNK
        assert prompt.run(chunk).split() == recorded.sums[first : first + CHUNK], f"ticks from {first} on"
