# mypy: disable-error-code="attr-defined,union-attr,call-overload"
"""The USB serial port of MicroPython on the RP2040, read and written without ever waiting for the host.

`sys.stdin.buffer.readinto` waits until the buffer is full. It also takes bytes from an `os.dupterm` stream
as soon as the port has none, so a stream of filler bytes stands there: a read always returns at once, and
the stream's position tells how many bytes at the end are filler.

A write waits for as long as half a second when its 256 bytes of buffer are full. How full they are can
only be counted: they are empty when, after the USB stack has run, the IN endpoint's hardware buffers are
not AVAILABLE to the controller any more (RP2040 datasheet, 4.1.2.5.1), because the stack sends on from
its buffer for as long as that holds something.
"""

import io
import os
import sys

import micropython

from bubble_protocol.frame import copy
from bubble_protocol.mpy_compat import TYPE_CHECKING, ptr32

if TYPE_CHECKING:
    from collections.abc import Callable

_BUFFER = 256  # CFG_TUD_CDC_TX_BUFSIZE
_CHUNK = 63  # bytes read at once after the first
_FILLER = bytes(
    1024
)  # longer than what is read in one go after a rewind, and than any write, which goes through it too
_REWIND = 512


@micropython.viper
def _sending() -> int:
    """Whether the IN endpoint of the serial port, number 2, has something to send."""
    control = ptr32(0x50100000)  # endpoint buffer controls: IN and OUT of endpoint 0, 1, 2
    return control[0x90 >> 2] & 0x04000400  # AVAILABLE of both buffers


class UsbSerial:
    """`receive` and `send` for a board's `Hal`."""

    def __init__(self) -> None:
        micropython.kbd_intr(-1)  # a byte of 3 is a byte
        self._out = sys.stdout.buffer
        self._filler = io.BytesIO(_FILLER)
        self._filler.write(b"\0")  # from now on it has memory of its own
        self._waiting = 0
        os.dupterm(self._filler)

        # Defaults are locals, see `Bubbles`.
        def receive(
            buffer: bytearray,
            first: bytearray = bytearray(1),  # noqa: B008 - made once, and used by this port alone
            more: bytearray = bytearray(_CHUNK),  # noqa: B008
            filler: io.BytesIO = self._filler,
            readinto: "Callable[[bytearray], int]" = sys.stdin.buffer.readinto,
        ) -> int:
            """Put the bytes that have come at the start of `buffer`; returns how many."""
            at = filler.tell()
            if at > _REWIND:
                filler.seek(0)
                at = 0
            readinto(first)
            if self._waiting and not _sending():
                self._waiting = 0
            if filler.tell() != at:
                return 0
            readinto(more)
            count = _CHUNK - filler.tell() + at
            buffer[0] = first[0]
            copy(more, 0, count, buffer, 1)
            return 1 + count

        self.receive = receive

    def send(self, frame: bytearray, length: int) -> bool:
        """Send `frame[:length]` if there is room for all of it; says whether there was."""
        if self._waiting + length > _BUFFER:
            return False
        self._waiting += length
        self._filler.seek(0)
        self._out.write(frame, length)
        return True

    def close(self) -> None:
        """Give the port back to MicroPython's prompt."""
        os.dupterm(None)
        micropython.kbd_intr(3)
