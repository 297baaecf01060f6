"""What the store keeps of an app, as bytes: tables, settings and figures, each a section of its own.

A section is u8 id, u8 zero, u16 length, content; all numbers are little-endian. Contents only ever grow at their ends, and
sections are only ever added: what an older record lacks is the default, what this firmware does not know makes the
record one of a newer schema.

    TABLES    per bubble u8 knots; then all bubbles' knots as u16 µm, u16 Pa
    SETTINGS  i32 each, in the order of `app.settings.values`
    FIGURES   per bubble u16 each, in the order of `figures`
"""

from array import array

from bubble_firmware.control import trim
from bubble_firmware.control.table import KNOT_BYTES, KNOTS_MAX
from bubble_protocol.buffers import copy, get16, get32, put16, put32

SCHEMA = 1

_TABLES = 1
_SETTINGS = 2
_TRIM = 3
_SECTION = 4  # bytes of its head
_BUBBLE_KNOTS = KNOTS_MAX * KNOT_BYTES


class Content:
    """The sections of `app`: `write` makes them, `take` takes them up, all or none, `use_defaults` does without."""

    def __init__(self, app):
        self._app = app
        n = app.board.BUBBLES
        # Not every firmware has settings; those it was made with are the defaults.
        self._settings = app.settings.values if hasattr(app, "settings") else array("i")
        self._default_settings = array("i", self._settings)
        self._figures = array("i", bytearray(4 * trim.COUNT * n))
        self._found = array("i", bytearray(8 * len(self._settings)))
        self.size_max = 3 * _SECTION + n + n * _BUBBLE_KNOTS + 4 * len(self._settings) + 2 * trim.COUNT * n

    def write(self, data, at):
        """Write all sections to `data[at:]`; returns the index after them."""
        tables = self._app.tables
        start = at
        at += _SECTION
        for bubble in range(tables.bubbles):
            data[at] = tables.sizes[bubble]
            at += 1
        for bubble in range(tables.bubbles):
            size = tables.sizes[bubble] * KNOT_BYTES
            copy(tables.knots, bubble * _BUBBLE_KNOTS, data, at, size)
            at += size
        start = at = _head(data, start, at, _TABLES)
        at += _SECTION
        for value in self._settings:
            put32(data, at, value)
            at += 4
        start = at = _head(data, start, at, _SETTINGS)
        at += _SECTION
        self._app.figures.read(self._figures)
        for value in self._figures:
            put16(data, at, value)
            at += 2
        return _head(data, start, at, _TRIM)

    def take(self, data, at, end):
        """Take up the sections in `data[at:end]`, defaults for what they lack; whether the board allows them."""
        tables = self._app.tables
        tables.use_nominal()
        self._settings[:] = self._default_settings
        for bubble in range(tables.bubbles):
            for number in range(trim.COUNT):
                self._figures[bubble * trim.COUNT + number] = self._app.figures.nominal[number]
        fits = True
        while fits and at < end:
            section = data[at]
            size = get16(data, at + 2)
            at += _SECTION
            fits = at + size <= end and self._take_section(section, data, at, size)
            at += size
        if fits:
            self._app.figures.use(self._figures)
            tables.swap()
            self._app.bubbles.use_tables()
            self._app.use_settings()
        else:
            self.use_defaults()
        return fits

    def use_defaults(self):
        """Take up what the firmware was made with."""
        self._settings[:] = self._default_settings
        self._app.figures.use_nominal()
        self._app.tables.use_nominal()
        self._app.bubbles.use_tables()
        self._app.use_settings()

    def _take_section(self, section, data, at, size):
        """Take one section, as far as this firmware knows it; whether the board allows it."""
        if section == _TABLES:
            return self._take_tables(data, at, at + size)
        if section == _SETTINGS:
            return self._take_settings(data, at, size)
        if section == _TRIM:
            return self._take_figures(data, at, size)
        return True

    def _take_tables(self, data, at, end):
        tables = self._app.tables
        board = self._app.board
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
        return tables.first_flaw(board.HEIGHT_MAX_UM, board.PRESSURE_MAX_PA) < 0

    def _take_settings(self, data, at, size):
        count = min(size // 4, len(self._settings))
        for index in range(count):
            self._found[2 * index] = index
            self._found[2 * index + 1] = get32(data, at + 4 * index)
        if not count:
            return True
        settings = self._app.settings
        if settings.flaw(self._found, 0, count) >= 0:
            return False
        settings.use()
        return True

    def _take_figures(self, data, at, size):
        n = self._app.board.BUBBLES
        stride = size // (2 * n)  # words of one bubble in the record
        for bubble in range(n):
            for number in range(min(stride, trim.COUNT)):
                self._figures[bubble * trim.COUNT + number] = get16(data, at + 2 * (bubble * stride + number))
        return self._app.figures.first_flaw(self._figures) < 0


def _head(data, start, end, section):
    """Write a section's head, once its end is known; returns the end."""
    data[start] = section
    data[start + 1] = 0
    put16(data, start + 2, end - start - _SECTION)
    return end
