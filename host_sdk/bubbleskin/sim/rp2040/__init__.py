"""The firmware on an emulated RP2040: the chip itself, the chips around it, and the plant that they drive."""

from importlib.util import find_spec
from typing import TYPE_CHECKING

from bubbleskin.build.rp2040 import built
from bubbleskin.errors import BubbleskinError

if TYPE_CHECKING:
    from bubbleskin.sim.rp2040.board import Rp2040Board


def open_chip(name: str, *, seed: int = 0, spread: float = 0.0) -> "Rp2040Board":
    """The board `name` on an emulated RP2040, booted as far as USB. Its UF2 must have been built."""
    if find_spec("rp2040py") is None:
        raise BubbleskinError("rp2040:// needs the emulator. Install it: pip install 'bubbleskin[emulator]'.")
    firmware = built(name)
    if firmware is None:
        raise BubbleskinError(
            f"Today's firmware of {name} has not been built on this machine yet. "
            f"Run `bubbleskin firmware build --board {name}` once."
        )
    from bubbleskin.sim.rp2040.board import Rp2040Board

    board = Rp2040Board(name, firmware, seed=seed, spread=spread)
    board.boot()
    return board
