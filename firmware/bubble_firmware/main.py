"""Where the firmware starts: with a board, a module as `boards.load` gives it."""

import gc

from bubble_firmware.app import App, run


def lockstep(board, boot_id):
    """Run the firmware of `board` against a plant at the other end of stdin and stdout."""
    from bubble_firmware.hal.lockstep import Hands

    hands = Hands(board.BUBBLES, boot_id)
    while not hands.ended:
        run(App(board, hands))
        gc.collect()


def pico(board):
    """Run the firmware of `board` on the Raspberry Pi Pico that this is."""
    from bubble_firmware.hal.pico import Hands

    hands = Hands(board)  # first of all: it makes the outputs safe
    run(App(board, hands))
