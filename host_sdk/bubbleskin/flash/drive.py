"""The boot loader's drive: whether it is the right one, and copying a firmware onto it."""

import errno
import itertools
import re
from collections.abc import Callable
from pathlib import Path

from bubbleskin.errors import BubbleskinError, InvalidInput, LinkError
from bubbleskin.flash.machine import INFO, Machine
from bubbleskin.flash.uf2 import BLOCK, Image

CHUNK = 32 * BLOCK
FILE = "BUBBLES.UF2"
BOARD_ID = "RPI-RP2"

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is."""


def check_drive(drive: Path) -> None:
    """Refuse a folder that is no boot loader's drive, or that of another chip."""
    try:
        text = (drive / INFO).read_text(errors="replace")
    except OSError:
        raise InvalidInput(
            f"{drive} is no boot loader's drive: it has no {INFO}. Hold BOOTSEL while you plug the wristband in, "
            "then name the drive that appears."
        ) from None
    found = re.search(r"Board-ID:\s*(\S+)", text)
    board_id = found[1] if found else "nothing"
    if board_id != BOARD_ID:
        raise InvalidInput(
            f"The board at {drive} is of the wrong kind: it says {board_id}, and the wristband's RP2040 says {BOARD_ID}. "
            "Nothing has been written. Unplug that board and plug the wristband in."
        )


def copy_image(machine: Machine, drive: Path, image: Image, report: Progress) -> None:
    """Copy `image` onto `drive` and leave the board to start it. Errors say how the board is left and what to do."""
    data = image.for_drive()
    try:
        free = machine.free(drive)
    except OSError as error:
        raise LinkError(
            f"The drive {drive} has gone ({error.strerror}). Plug the wristband in again, then flash again."
        ) from None
    if free < len(data):
        raise BubbleskinError(
            f"{drive} has {free // 1024} KiB free, and the firmware needs {-(-len(data) // 1024)}. "
            "Unplug the wristband, hold BOOTSEL while you plug it in, then flash again."
        )
    title = "copying the firmware"
    done = 0
    # The last block stands alone: with it the board restarts and the drive is gone, whatever the file system says.
    edges = [*range(0, len(data) - BLOCK, CHUNK), len(data) - BLOCK, len(data)]
    try:
        with machine.create(drive / FILE) as sink:
            for begin, end in itertools.pairwise(edges):
                report(title, done, len(data))
                sink.write(data[begin:end])
                done = end
    except OSError as error:
        if done < len(data) - BLOCK:
            raise _broken_off(drive, error, done, len(data)) from None
    report(title, len(data), len(data))


def _broken_off(drive: Path, error: OSError, done: int, total: int) -> BubbleskinError:
    if error.errno in (errno.EROFS, errno.EACCES, errno.EPERM):
        return BubbleskinError(
            f"{drive} cannot be written to ({error.strerror}). Mount it for writing, or as this user, then flash again."
        )
    if error.errno == errno.ENOSPC:
        return BubbleskinError(
            f"{drive} is full after {done} of {total} bytes. Unplug the wristband, hold BOOTSEL while you plug it in, "
            "then flash again."
        )
    return LinkError(
        f"The drive {drive} has gone after {done} of {total} bytes ({error.strerror}). The wristband has no whole "
        "firmware now and will wake up in its boot loader: plug it in again, then flash again."
    )
