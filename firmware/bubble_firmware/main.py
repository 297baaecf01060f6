"""Where the firmware starts: choose the board, then tick."""

import gc

from bubble_firmware import boards
from bubble_firmware.app import App, run


def lockstep(name: str, boot_id: int) -> None:
    """Run the firmware of board `name` against a plant at the other end of stdin and stdout."""
    from bubble_firmware.hal.lockstep import LockstepHal

    board = boards.load(name)
    hal = LockstepHal(board, boot_id)
    while not hal.ended:
        run(App(board, hal))
        gc.collect()


def pico(name: str) -> None:
    """Run the firmware of board `name` on the Raspberry Pi Pico that this is."""
    from bubble_firmware.hal.pico import PicoHal

    board = boards.load(name)
    hal = PicoHal(board)  # first of all: it makes the outputs safe
    run(App(board, hal))
