"""An exception inside the tick, on the chip: the real drivers, with one that raises while a free pin is high.

The firmware has no switch for this. The prompt of the BARE firmware starts the frozen application by hand, with
`read_sensors` wrapped, as a driver that fails would look.
"""

import numpy as np
import pytest

from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim.rp2040.board import Rp2040Board
from bubbleskin.sim.rp2040.prompt import Prompt
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import Skin
from bubbleskin.toolchain.frozen import BARE

pytestmark = pytest.mark.chip

SPARE_PIN = 22

START = """
import micropython
micropython.kbd_intr(-1)
from machine import Pin
from bubble_firmware import boards
from bubble_firmware.app import App, run
from bubble_firmware.hal.pico import PicoHal
board = boards.load("wristband7")
hal = PicoHal(board)
spare = Pin({pin}, Pin.IN)
read_sensors = hal.read_sensors
def failing(counts):
    if spare():
        raise OSError(5)
    read_sensors(counts)
hal.read_sensors = failing
app = App(board, hal)
run(app)
"""


@pytest.fixture
def skin(uf2):
    board = Rp2040Board("wristband7", uf2(BARE))
    Prompt(board.chip)
    board.chip.from_device.clear()
    board.chip.write(START.format(pin=SPARE_PIN).encode() + b"\x04")
    while len(board.from_device) < 2 and board.time < 5.0:
        board.chip.run(1e-3)
    assert board.from_device.startswith(b"OK"), bytes(board.from_device)
    board.from_device.clear()
    board.chip.run(1.0)  # the application is made
    with Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, "rp2040://wristband7"), 2.0, simulated=board))) as skin:
        yield skin


@pytest.mark.promise("failing-tick")
def test_an_exception_in_the_tick_vents_within_one_and_is_named(skin):
    board = skin.simulated
    skin.show(np.full(7, 11.0), wait=False)
    skin.sleep(0.1)
    safe = [0.0, board.tick_s]
    assert not (board.pulses == safe).all()
    fail = board.chip.mcu.gpio[SPARE_PIN].set_input_value
    fail(True)
    failed = board.time
    while not (board.pulses == safe).all():
        board.chip.run(1e-4)
        assert board.time - failed <= 2 * board.tick_s  # the tick that is under way may have read the pin already
    fail(False)
    health = skin.health()
    assert health.exceptions >= 1
    assert "exception" in health.board_faults
    assert set(skin.state().status) == {"resting"}
    skin.clear_faults()
    skin.show(np.full(7, 9.5), wait=False)  # the rest answers, and works again
    skin.sleep(0.05)
    assert skin.state().mode == "active"
