"""Two slots of flash that keep tables, settings and figures: power may fail at any moment, one whole record stays.

A record is a header, the sections of `record`, and the CRC-32 of all of it. A save writes the slot that is not in use: it
erases its sectors, programs all pages but the first, reads back, and programs the first, which holds the header, last. Until
then the slot is not valid, and the other one has not been touched. The header, by byte:

    0   4  "bsst"             8  u32 length of the record         16  u32 erases of slot b, counting this
    4  u16 schema version    12  u32 erases of slot a, likewise   20  16 name of the board
    6  u16 generation, wraps                                      36  CRC-32 of the header up to here

The header never changes; all else may with the schema version. `flash` is what the board's hands give: `size`,
`read(offset, page)`, `erase(offset)` of a sector, which sets all bits, `program(offset, page)`, which clears bits.
"""

from array import array

from bubble_firmware.store.record import SCHEMA, Content
from bubble_protocol.buffers import copy, get16, get32, put16, put32, same
from bubble_protocol.crc import crc32_into
from bubble_protocol.mpy_compat import const
from bubble_protocol.schema.errors import STORE_FAILED, STORE_FOREIGN
from bubble_protocol.schema.store import (
    DAMAGED,
    FACTORY,
    FOREIGN,
    NO_STORE,
    SLOT_A,
    SLOT_BLANK,
    SLOT_CORRUPT,
    SLOT_FOREIGN,
    SLOT_REJECTED,
    SLOT_VALID,
)

SECTOR = const(4096)
PAGE = const(256)

_MAGIC = b"bsst"
_NAME = const(20)
_HEADER_CRC = const(36)
HEADER = const(40)
_CRC = const(4)
_GENERATIONS = const(0x10000)


class Store:
    """The store of `app` on `flash`, None where the board has none. Made once at boot; it then has loaded what is there."""

    def __init__(self, app, flash):
        self._flash = flash
        self._content = Content(app)
        self._record = bytearray(HEADER + self._content.size_max + _CRC)
        self._page = bytearray(PAGE)
        self._blank = b"\xff" * PAGE
        self._crc = bytearray(_CRC)
        self._name = (app.board.NAME.encode() + bytes(16))[:16]
        self._slot = -1  # whose record is in use
        self.capacity = flash.size // 2 if flash else 0
        self.states = bytearray(2)
        self.generation = 0
        self.schema = SCHEMA
        self.length = 0
        self.wear = array("i", (0, 0))
        self.tables_crc = 0
        self.error = 0 if flash else STORE_FAILED
        self.source = NO_STORE
        if flash:
            try:
                self._load()
            except Exception:  # a store must not keep a wristband from booting
                self._content.use_defaults()
                self.source = DAMAGED
        self.tables_crc = app.tables.crc
        self._tables = app.tables

    def save(self):
        """Store what is in use. False, with `error`, where that cannot be; what was stored then still is."""
        if not self._ready():
            return False
        end = self._content.write(self._record, HEADER)
        keep = self._kept()
        if keep >= 0 and self._stands_in(keep, end):  # sending it twice wears nothing
            return True
        return self._commit(keep, end)

    def reset(self):
        """Use the defaults again and store in both slots that it is so. False, with `error`, where the flash fails."""
        if not self._flash:
            return False
        self.error = 0
        for _ in range(2):
            self._look_at_both()
            if not self._commit(self._kept(), HEADER):
                return False
        self._content.use_defaults()
        self.tables_crc = self._tables.crc
        self.source = FACTORY
        return True

    def _ready(self):
        """Whether there is a store that may be written."""
        self.error = 0
        if self.capacity < len(self._record):
            self.error = STORE_FAILED
        else:
            self._look_at_both()
            if self.states[0] == SLOT_FOREIGN or self.states[1] == SLOT_FOREIGN:
                self.error = STORE_FOREIGN
        return not self.error

    # Reading.

    def _load(self):
        """Take up the newest record that is whole and that the board allows."""
        self._look_at_both()
        slot = self._newest()
        while slot >= 0:
            length = self._read(slot)
            if self._content.take(self._record, HEADER, length - _CRC):
                self._note(slot, length)
                self.source = SLOT_A + slot if length > HEADER + _CRC else FACTORY
                return
            self.states[slot] = SLOT_REJECTED
            slot = self._newest()
        states = self.states
        if states[0] == SLOT_FOREIGN or states[1] == SLOT_FOREIGN:
            self.source = FOREIGN
        elif states[0] == SLOT_BLANK and states[1] == SLOT_BLANK:
            self.source = FACTORY
        else:
            self.source = DAMAGED

    def _note(self, slot, length):
        """The record in `self._record`, as it stands in `slot`, is the one in use."""
        record = self._record
        self._slot = slot
        self.length = length
        self.schema = get16(record, 4)
        self.generation = get16(record, 6)

    def _look_at_both(self):
        for slot in range(2):
            self.states[slot] = self._look(slot)

    def _look(self, slot):
        """What a slot holds."""
        page = self._page
        self._flash.read(slot * self.capacity, page)
        if same(page, 0, self._blank, 0, PAGE):
            return SLOT_BLANK
        crc32_into(page, 0, _HEADER_CRC, self._crc, 0)
        if not (same(page, 0, _MAGIC, 0, 4) and same(self._crc, 0, page, _HEADER_CRC, _CRC)):
            return SLOT_CORRUPT
        for index in range(2):  # the more the nearer to the truth
            self.wear[index] = max(self.wear[index], get32(page, 12 + 4 * index))
        if get16(page, 4) > SCHEMA or not same(page, _NAME, self._name, 0, 16):
            return SLOT_FOREIGN
        length = self._read(slot)
        if not length:
            return SLOT_CORRUPT
        crc32_into(self._record, 0, length - _CRC, self._crc, 0)
        return SLOT_VALID if same(self._crc, 0, self._record, length - _CRC, _CRC) else SLOT_CORRUPT

    def _read(self, slot):
        """Read a slot's record into `self._record`; its length, 0 where that is none."""
        page = self._page
        record = self._record
        start = slot * self.capacity
        self._flash.read(start, page)
        length = get32(page, 8)
        if length < HEADER + _CRC or length > len(record):
            return 0
        for at in range(0, length, PAGE):
            self._flash.read(start + at, page)
            copy(page, 0, record, at, min(PAGE, length - at))
        return length

    def _header(self, slot, at):
        """The word at byte `at` of a slot's header."""
        self._flash.read(slot * self.capacity, self._page)
        return get16(self._page, at)

    def _newest(self):
        """The newer one of the slots that are whole, -1 where there is none."""
        states = self.states
        if states[0] == SLOT_VALID and states[1] == SLOT_VALID:
            ahead = (self._header(1, 6) - self._header(0, 6)) % _GENERATIONS
            return 1 if 0 < ahead < _GENERATIONS // 2 else 0
        if states[0] == SLOT_VALID:
            return 0
        return 1 if states[1] == SLOT_VALID else -1

    def _kept(self):
        """The slot that must not be touched: the one in use while it is whole, else the newest, -1 where there is none."""
        if self._slot >= 0 and self.states[self._slot] == SLOT_VALID:
            return self._slot
        return self._newest()

    # Writing.

    def _stands_in(self, slot, end):
        """Whether the sections in `self._record[HEADER:end]` are the ones that `slot` holds, under this schema."""
        page = self._page
        start = slot * self.capacity
        if self._header(slot, 8) != end + _CRC or self._header(slot, 4) != SCHEMA:
            return False
        for at in range(0, end, PAGE):
            self._flash.read(start + at, page)
            first = HEADER if at == 0 else 0
            if not same(page, first, self._record, at + first, min(PAGE, end - at) - first):
                return False
        return True

    def _commit(self, keep, end):
        """Make `self._record[HEADER:end]` the newest record, in the slot that is not `keep`; whether it stands there."""
        slot = 1 - keep if keep >= 0 else 0
        newest = self._newest()
        generation = (self._header(newest, 6) + 1) % _GENERATIONS if newest >= 0 else 1
        if self.states[slot] != SLOT_VALID and self.wear[slot]:
            self.wear[slot] += 1  # what had been begun here and was cut short
        self.wear[slot] += 1
        self._seal(end, generation)
        length = end + _CRC
        start = slot * self.capacity
        self.states[slot] = SLOT_CORRUPT
        for at in range(0, length, SECTOR):
            self._flash.erase(start + at)
        at = (length - 1) // PAGE * PAGE
        while at >= 0:  # the first page, with the header, last
            if not self._program(start, at, length):
                self.error = STORE_FAILED
                return False
            at -= PAGE
        self.states[slot] = SLOT_VALID
        self._note(slot, length)
        self.source = SLOT_A + slot
        self.tables_crc = self._tables.crc
        return True

    def _seal(self, end, generation):
        """Put the header in front of the sections and the CRC behind."""
        record = self._record
        copy(_MAGIC, 0, record, 0, 4)
        put16(record, 4, SCHEMA)
        put16(record, 6, generation)
        put32(record, 8, end + _CRC)
        put32(record, 12, self.wear[0])
        put32(record, 16, self.wear[1])
        copy(self._name, 0, record, _NAME, 16)
        crc32_into(record, 0, _HEADER_CRC, record, _HEADER_CRC)
        crc32_into(record, 0, end, record, end)

    def _program(self, start, at, length):
        """Program one page of the record; whether it stands there."""
        page = self._page
        size = min(PAGE, length - at)
        copy(self._record, at, page, 0, size)
        for index in range(size, PAGE):
            page[index] = 0xFF
        self._flash.program(start + at, page)
        self._flash.read(start + at, page)
        return same(page, 0, self._record, at, size)
