"""The boards' pins are those of docs/hardware.md, the page by which a board is wired."""

import re
from pathlib import Path

import pytest

from bubble_firmware import boards

PAGE = Path(__file__).parents[2] / "docs" / "hardware.md"
PINS = {
    "pump, 20 kHz PWM": ["PIN_PUMP"],
    "dump valve, high: open": ["PIN_DUMP"],
    "SPI0 MISO (with pull-up), SCK, MOSI, 2 MHz": ["PIN_MISO", "PIN_SCK", "PIN_MOSI"],
    "`DISABLE`": ["PIN_DISABLE"],
    "LED: on, active; a short flash, vented; blinking fast, a fault": ["PIN_LED"],
    "ADC0: the reservoir's sensor": ["PIN_SUPPLY"],
    "emergency stop": ["PIN_ESTOP"],
}


def wired():
    """{what: GPIOs} of the page's table, by its column of the smaller board."""
    rows = re.findall(r"^\| ([\d, to]+) \| (.*?) \| (.*?) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return {what: [int(pin) for pin in re.findall(r"\d+", pins)] for pins, what, _ in rows}


@pytest.mark.parametrize("name", ["wristband7", "wristband19"])
@pytest.mark.parametrize("what", PINS)
def test_pins_are_where_the_page_has_them(name, what):
    board = boards.load(name)
    assert [getattr(board, pin) for pin in PINS[what]] == wired()[what]


def test_selects_are_where_the_page_has_them():
    table = wired()
    selects = [select for select, _ in boards.load("wristband19").CONVERTERS]
    assert selects == [*table["chip select of the MCP3208"], *table["free: I2C1 for digital sensors"]]
    assert [select for select, _ in boards.load("wristband7").CONVERTERS] == selects[:1]
