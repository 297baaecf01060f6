"""CPython and MicroPython make the same image of flash, byte for byte, and find the same in it."""

import contextlib
import io

import pytest

SCRIPT = """
from array import array

from bubble_firmware import boards
from bubble_firmware.control.bubbles import Bubbles
from bubble_firmware.drivers.flash import Memory
from bubble_firmware.control.trim import Trim
from bubble_firmware.store.record import Content
from bubble_firmware.store.slots import Store
from bubble_firmware.control.table import Tables


class Settings:
    count = 4

    def __init__(self):
        self.values = array("i", (250, -1000, 0x7FFFFFFF, -0x80000000))
        self.defaults = array("i", self.values)
        self.wanted = array("i", self.values)

    def first_invalid(self, values, at, count):
        self.wanted[:] = self.values
        for index in range(count):
            self.wanted[values[at + 2 * index]] = values[at + 2 * index + 1]
        return 0 if self.wanted[0] < 0 else -1

    def use(self):
        self.values[:] = self.wanted

    def use_defaults(self):
        self.values[:] = self.defaults


class Device:
    def __init__(self, flash):
        self.board = boards.load({board!r})
        self.tables = Tables(self.board.BUBBLES)
        self.bubbles = Bubbles(self.board, self.tables)
        self.trim = Trim(self.board, self.bubbles)
        self.settings = Settings()
        content = Content(self.board, self.tables, self.bubbles, self.trim, self.settings)
        self.store = Store(self.board.NAME, flash, content)


def change(device, number):
    n = device.board.BUBBLES
    for bubble in range(n):
        for knot in range(2 + (number + bubble) % 63):
            device.tables.write_knot(bubble, knot, 4000 + 100 * knot, 100 * knot + number)
        device.tables.write_size(bubble, 3 + (number + bubble) % 62)
        device.tables.write_knot(bubble, 2 + (number + bubble) % 62, 14000, 40000 + number)
    device.tables.swap()
    one = array("i", (150 + number, 1000 + number, 900 - number, 4000, 1100 + number, 800 - number, 4100, 100, number, 16))
    for bubble in range(n):
        device.trim.use(one, 0, bubble)
    device.settings.values[0] = number * 100003


def say(device):
    store = device.store
    found = array("i", bytearray(4 * 10 * device.board.BUBBLES))
    for bubble in range(device.board.BUBBLES):
        device.trim.read(found, 10 * bubble, bubble)
    print(store.source, store.generation, list(store.states), list(store.wear), store.length, device.tables.crc[0])
    print(list(found), list(device.settings.values), list(device.tables.sizes))


flash = Memory(32768)
for number in range(1, 6):
    device = Device(flash)
    say(device)
    change(device, number)
    print(device.store.save(), device.store.save())
    if number == 3:
        print(device.store.reset())
    say(device)
    for at in range(0, 32768, 4096):
        print(bytes(flash.image[at : at + 4096]).hex().rstrip("f"))
flash.image[100] ^= 1
say(Device(flash))
flash.image[16384 + 100] ^= 1
say(Device(flash))
"""


@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
def test_both_interpreters_agree_byte_for_byte(micropython, board):
    script = SCRIPT.format(board=board)
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(script, "script", "exec"), {"__name__": "script"})
    there = micropython(script)
    assert there == said.getvalue()
    lines = there.splitlines()
    assert lines[2] == "True True"
    assert lines[-4].startswith(("1 ", "2 "))
    assert lines[-2].startswith("3 ")
