"""What the store keeps, as bytes: tables, settings and trim, each a section of its own.

A section is u8 id, u8 zero, u16 length, content; all numbers are little-endian. Contents only ever grow at their ends, and
sections are only ever added: what an older record lacks is the default, what this firmware does not know makes the
record one of a newer schema.

    TABLES    per bubble u8 knots; then all bubbles' knots as u16 µm, u16 Pa
    SETTINGS  i32 each, in the order of the schema
    TRIM      per bubble u16 each, in the order of `trim`
"""

from array import array

from bubble_firmware.control import trim as trims
from bubble_firmware.control.table import KNOT_BYTES, KNOTS_MAX
from bubble_protocol.buffers import copy, get16, get32, put16, put32
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.control.table import Tables
    from bubble_firmware.control.trim import Trim
    from bubble_firmware.store.settings import Settings

SCHEMA = 1

_TABLES = const(1)
_SETTINGS = const(2)
_TRIM = const(3)
_SECTION = const(4)  # bytes of its head
_BUBBLE_KNOTS = KNOTS_MAX * KNOT_BYTES


class Content:
    """The sections of what is in use: `write` makes them, `take` takes them up, all or none, `use_defaults` does without."""

    def __init__(self, board: "ModuleType", tables: "Tables", bubbles: "Bubbles", trim: "Trim", settings: "Settings"):
        n = board.BUBBLES
        self.tables = tables
        self._board = board
        self._bubbles = bubbles
        self._trim = trim
        self._settings = settings
        self._trims = array("i", bytearray(4 * trims.COUNT * n))
        self._found = array("i", bytearray(8 * settings.count))
        self.size_max = 3 * _SECTION + n + n * _BUBBLE_KNOTS + 4 * settings.count + 2 * trims.COUNT * n

    def write(self, data: bytearray, at: int) -> int:
        """Write all sections to `data[at:]`; returns the index after them."""
        tables = self.tables
        start = at
        at += _SECTION
        for bubble in range(tables.bubbles):
            data[at] = tables.sizes[bubble]
            at += 1
        for bubble in range(tables.bubbles):
            size = tables.sizes[bubble] * KNOT_BYTES
            first = bubble * _BUBBLE_KNOTS
            copy(tables.knots, first, first + size, data, at)
            at += size
        start = at = _put_head(data, start, at, _TABLES)
        at += _SECTION
        for value in self._settings.values:
            put32(data, at, value)
            at += 4
        start = at = _put_head(data, start, at, _SETTINGS)
        at += _SECTION
        for bubble in range(tables.bubbles):
            self._trim.read(self._trims, bubble * trims.COUNT, bubble)
        for value in self._trims:
            put16(data, at, value)
            at += 2
        return _put_head(data, start, at, _TRIM)

    def take(self, data: bytearray, at: int, end: int) -> bool:
        """Take up the sections in `data[at:end]`, defaults for what they lack; whether the board allows them."""
        tables = self.tables
        tables.use_nominal()
        self._settings.use_defaults()
        for bubble in range(tables.bubbles):
            for number in range(trims.COUNT):
                self._trims[bubble * trims.COUNT + number] = self._trim.nominal[number]
        valid = True
        while valid and at < end:
            section = data[at]
            size = get16(data, at + 2)
            at += _SECTION
            valid = at + size <= end and self._take_section(section, data, at, size)
            at += size
        if valid:
            for bubble in range(tables.bubbles):
                self._trim.use(self._trims, bubble * trims.COUNT, bubble)
            tables.swap()
            self._bubbles.use_tables()
        else:
            self.use_defaults()
        return valid

    def use_defaults(self) -> None:
        """Take up what the firmware was made with."""
        self._settings.use_defaults()
        self._trim.use_nominal()
        self.tables.use_nominal()
        self._bubbles.use_tables()

    def _take_section(self, section: int, data: bytearray, at: int, size: int) -> bool:
        """Take one section, as far as this firmware knows it; whether the board allows it."""
        if section == _TABLES:
            return self._take_tables(data, at, at + size)
        if section == _SETTINGS:
            return self._take_settings(data, at, size)
        if section == _TRIM:
            return self._take_trim(data, at, size)
        return True

    def _take_tables(self, data: bytearray, at: int, end: int) -> bool:
        tables = self.tables
        sizes = at
        at += tables.bubbles
        for bubble in range(tables.bubbles):
            size = data[sizes + bubble]
            if size < 2 or size > KNOTS_MAX or at + size * KNOT_BYTES > end:
                return False
            tables.write_size(bubble, size)
            for index in range(size):
                tables.write_knot(bubble, index, get16(data, at), get16(data, at + 2))
                at += KNOT_BYTES
        return tables.first_flaw(self._board) < 0

    def _take_settings(self, data: bytearray, at: int, size: int) -> bool:
        settings = self._settings
        count = min(size // 4, settings.count)
        for index in range(count):
            self._found[2 * index] = index
            self._found[2 * index + 1] = get32(data, at + 4 * index)
        if not count:
            return True
        if settings.first_invalid(self._found, 0, count) >= 0:
            return False
        settings.use()
        return True

    def _take_trim(self, data: bytearray, at: int, size: int) -> bool:
        n = self._board.BUBBLES
        stride = size // (2 * n)  # words of one bubble in the record
        for bubble in range(n):
            to = bubble * trims.COUNT
            for number in range(min(stride, trims.COUNT)):
                self._trims[to + number] = get16(data, at + 2 * (bubble * stride + number))
            if stride == trims.SHORT:  # an older record: of both valves
                self._trim.widen(self._trims, to, to)
            if self._trim.invalid(self._trims, to) >= 0:
                return False
        return True


def _put_head(data: bytearray, start: int, end: int, section: int) -> int:
    """Write a section's head, once its end is known; returns the end."""
    data[start] = section
    data[start + 1] = 0
    put16(data, start + 2, end - start - _SECTION)
    return end
