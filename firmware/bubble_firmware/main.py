# mypy: disable-error-code="attr-defined"
"""Where the firmware starts: with a board, a module as `boards.load` gives it."""

import gc

from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

_SPARE = 2048  # bytes
_COLLECT = 16384  # bytes between two collections while there are imports


def lockstep(board: "ModuleType", boot_id: int, boot_ticks: int = -1) -> None:
    """Run the firmware of `board` against a plant at the other end of stdin and stdout."""
    # Room near the heap's start, and no collection in a tick, as on the Pico: see `pico`.
    spare = bytearray(_SPARE)
    from bubble_firmware.app import App, run
    from bubble_firmware.hal.lockstep import LockstepHal

    gc.threshold(-1)
    hal = LockstepHal(board, boot_id, boot_ticks)
    while not hal.ended:
        app = App(board, hal)
        del spare
        gc.collect()
        run(app)
        del app
        gc.collect()
        spare = bytearray(_SPARE)


def pico(board: "ModuleType") -> None:
    """Run the firmware of `board` on the Raspberry Pi Pico that this is."""
    # A function of many locals has its frame on the heap while it runs. The search for room begins at the heap's start:
    # in a heap that is full it takes every tick the better part of a millisecond. So we keep room free there.
    gc.collect()  # what starting MicroPython left lies in front
    spare = bytearray(_SPARE)
    # And what imports leave behind must not lie scattered over all of the heap, or no large piece is left.
    gc.threshold(_COLLECT)
    from bubble_firmware.hal.pico import PicoHal

    hal = PicoHal(board)  # first of all: it makes the outputs safe
    from bubble_firmware.app import App, run

    gc.threshold(-1)  # no tick collects
    app = App(board, hal)
    del spare
    gc.collect()  # or it would be free only after the first collection, which may never come
    run(app)
