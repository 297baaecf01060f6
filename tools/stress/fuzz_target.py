"""What `tools/stress/fuzz.py` runs: bytes become frames with right CRCs, and bytes as they are, for the whole firmware.

An input is a row of steps. Each begins with a byte: below 128 it is the id of a request whose payload follows,
with the number whose turn it is; up to 191 the same with a number so many away from it; up to 223 bytes for the
decoder as they are; above, ticks without anything. A second byte is the length of what follows.
"""

from array import array

from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.control import state_layout as layout
from bubble_firmware.hal.base import Hal
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import FRAME_MAX, HEADER, PAYLOAD_MAX, finish_frame, put_header
from bubble_protocol.schema import messages

_SESSION = b"\xab\xcd\xef\x01"


class Device(Hal):
    """The firmware on a board at rest. `check` after each input."""

    def __init__(self) -> None:
        super().__init__(boards.load("wristband7"))
        self._in = b""
        self.sent: list[bytes] = []
        self._frame = bytearray(FRAME_MAX)
        self.pulses = array("H", [0] * 14)
        self.app = App(self.board, self)
        self.frame(messages.HELLO, 0, bytes((2, 2)) + _SESSION)

    def frame(self, message_id: int, number: int, payload: bytes) -> None:
        """Send one frame with a right CRC."""
        payload = payload[:PAYLOAD_MAX]
        put_header(self._frame, message_id, number & 0xFFFF)
        self._frame[4 : 4 + len(payload)] = payload
        key = self.app.server.window.key
        self.raw(bytes(self._frame[: finish_frame(self._frame, HEADER + len(payload), crc32_into, key)]))

    def raw(self, data: bytes) -> None:
        """Send bytes as they are. Of the tick only the link has its turn, where an exception is not caught."""
        self._in = data
        self.app.server.poll()

    def steps(self, data: bytes) -> None:
        """Do what an input says."""
        at = 0
        while at + 2 <= len(data):
            what, size = data[at], data[at + 1]
            rest = data[at + 2 : at + 2 + size]
            at += 2 + size
            expected = self.app.server.window.expected
            if what < 128:
                self.frame(what, expected, rest)
            elif what < 192:
                self.frame(rest[0] if rest else 0, expected + what - 160, rest[1:])
            elif what < 224:
                self.raw(rest)
            else:
                for _ in range(1 + what % 4):
                    self.app.tick()
            self.check()

    def check(self) -> None:
        """No exception, nothing beyond the limits."""
        app = self.app
        assert app.stats.exceptions == 0, "an exception in the tick"
        rows = app.bubbles.rows
        limit = self.board.HEIGHT_MAX_UM
        for row in range(0, layout.ROW_WORDS * self.board.BUBBLES, layout.ROW_WORDS):
            assert 0 <= rows[row + layout.TARGET] <= limit, "a target beyond the limit"
            assert rows[row + layout.SETPOINT] <= limit << 4, "a setpoint beyond the limit"
        assert max(self.pulses) <= self.board.TICK_US

    def answers(self) -> None:
        """Whatever has come before, PING is answered."""
        self.raw(b"\0")
        self.sent.clear()
        self.frame(messages.PING, 0, b"1234")
        assert any(frame[1] == messages.PING | messages.REPLY for frame in self.sent), "no answer"

    # The hardware.

    def write_outputs(self, pulses: array, pump: int, dump: int) -> None:
        self.pulses = pulses[:]

    def receive(self, buffer: bytearray) -> int:
        data, self._in = self._in[:256], self._in[256:]
        buffer[: len(data)] = data
        return len(data)

    def send(self, frame: bytearray, length: int) -> bool:
        self.sent.append(bytes(frame[:length]))
        return True


def one_input(data: bytes) -> None:
    """A fresh device takes it, and answers afterwards."""
    device = Device()
    device.steps(data)
    device.answers()
