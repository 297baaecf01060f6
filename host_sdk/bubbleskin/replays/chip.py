"""The firmware on the emulated RP2040 that lives through a full recording: frozen as on the board, at MicroPython's prompt.

Its hardware is a `Hal` that gives what was recorded. So the chip's own drivers have no part in it, and no time passes in a tick.
"""

from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from itertools import islice
from types import ModuleType

from bubble_firmware.hal.lockstep import LINK_OUT
from bubble_protocol.schema.faults import ESTOP
from bubbleskin import boards
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.replays.compare import Decided
from bubbleskin.replays.players import Player
from bubbleskin.sim.trace_file import LOOK, LOOP, POWER_FAILED, Call, Head
from bubbleskin.toolchain.frozen import BARE
from bubbleskin.toolchain.rp2040 import built, firmware

_BATCH = 12
"""Calls sent at once: their text has to fit beside the firmware."""
_PATIENCE = 60.0  # emulated seconds for a batch

_PROGRAM = """
import gc
from binascii import hexlify, unhexlify
from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.drivers.flash import Memory
from bubble_firmware.hal.base import Hal

class Recorded(Hal):
    def __init__(self, board):
        super().__init__(board)
        self.boot_id, self.boot_ticks = {boot_id}, {boot_ticks}
        self.flash = Memory({size})
        self.restarting = False
        self.counts = self.link = self.sent = b""
        self.phase = 0
        self.safe_outputs()
    def read_sensors(self, counts):
        for index in range(len(counts)):
            counts[index] = self.counts[2 * index] | self.counts[2 * index + 1] << 8
    def write_outputs(self, pulses, pump, dump):
        self.outputs = (bytes(pulses), pump, 1 if dump else 0)
    def safe_outputs(self):
        self.outputs = (b"\\0\\0\\xff\\xff" * self.board.BUBBLES, 0, 0)
    def receive(self, buffer):
        buffer[: len(self.link)] = self.link
        return len(self.link)
    def send(self, frame, length):
        if len(self.sent) + length > {link_out}:
            return False
        self.sent += bytes(frame[:length])
        return True
    def restart(self, into):
        self.restarting = True
    def phase_us(self):
        return self.phase

hal = Recorded(boards.load({board!r}))
app = None

def boot():
    global app
    app = None
    gc.collect()
    app = App(hal.board, hal)

def reset():
    hal.restarting = False
    hal.boot_id += 1
    boot()

def play(calls):
    for kind, phase, counts, link in calls:
        hal.phase = phase
        hal.counts, hal.link, hal.sent = unhexlify(counts), unhexlify(link), b""
        if kind == {reset}:
            reset()
            print()
            continue
        if kind == {loop}:
            hal.active_faults = hal.active_faults & ~{estop} | phase * {estop}
            print()
            continue
        if kind == {listen}:
            app.listen()
        else:
            app.tick()
        pulses, pump, dump = hal.outputs
        print(hexlify(pulses).decode(), pump, dump, hexlify(hal.sent).decode())
        if hal.restarting:
            reset()
"""


class ChipPlayer(Player):
    """This bubbleskin's firmware on an emulated chip, built where it has not been. `BubbleskinError` where that fails."""

    def __init__(self, head: Head, data: ModuleType):
        if find_spec("rp2040py") is None:
            raise BubbleskinError("A replay on rp2040 needs the emulator: pip install 'bubbleskin[emulator]'.")
        if boards.own_file(data):
            raise InvalidInput(
                f"The emulated chip has our own boards only, and {data.NAME} is yours; replay on cpython or micropython."
            )
        from bubbleskin.sim.rp2040.chip import Chip
        from bubbleskin.sim.rp2040.prompt import Prompt

        self._prompt = Prompt(Chip(built(BARE) or firmware([BARE])[BARE]))
        self._prompt.run(
            _PROGRAM.format(
                boot_id=head.boot_id,
                boot_ticks=head.boot_ticks,
                size=len(head.flash),
                board=data.NAME,
                link_out=LINK_OUT,
                reset=POWER_FAILED,
                listen=LOOK,
                loop=LOOP,
                estop=ESTOP,
            )
        )
        for offset in range(0, len(head.flash), 256):
            page = head.flash[offset : offset + 256]
            if page.strip(b"\xff"):
                self._prompt.run(f"hal.flash.image[{offset}:{offset + 256}] = unhexlify('{page.hex()}')\n")
        self._prompt.run("boot()\n", _PATIENCE)

    def play(self, calls: Iterable[Call]) -> Iterator[tuple[Call, Decided]]:
        """See `Player`."""
        coming = iter(calls)
        while batch := list(islice(coming, _BATCH)):
            given = [(call.kind, call.phase_us, call.counts.hex(), call.link.hex()) for call in batch]
            lines = self._prompt.run(f"play({given!r})\n", _PATIENCE).split("\n")
            for call, line in zip(batch, lines, strict=False):
                yield call, _decided(line)

    def close(self) -> None:
        """Nothing to end: the emulator runs only when it is stepped."""


def _decided(line: str) -> Decided:
    if not line:
        return Decided((), 0, False, b"")
    pulses, pump, dump, sent = line.split(" ")
    words = memoryview(bytes.fromhex(pulses)).cast("H")
    return Decided(tuple(words), int(pump), dump == "1", bytes.fromhex(sent))
