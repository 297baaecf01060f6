"""Where the firmware starts: with a board, a module as `boards.load` gives it."""

import gc

from bubble_firmware.app import App, run
from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType


def lockstep(board: "ModuleType", boot_id: int) -> None:
    """Run the firmware of `board` against a plant at the other end of stdin and stdout."""
    from bubble_firmware.hal.lockstep import LockstepHal

    hal = LockstepHal(board, boot_id)
    while not hal.ended:
        run(App(board, hal))
        gc.collect()


def pico(board: "ModuleType") -> None:
    """Run the firmware of `board` on the Raspberry Pi Pico that this is."""
    from bubble_firmware.hal.pico import PicoHal

    hal = PicoHal(board)  # first of all: it makes the outputs safe
    run(App(board, hal))
