# mypy: disable-error-code="attr-defined"
"""Where the firmware starts: choose the board, then tick."""

import gc

from bubble_firmware import boards

_SPARE = 2048  # bytes
_COLLECT = 16384  # bytes between two collections while there are imports


def lockstep(name, boot_id):
    """Run the firmware of board `name` against a plant at the other end of stdin and stdout."""
    from bubble_firmware.app import App, run
    from bubble_firmware.boards.lockstep import Hands

    board = boards.load(name)
    hands = Hands(board.BUBBLES, boot_id)
    while not hands.ended:
        run(App(board, hands))
        gc.collect()


def pico(name):
    """Run the firmware of board `name` on the Raspberry Pi Pico that this is."""
    # A function of many locals has its frame on the heap while it runs. The search for room begins at the heap's start:
    # in a heap that is full it takes every tick the better part of a millisecond. So we keep room free there.
    spare = bytearray(_SPARE)
    # And what imports leave behind must not lie scattered over all of the heap, or no large piece is left.
    gc.threshold(_COLLECT)
    board = boards.load(name)
    from bubble_firmware.boards.pico import Hands

    hands = Hands(board)  # first of all: it makes the outputs safe
    from bubble_firmware.app import App, run

    gc.threshold(-1)  # no tick collects
    app = App(board, hands)
    del spare
    run(app)
