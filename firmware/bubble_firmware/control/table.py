"""Height to pressure tables, one per bubble: knots of (height µm, gauge pressure Pa), straight lines between.

Two sets: the one in use and the one being received. A commit checks the received set whole and swaps.
"""

from array import array

from bubble_firmware.control.nominal import KNOTS as NOMINAL
from bubble_protocol.buffers import copy
from bubble_protocol.crc import crc32_on
from bubble_protocol.mpy_compat import TYPE_CHECKING, const
from bubble_protocol.steps import copy_word

if TYPE_CHECKING:
    from types import ModuleType

# [constants] bubble_firmware.control.state_layout: used
_ATMOSPHERE = const(101325)
# [end of constants]

KNOTS_MAX = const(64)
KNOT_BYTES = const(4)  # a step of `range` that is no constant makes an object
HEIGHT_MAX_UM = 16000  # beyond, the air of a bubble no longer fits the arithmetic of `bubbles`


def pressure_top(board: "ModuleType") -> int:
    """The greatest gauge pressure, Pa, that a table may have at the board's greatest height: more, and its air is too much.

    AIR_MAX_UJ = (p + atmosphere) V, V of sphere and line, as `curve` reckons it.
    """
    square = board.HEIGHT_MAX_UM * board.HEIGHT_MAX_UM >> 12
    volume = ((square * board.HEIGHT_MAX_UM >> 12) * 2303 >> 12) + 64 * board.DEAD_VOLUME_MM3
    return (board.AIR_MAX_UJ * 4000 // volume << 4) - _ATMOSPHERE


class Tables:
    """All bubbles' tables: `knots` and `sizes` in use, of this `crc`, and a second set that is written to and then swapped in."""

    def __init__(self, bubbles: int):
        self.bubbles = bubbles
        self.knots = bytearray(bubbles * KNOTS_MAX * KNOT_BYTES)
        self.sizes = array("i", bytearray(4 * bubbles))
        self._received = bytearray(len(self.knots))
        self.crc = array("i", (0,))  # as words: an integer of MicroPython that is so long is an allocation
        self.received_crc = array("i", (0,))
        self._received_sizes = array("i", bytearray(4 * bubbles))
        self.use_nominal()

    def use_nominal(self) -> None:
        """Use the table of the bubble as the paper measured it, for all."""
        for bubble in range(self.bubbles):
            self.write_size(bubble, len(NOMINAL))
            for index in range(len(NOMINAL)):
                knot = NOMINAL[index]
                self.write_knot(bubble, index, knot[0], knot[1])
        self.swap()

    def write_size(self, bubble: int, size: int) -> None:
        """Announce how many knots a received table has."""
        self._received_sizes[bubble] = size

    def write_knot(self, bubble: int, index: int, height_um: int, pressure_pa: int) -> None:
        """Take one knot of a received table."""
        at = (bubble * KNOTS_MAX + index) * KNOT_BYTES
        received = self._received
        received[at] = height_um & 255
        received[at + 1] = height_um >> 8
        received[at + 2] = pressure_pa & 255
        received[at + 3] = pressure_pa >> 8

    def read_knot(self, bubble: int, index: int, values: "array[int]", at: int) -> None:
        """Put height and pressure of one knot in use at `values[at:at + 2]`."""
        byte = (bubble * KNOTS_MAX + index) * KNOT_BYTES
        knots = self.knots
        values[at] = knots[byte] | knots[byte + 1] << 8
        values[at + 1] = knots[byte + 2] | knots[byte + 3] << 8

    def read_pressures(self, bubble: int, values: "array[int] | memoryview", at: int) -> None:
        """Put the least and the greatest pressure in a table in use, Pa, at `values[at:at + 2]`."""
        start = bubble * KNOTS_MAX * KNOT_BYTES
        knots = self.knots
        least = most = knots[start + 2] | knots[start + 3] << 8
        for byte in range(start, start + self.sizes[bubble] * KNOT_BYTES, KNOT_BYTES):
            pressure = knots[byte + 2] | knots[byte + 3] << 8
            if pressure < least:
                least = pressure
            if pressure > most:
                most = pressure
        values[at] = least
        values[at + 1] = most

    def first_flaw(self, board: "ModuleType") -> int:
        """Where the received set cannot be used on `board`: bubble * KNOTS_MAX + knot, or -1 where all is well.

        Heights must rise and the last must reach the board's greatest. Pressures must stay within the board's, and at its
        greatest height within what its air allows, see `pressure_top`.
        """
        height_max_um = board.HEIGHT_MAX_UM
        pressure_max_pa = board.PRESSURE_MAX_PA
        pressure_top_pa = pressure_top(board)
        received = self._received
        for bubble in range(self.bubbles):
            before = 0
            lower = 0
            size = self._received_sizes[bubble]
            for index in range(size):
                at = (bubble * KNOTS_MAX + index) * KNOT_BYTES
                height = received[at] | received[at + 1] << 8
                pressure = received[at + 2] | received[at + 3] << 8
                if height <= before or pressure > pressure_max_pa:
                    return bubble * KNOTS_MAX + index
                if before < height_max_um <= height:
                    rise = (
                        (pressure - lower) * (height_max_um - before) // (height - before)
                        if before
                        else pressure - lower
                    )
                    if lower + rise > pressure_top_pa:
                        return bubble * KNOTS_MAX + index
                before = height
                lower = pressure
            if before < height_max_um or before > HEIGHT_MAX_UM:
                return bubble * KNOTS_MAX + size - 1
        return -1

    def check_received(self) -> None:
        """Work out `received_crc`, the CRC-32 of the received set as a signed word: per bubble its knots as (u16 µm, u16 Pa)."""
        self.received_crc[0] = 0
        for bubble in range(self.bubbles):
            start = bubble * KNOTS_MAX * KNOT_BYTES
            crc32_on(self._received, start, start + self._received_sizes[bubble] * KNOT_BYTES, self.received_crc)

    def swap(self) -> None:
        """Use the received set; what is received next starts from a copy of it."""
        self.check_received()
        copy_word(self.received_crc, 0, self.crc, 0)
        copy(self._received, 0, len(self._received), self.knots, 0)
        for bubble in range(self.bubbles):
            self.sizes[bubble] = self._received_sizes[bubble]
