"""Two slots of flash that keep tables, settings and trim: power may fail at any moment, one valid record stays.

A record is a header, the sections of `record`, and the CRC-32 of all of it. A save writes the slot that is not in use: it
erases its sectors, programs all pages but the first, reads back, and programs the first, which holds the header, last. Until
then the slot is not valid, and the other one has not been touched. The header, by byte:

    0   4  "bsst"             8  u32 length of the record         16  u32 erases of slot b, counting this
    4  u16 schema version    12  u32 erases of slot a, likewise   20  16 name of the board
    6  u16 generation, wraps                                      36  CRC-32 of the header up to here

The header never changes; all else may with the schema version. `flash` is the board's, see `hal.base`: `size`,
`read(offset, page)`, `erase(offset)` of a sector, which sets all bits, `program(offset, page)`, which clears bits.
"""

from array import array

from bubble_firmware.store.record import SCHEMA
from bubble_protocol.buffers import copy, get16, get32, put16, put32, same
from bubble_protocol.crc import crc32_into
from bubble_protocol.mpy_compat import TYPE_CHECKING, const
from bubble_protocol.steps import copy_word

if TYPE_CHECKING:
    from bubble_firmware.hal.base import Flash
    from bubble_firmware.store.record import Content

# [constants] bubble_firmware.drivers.flash: PAGE SECTOR
# [constants] bubble_protocol.frame: CRC
# [constants] bubble_protocol.schema.errors: STORE_FAILED STORE_FOREIGN
# [constants] bubble_protocol.schema.store: DAMAGED FACTORY FOREIGN NO_STORE SLOT_A
# [constants] bubble_protocol.schema.store: SLOT_BLANK SLOT_CORRUPT SLOT_FOREIGN SLOT_REJECTED SLOT_VALID
_PAGE = const(256)
_SECTOR = const(4096)
_CRC = const(4)
_STORE_FAILED = const(17)
_STORE_FOREIGN = const(16)
_DAMAGED = const(3)
_FACTORY = const(0)
_FOREIGN = const(4)
_NO_STORE = const(5)
_SLOT_A = const(1)
_SLOT_BLANK = const(0)
_SLOT_CORRUPT = const(2)
_SLOT_FOREIGN = const(3)
_SLOT_REJECTED = const(4)
_SLOT_VALID = const(1)
# [end of constants]

_MAGIC = b"bsst"
_SCHEMA = const(4)  # where each stands in the header
_GENERATION = const(6)
_LENGTH = const(8)
_WEAR = const(12)
_NAME = const(20)
_NAME_SIZE = const(16)
_HEADER_CRC = const(36)
_HEADER = const(40)  # bytes of it
_GENERATIONS = const(0x10000)


class Store:
    """The store of `content` on `flash`, None where the board has none. Made once at boot; it then has loaded what is there.

    `source`: where what is in use came from. `states`: of both slots. `generation`, `schema`, `length`: of the record in use.
    `wear`: erases of each slot. `tables_crc`: of the tables stored, a word. `error`: why the last `save` or `reset` was refused.
    """

    def __init__(self, name: str, flash: "Flash | None", content: "Content"):
        self._flash: "Flash" = flash  # type: ignore[assignment]
        self._content = content
        self._record = bytearray(_HEADER + self._content.size_max + _CRC)
        self._page = bytearray(_PAGE)
        self._blank = b"\xff" * _PAGE
        self._crc = bytearray(_CRC)
        self._name = (name.encode() + bytes(_NAME_SIZE))[:_NAME_SIZE]
        self._slot = -1  # whose record is in use
        self.capacity = flash.size // 2 if flash else 0
        self.states = bytearray(2)
        self.generation = 0
        self.schema = SCHEMA
        self.length = 0
        self.wear = array("i", (0, 0))
        self.tables_crc = array("i", (0,))
        self.error = 0 if flash else _STORE_FAILED
        self.source = _NO_STORE
        if flash:
            try:
                self._load()
            except Exception:  # a store must not keep a wristband from booting
                self._content.use_defaults()
                self.source = _DAMAGED
        copy_word(content.tables.crc, 0, self.tables_crc, 0)

    def save(self) -> bool:
        """Store what is in use. False, with `error`, where that cannot be; what was stored then still is."""
        if not self._ready():
            return False
        end = self._content.write(self._record, _HEADER)
        keep = self._protected()
        if keep >= 0 and self._matches(keep, end):  # sending it twice wears nothing
            return True
        return self._commit(keep, end)

    def reset(self) -> bool:
        """Use the defaults again and store in both slots that it is so. False, with `error`, where the flash fails."""
        if not self._flash:
            return False
        self.error = 0
        for _ in range(2):
            self._probe_both()
            if not self._commit(self._protected(), _HEADER):
                return False
        self._content.use_defaults()
        copy_word(self._content.tables.crc, 0, self.tables_crc, 0)
        self.source = _FACTORY
        return True

    def _ready(self) -> bool:
        """Whether there is a store that may be written."""
        self.error = 0
        if self.capacity < len(self._record):
            self.error = _STORE_FAILED
        else:
            self._probe_both()
            if self.states[0] == _SLOT_FOREIGN or self.states[1] == _SLOT_FOREIGN:
                self.error = _STORE_FOREIGN
        return not self.error

    # Reading.

    def _load(self) -> None:
        """Take up the newest record that is valid and that the board allows."""
        self._probe_both()
        slot = self._newest()
        while slot >= 0:
            length = self._read(slot)
            if self._content.take(self._record, _HEADER, length - _CRC):
                self._set_current(slot, length)
                self.source = _SLOT_A + slot if length > _HEADER + _CRC else _FACTORY
                return
            self.states[slot] = _SLOT_REJECTED
            slot = self._newest()
        states = self.states
        if states[0] == _SLOT_FOREIGN or states[1] == _SLOT_FOREIGN:
            self.source = _FOREIGN
        elif states[0] == _SLOT_BLANK and states[1] == _SLOT_BLANK:
            self.source = _FACTORY
        else:
            self.source = _DAMAGED

    def _set_current(self, slot: int, length: int) -> None:
        """The record in `self._record`, as it stands in `slot`, is the one in use."""
        record = self._record
        self._slot = slot
        self.length = length
        self.schema = get16(record, _SCHEMA)
        self.generation = get16(record, _GENERATION)

    def _probe_both(self) -> None:
        for slot in range(2):
            self.states[slot] = self._probe(slot)

    def _probe(self, slot: int) -> int:
        """What a slot holds."""
        page = self._page
        self._flash.read(slot * self.capacity, page)
        if same(page, 0, self._blank, 0, _PAGE):
            return _SLOT_BLANK
        crc32_into(page, 0, _HEADER_CRC, self._crc, 0)
        if not (same(page, 0, _MAGIC, 0, 4) and same(self._crc, 0, page, _HEADER_CRC, _CRC)):
            return _SLOT_CORRUPT
        for index in range(2):  # the more the nearer to the truth
            self.wear[index] = max(self.wear[index], get32(page, _WEAR + 4 * index))
        if get16(page, _SCHEMA) > SCHEMA or not same(page, _NAME, self._name, 0, _NAME_SIZE):
            return _SLOT_FOREIGN
        length = self._read(slot)
        if not length:
            return _SLOT_CORRUPT
        crc32_into(self._record, 0, length - _CRC, self._crc, 0)
        return _SLOT_VALID if same(self._crc, 0, self._record, length - _CRC, _CRC) else _SLOT_CORRUPT

    def _read(self, slot: int) -> int:
        """Read a slot's record into `self._record`; its length, 0 where that is none."""
        page = self._page
        record = self._record
        start = slot * self.capacity
        self._flash.read(start, page)
        length = get32(page, _LENGTH)
        if length < _HEADER + _CRC or length > len(record):
            return 0
        for at in range(0, length, _PAGE):
            self._flash.read(start + at, page)
            copy(page, 0, min(_PAGE, length - at), record, at)
        return length

    def _header(self, slot: int, at: int) -> int:
        """The word at byte `at` of a slot's header."""
        self._flash.read(slot * self.capacity, self._page)
        return get16(self._page, at)

    def _newest(self) -> int:
        """The newer one of the slots that are valid, -1 where there is none."""
        states = self.states
        if states[0] == _SLOT_VALID and states[1] == _SLOT_VALID:
            ahead = (self._header(1, _GENERATION) - self._header(0, _GENERATION)) % _GENERATIONS
            return 1 if 0 < ahead < _GENERATIONS // 2 else 0
        if states[0] == _SLOT_VALID:
            return 0
        return 1 if states[1] == _SLOT_VALID else -1

    def _protected(self) -> int:
        """The slot that must not be touched: the one in use while it is valid, else the newest, -1 where there is none."""
        if self._slot >= 0 and self.states[self._slot] == _SLOT_VALID:
            return self._slot
        return self._newest()

    # Writing.

    def _matches(self, slot: int, end: int) -> bool:
        """Whether the sections in `self._record[_HEADER:end]` are the ones that `slot` holds, under this schema."""
        page = self._page
        start = slot * self.capacity
        if self._header(slot, _LENGTH) != end + _CRC or self._header(slot, _SCHEMA) != SCHEMA:
            return False
        for at in range(0, end, _PAGE):
            self._flash.read(start + at, page)
            first = _HEADER if at == 0 else 0
            if not same(page, first, self._record, at + first, min(_PAGE, end - at) - first):
                return False
        return True

    def _commit(self, keep: int, end: int) -> bool:
        """Make `self._record[_HEADER:end]` the newest record, in the slot that is not `keep`; whether it stands there."""
        slot = 1 - keep if keep >= 0 else 0
        newest = self._newest()
        generation = (self._header(newest, _GENERATION) + 1) % _GENERATIONS if newest >= 0 else 1
        if self.states[slot] != _SLOT_VALID and self.wear[slot]:
            self.wear[slot] += 1  # what had been begun here and was cut short
        self.wear[slot] += 1
        self._finish(end, generation)
        length = end + _CRC
        start = slot * self.capacity
        self.states[slot] = _SLOT_CORRUPT
        for at in range(0, length, _SECTOR):
            self._flash.erase(start + at)
        at = (length - 1) // _PAGE * _PAGE
        while at >= 0:  # the first page, with the header, last
            if not self._program(start, at, length):
                self.error = _STORE_FAILED
                return False
            at -= _PAGE
        self.states[slot] = _SLOT_VALID
        self._set_current(slot, length)
        self.source = _SLOT_A + slot
        copy_word(self._content.tables.crc, 0, self.tables_crc, 0)
        return True

    def _finish(self, end: int, generation: int) -> None:
        """Put the header in front of the sections and the CRC behind."""
        record = self._record
        copy(_MAGIC, 0, len(_MAGIC), record, 0)
        put16(record, _SCHEMA, SCHEMA)
        put16(record, _GENERATION, generation)
        put32(record, _LENGTH, end + _CRC)
        put32(record, _WEAR, self.wear[0])
        put32(record, _WEAR + 4, self.wear[1])
        copy(self._name, 0, _NAME_SIZE, record, _NAME)
        crc32_into(record, 0, _HEADER_CRC, record, _HEADER_CRC)
        crc32_into(record, 0, end, record, end)

    def _program(self, start: int, at: int, length: int) -> bool:
        """Program one page of the record; whether it stands there."""
        page = self._page
        size = min(_PAGE, length - at)
        copy(self._record, at, at + size, page, 0)
        for index in range(size, _PAGE):
            page[index] = 0xFF
        self._flash.program(start + at, page)
        self._flash.read(start + at, page)
        return same(page, 0, self._record, at, size)
