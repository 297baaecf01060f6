"""Boards as data, all numbers integers: a board is one file of this folder. docs/boards.md says what stands in it.

`parts` has what several boards share. Nothing lists the boards here: a device loads the one it is, and the host finds
them in the folder, see `bubbleskin.boards`.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

DEFAULT = "wristband7"
"""The board that is meant where none is named."""


def load(name: str) -> "ModuleType":
    """The board module called `name`; ImportError where there is none."""
    return __import__("bubble_firmware.boards." + name, None, None, ("NAME",))
