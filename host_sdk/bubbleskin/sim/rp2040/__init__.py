"""The firmware on an emulated RP2040: the chip itself, the chips around it, and the plant that they drive."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from bubbleskin.errors import BubbleskinError
from bubbleskin.sim.recipe import PlantOptions
from bubbleskin.sim.wiring import Wiring
from bubbleskin.toolchain.rp2040 import built

if TYPE_CHECKING:
    from bubbleskin.sim.rp2040.board import Rp2040Board


def open_chip(
    name: str,
    firmware: Path | None = None,
    *,
    seed: int = 0,
    spread: float = 0.0,
    contact: bool = True,
    absent: tuple[str, ...] = (),
    wiring: Wiring | None = None,
    **options: Unpack[PlantOptions],
) -> "Rp2040Board":
    """The board `name` on an emulated RP2040, booted as far as USB.

    `firmware` is its UF2; None is that of today's source, which must have been built. The rest is as of `Rp2040Board`.
    """
    if find_spec("rp2040py") is None:
        raise BubbleskinError("rp2040:// needs the emulator. Install it: pip install 'bubbleskin[emulator]'.")
    firmware = firmware or built(name)
    if firmware is None:
        raise BubbleskinError(
            f"Today's firmware of {name} has not been built on this machine yet. "
            f"Run `bubbleskin firmware build --board {name}` once."
        )
    from bubbleskin.sim.rp2040.board import Rp2040Board

    board = Rp2040Board(
        name, firmware, seed=seed, spread=spread, contact=contact, absent=absent, wiring=wiring, **options
    )
    board.boot()
    return board
