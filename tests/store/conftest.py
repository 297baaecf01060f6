"""The store of a small board on simulated flash, and what an independent reader and writer make of its format."""

import struct
import sys
import zlib
from array import array
from types import SimpleNamespace

import pytest

from bubble_firmware import boards
from bubble_firmware.control import trim
from bubble_firmware.control.bubbles import Bubbles
from bubble_firmware.control.table import KNOTS_MAX, Tables
from bubble_firmware.control.trim import Trim
from bubble_firmware.store import record
from bubble_firmware.store.record import Content
from bubble_firmware.store.slots import Store
from bubbleskin.sim.flash import NorFlash


class Settings:
    """What the store asks of settings: values, and whether some would be allowed."""

    DEFAULTS = 250, 1000, -5

    def __init__(self):
        self.count = 3
        self.values = array("i", self.DEFAULTS)
        self.wanted = array("i", self.values)

    def first_invalid(self, values, at, count):
        """Of `count` pairs of setting and value."""
        self.wanted[:] = self.values
        for index in range(count):
            self.wanted[values[at + 2 * index]] = values[at + 2 * index + 1]
        return 0 if self.wanted[0] < 0 else -1

    def use(self):
        self.values[:] = self.wanted

    def use_defaults(self):
        self.values[:] = array("i", self.DEFAULTS)


def board(name="wristband7", bubbles=None):
    data = SimpleNamespace(**{key: value for key, value in vars(boards.load(name)).items() if key.isupper()})
    data.BUBBLES = bubbles or data.BUBBLES
    return data


class Device:
    """As much of the firmware as the store deals with, booted from `flash`."""

    def __init__(self, flash, data=None):
        self.board = data or board(bubbles=1)
        self.tables = Tables(self.board.BUBBLES)
        self.bubbles = Bubbles(self.board, self.tables)
        self.trim = Trim(self.board, self.bubbles)
        self.settings = Settings()
        content = Content(self.board, self.tables, self.bubbles, self.trim, self.settings)
        self.store = Store(self.board.NAME, flash, content)

    def change(self, number):
        """Make everything in use tell of `number`, so that a mix of two would show."""
        n = self.board.BUBBLES
        for bubble in range(n):
            size = 2 + (number + bubble) % (KNOTS_MAX - 1)
            self.tables.write_size(bubble, size)
            for knot in range(size):
                height = 4000 + 10000 * knot // (size - 1)
                self.tables.write_knot(bubble, knot, height, (number * 7 + bubble + knot) % 40000)
        self.tables.swap()
        one = array("i", [160 + number % 80, *(1000 + number % 999, 999, 4000) * 2, 100, number, 16])
        for bubble in range(n):
            self.trim.use(one, 0, bubble)
        self.settings.values[:] = array("i", [number, 1000 + number, -number])
        return self.content

    @property
    def content(self):
        tables = [
            self.tables.knots[4 * KNOTS_MAX * bubble :][: 4 * size].hex()
            for bubble, size in enumerate(self.tables.sizes)
        ]
        found = array("i", bytes(4 * trim.COUNT * self.board.BUBBLES))
        for bubble in range(self.board.BUBBLES):
            self.trim.read(found, trim.COUNT * bubble, bubble)
        return tuple(tables), tuple(found), tuple(self.settings.values)


FACTORY_CONTENT = Device(None).content


def sections_of(content):
    """The sections of a record, with struct."""
    tables, found, settings = content
    knots = [bytes.fromhex(table) for table in tables]
    parts = {
        1: bytes(len(table) // 4 for table in knots) + b"".join(knots),
        2: struct.pack(f"<{len(settings)}i", *settings),
        3: struct.pack(f"<{len(found)}H", *found),
    }
    return {section: struct.pack("<BBH", section, 0, len(data)) + data for section, data in parts.items()}


def make_record(sections, generation, wear=(1, 0), schema=record.SCHEMA, name="wristband7"):
    """A whole record, with struct and zlib."""
    body = b"".join(sections)
    head = b"bsst" + struct.pack("<HHIII16s", schema, generation, 40 + len(body) + 4, *wear, name.encode())
    head += struct.pack("<I", zlib.crc32(head))
    return head + body + struct.pack("<I", zlib.crc32(head + body))


def flash_with(a=b"", b=b""):
    """Flash whose slots begin with these bytes."""
    flash = NorFlash()
    for slot, data in enumerate((a, b)):
        start = slot * flash.size // 2
        flash.image[start : start + len(data)] = data
    return flash


@pytest.fixture(scope="session")
def kit():
    """All of the above."""
    return sys.modules[__name__]
