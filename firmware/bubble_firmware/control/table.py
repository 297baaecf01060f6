"""Height to pressure tables, one per bubble: knots of (height µm, gauge pressure Pa), straight lines between.

Two sets: the one in use and the one being received. A commit checks the received set whole and swaps.
"""

from array import array

from bubble_firmware.control.nominal import KNOTS as NOMINAL
from bubble_protocol.crc import crc32_on

KNOTS_MAX = 64
KNOT_BYTES = 4
HEIGHT_MAX_UM = 16000  # beyond, the air of a bubble no longer fits the arithmetic of `bubbles`


class Tables:
    """All bubbles' tables: `knots` and `sizes` in use, and a second set that `write` fills and `commit` takes up."""

    def __init__(self, bubbles: int):
        self.bubbles = bubbles
        self.knots = bytearray(bubbles * KNOTS_MAX * KNOT_BYTES)
        self.sizes = array("i", bytearray(4 * bubbles))
        self.crc = 0  # made once by `swap`: handing on an integer, however long, allocates nothing
        self._received = bytearray(len(self.knots))
        self._crc = array("i", (0,))
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

    def pressures(self, bubble: int) -> "tuple[int, int]":
        """The least and the greatest pressure in a table in use, Pa."""
        start = bubble * KNOTS_MAX * KNOT_BYTES
        knots = self.knots
        least = most = knots[start + 2] | knots[start + 3] << 8
        for at in range(start, start + self.sizes[bubble] * KNOT_BYTES, KNOT_BYTES):
            pressure = knots[at + 2] | knots[at + 3] << 8
            least = min(least, pressure)
            most = max(most, pressure)
        return least, most

    def first_flaw(self, height_max_um: int, pressure_max_pa: int) -> int:
        """Where the received set cannot be used: bubble * KNOTS_MAX + knot, or -1 where all is well.

        Heights must rise, the last must reach `height_max_um`, pressures must stay within `pressure_max_pa`.
        """
        received = self._received
        for bubble in range(self.bubbles):
            before = 0
            size = self._received_sizes[bubble]
            for index in range(size):
                at = (bubble * KNOTS_MAX + index) * KNOT_BYTES
                height = received[at] | received[at + 1] << 8
                pressure = received[at + 2] | received[at + 3] << 8
                if height <= before or pressure > pressure_max_pa:
                    return bubble * KNOTS_MAX + index
                before = height
            if before < height_max_um or before > HEIGHT_MAX_UM:
                return bubble * KNOTS_MAX + size - 1
        return -1

    def received_crc(self) -> int:
        """CRC-32 of the received set, as a signed word: per bubble its knots as (u16 µm, u16 Pa)."""
        self._crc[0] = 0
        for bubble in range(self.bubbles):
            start = bubble * KNOTS_MAX * KNOT_BYTES
            crc32_on(self._received, start, start + self._received_sizes[bubble] * KNOT_BYTES, self._crc)
        return self._crc[0]

    def swap(self) -> None:
        """Use the received set; what is received next starts from a copy of it."""
        self.crc = self.received_crc()
        self.knots[:] = self._received
        self.sizes[:] = self._received_sizes
