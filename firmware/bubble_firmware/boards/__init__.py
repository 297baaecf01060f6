"""Boards as data: one module a board, all numbers integers. A new board is one new file here."""


def load(name):
    """The board module called `name`; ImportError where there is none."""
    return __import__("bubble_firmware.boards." + name, None, None, ("NAME",))
