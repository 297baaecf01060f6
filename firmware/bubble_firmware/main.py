"""Where the firmware starts: choose the board, then tick."""

import gc

from bubble_firmware import boards
from bubble_firmware.app import App, run


def lockstep(name, boot_id):
    """Run the firmware of board `name` against a plant at the other end of stdin and stdout."""
    from bubble_firmware.hal.lockstep import Hands

    board = boards.load(name)
    hands = Hands(board.BUBBLES, boot_id)
    while not hands.ended:
        run(App(board, hands))
        gc.collect()


def pico(name):
    """Run the firmware of board `name` on the Raspberry Pi Pico that this is."""
    from bubble_firmware.hal.pico import Hands

    board = boards.load(name)
    hands = Hands(board)  # first of all: it makes the outputs safe
    run(App(board, hands))
