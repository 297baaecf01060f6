"""The firmware in MicroPython, given what `hostile.py` sends: runs there, under `run(board)`.

A block of 256 bytes on stdin is one input: what it is (RAW bytes, a GOOD frame, one with a BAD CRC, a PAUSE), how far its
number is from the one whose turn it is plus 128, id, size, then the payload. The key and the number are put in here, so
that every frame is taken for one of the session that is open. stdin's end ends it.
"""

import gc
import sys

from following_hal import FollowingHal

from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, HEADER, finish_frame, put_header
from bubble_protocol.schema.messages import PING, REPLY

RAW, GOOD, BAD, PAUSE = range(4)
BLOCK = 256
HEAD = 4


class HostileHal(FollowingHal):
    """Its line is `line[at:length]`."""

    def __init__(self, board):
        super().__init__(board)
        self.line = bytearray(FRAME_MAX)
        self.length = self.at = self.sent = self.pongs = 0
        self.restarting = False

    def receive(self, buffer):
        """What is left of the line, as much as a tick takes."""
        line = self.line
        at = self.at
        size = min(self.length - at, len(buffer))
        for i in range(size):
            buffer[i] = line[at + i]
        self.at += size
        return size

    def send(self, frame, length):
        """Now and then there is no room."""
        self.sent += 1
        self.pongs += frame[1] == PING | REPLY  # a zero is hidden by the distance to the next: an id is none
        return self.sent & 63 != 0

    def restart(self, into):
        """After this tick."""
        self.restarting = True


def put(line, block, window):
    """Make the line of one input; its length."""
    what = block[0]
    size = block[3]
    for i in range(size):
        line[i if what == RAW else 1 + HEADER + i] = block[HEAD + i]
    if what == RAW:
        return size
    put_header(line, block[2], window.expected + block[1] - 128 & 0xFFFF)
    length = finish_frame(line, HEADER + size, crc32_into, window.key)
    if what == BAD:
        line[length - 2] ^= 1 if line[length - 2] != 1 else 2
    return length


class Attacked:
    """The firmware of a board, started again whenever it is asked to; what it has counted since the very first start."""

    def __init__(self, name):
        self.board = boards.load(name)
        self.hal = HostileHal(self.board)
        self.good = self.bad = self.exceptions = self.ticks = self.starts = 0
        self.lost = 0  # bytes that a start has kept, or given back, at the most
        self.used = 0  # bytes taken and not collected, at the most
        self.least = 1 << 30  # free after a start, at the least
        self.start()

    def start(self):
        """As `main.lockstep` does."""
        self.app = None
        gc.collect()
        self.app = App(self.board, self.hal)
        self.starts += 1
        self.free = 0

    def measure(self):
        """After a start: a tick first, because what is left on the stack of a start is taken for pointers to what it made."""
        self.app.tick()
        gc.collect()
        self.free = gc.mem_free()
        self.least = min(self.least, self.free)

    def take(self, block):
        """One input, and the ticks that it takes."""
        hal = self.hal
        if not self.free:
            self.measure()
        hal.at = 0
        hal.length = 0 if block[0] == PAUSE else put(hal.line, block, self.app.server.window)
        ticks = block[3] if block[0] == PAUSE else 1
        while ticks > 0 or hal.at < hal.length:
            self.app.tick()
            self.app.listen()
            ticks -= 1
            if hal.restarting:
                hal.restarting = False
                self.end()
                self.start()
                return
        self.used = max(self.used, self.free - gc.mem_free())

    def end(self):
        """Take over what this start has counted, and see that it has kept nothing."""
        app = self.app
        gc.collect()
        self.lost = max(self.lost, abs(self.free - gc.mem_free()))
        self.good += app.server.decoder.good
        self.bad += app.server.decoder.bad
        self.exceptions += app.stats.exceptions
        self.ticks += app.clock.ticks


def run(name):
    """Take all inputs; print what became of the heap, and of the firmware."""
    block = bytearray(BLOCK)
    stdin = sys.stdin.buffer
    gc.threshold(-1)  # as on the board: what is left behind stays until there is no room
    attacked = Attacked(name)
    while stdin.readinto(block) == BLOCK:
        attacked.take(block)
    hal = attacked.hal
    heard = 0
    for last in (b"\0\x80\0\1\0", b"\1\x80\2\4good"):  # what stands on the line ends; PING
        heard = hal.pongs
        attacked.take(last)
    answered = hal.pongs - heard
    attacked.end()
    print("heap", attacked.least, attacked.used, attacked.lost)
    print("answered", answered)
    print("exceptions", attacked.exceptions)
    print("frames", attacked.good, attacked.bad, hal.sent)
    print("ticks", attacked.ticks, hal.fills, hal.vents, hal.rests)
    print("starts", attacked.starts)
