"""A board whose hardware is at the other end of a pipe, in lockstep: a tick begins when its input has come.

All words are little-endian and blocks have a fixed size, the link's bytes at their end:
    into the firmware, per tick: u16 size of the link's bytes, u16 counts (per bubble, then the supply's), LINK_IN bytes
        with LISTEN_ONLY in the size, no period has begun: the first count is then the time since the last one did, in µs
    out of it, per block: u16 size of the link's bytes, u16 pulses (fill and vent per bubble), u16 pump, u16 dump, LINK_OUT bytes
A size of 0xFFFF into the firmware has no answer: power fails and comes back.
"""

import sys

from bubble_firmware.drivers.flash import SECTOR, Memory
from bubble_firmware.hal.base import LISTEN, Hal
from bubble_protocol.buffers import copy, put16
from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from array import array
    from types import ModuleType

LINK_IN = 256
"""Bytes of the link that the firmware takes in one tick."""
LINK_OUT = 1024
LISTEN_ONLY = 0x8000
RESET = 0xFF
_FLASH = 4 * SECTOR


class LockstepHal(Hal):
    """The hardware of `board`, on stdin and stdout of this interpreter. `ended`: the pipe has closed."""

    def __init__(self, board: "ModuleType", boot_id: int, boot_ticks: int = -1):
        super().__init__(board)
        bubbles = board.BUBBLES
        self.boot_id = boot_id
        self.boot_ticks = boot_ticks
        self.flash = Memory(_FLASH)
        self.ended = False
        self._restarting = False
        self._stdin = sys.stdin.buffer
        self._stdout = sys.stdout.buffer
        self._in = bytearray(2 + 2 * (bubbles + 1) + LINK_IN)
        self._out = bytearray(2 + 4 * bubbles + 4 + LINK_OUT)
        self._link_in = len(self._in) - LINK_IN
        self._link_out = len(self._out) - LINK_OUT
        self._sent = 0
        self._phase_us = 0
        self._answered = True

    def wait(self) -> int:
        """Hand over what the last block led to and wait for the next; 0 for a restart or when the pipe has closed."""
        if not self._answered:
            out = self._out
            put16(out, 0, self._sent)
            self._stdout.write(out)
            self._sent = 0
        self._answered = True
        block = self._in
        if not self._restarting:
            self.ended = self._stdin.readinto(block) != len(block)  # type: ignore[union-attr]
            self._restarting = block[0] == RESET and block[1] == RESET
        if self._restarting:
            self._restarting = False
            self.boot_id += 1
            return 0
        if self.ended:
            return 0
        self._answered = False
        if block[1] & LISTEN_ONLY >> 8:
            block[1] &= 255 - (LISTEN_ONLY >> 8)
            self._phase_us = block[2] | block[3] << 8
            return LISTEN
        self._phase_us = 0
        return 1

    def read_sensors(self, counts: "array[int]") -> None:
        """Fill in the counts of this tick."""
        block = self._in
        for index in range(len(counts)):
            at = 2 + 2 * index
            counts[index] = block[at] | block[at + 1] << 8

    def write_outputs(self, pulses: "array[int]", pump: int, dump: int) -> None:
        """Set the outputs of the next period."""
        out = self._out
        at = 2
        for index in range(len(pulses)):
            put16(out, at, pulses[index])
            at += 2
        put16(out, at, pump)
        put16(out, at + 2, 1 if dump else 0)

    def safe_outputs(self) -> None:
        """Fill closed, vent open, pump off."""
        out = self._out
        at = 2
        while at < self._link_out - 4:
            put16(out, at, 0)
            put16(out, at + 2, 65535)
            at += 4
        put16(out, at, 0)
        put16(out, at + 2, 0)

    def receive(self, buffer: bytearray) -> int:
        """Bytes that have come over the link."""
        block = self._in
        size = block[0] | block[1] << 8
        copy(block, self._link_in, self._link_in + size, buffer, 0)
        return size

    def send(self, frame: bytearray, length: int) -> bool:
        """Queue a frame; False where it does not fit."""
        if self._sent + length > LINK_OUT:
            return False
        copy(frame, 0, length, self._out, self._link_out + self._sent)
        self._sent += length
        return True

    def restart(self, into: int) -> None:
        """Start again when this tick has been handed over; flash stays as it is."""
        self._restarting = True

    def phase_us(self) -> int:
        """Time stands still within a tick; between ticks it is told."""
        return self._phase_us
