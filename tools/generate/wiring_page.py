"""Draw how both boards are wired, and write parts and pins into `docs/wiring.md`, all from the boards' files.

python tools/generate/wiring_page.py            # write them
python tools/generate/wiring_page.py --check    # fail if they are not what would be written
"""

from math import ceil
from pathlib import Path
from types import ModuleType

import generated
from svg import drawing, line, text
from wiring import PICO_PINS, converters_drawing, valves_drawing

from bubble_firmware import boards

PAGE = Path("docs/wiring.md")
PICTURES = Path("docs/pictures")
BEGIN, END = "<!-- {}: made by tools/generate/wiring_page.py -->\n", "<!-- end of {} -->\n"
FOLDER = Path(boards.__file__).parent
BOARDS = sorted(
    (boards.load(path.stem) for path in FOLDER.glob("*.py") if path.stem != "__init__"), key=lambda board: board.BUBBLES
)
"""Those of the package, the smaller one first."""
LINE_M = 0.3
"""Tube of one bubble, m: docs/hardware.md."""


def air_drawing(board: ModuleType) -> str:
    """From the pump to one bubble and back to the air."""
    boxes = [
        (20, 70, 90, 44, "Pump", "3 L/min"),
        (160, 70, 130, 44, "Reservoir", f"50 mL, {board.SUPPLY_PA // 1000} kPa"),
        (360, 70, 100, 44, "Fill valve", "NC, 0.2 mm"),
        (360, 170, 100, 44, "Vent valve", "NO, 0.2 mm"),
        (510, 170, 110, 44, "Sensor", "at the valves"),
        (160, 170, 130, 44, "Relief valve", "80 kPa, no wires"),
        (160, 240, 130, 44, "Dump valve", "NC"),
        (160, 310, 130, 44, "Sensor", "of the reservoir"),
    ]
    content = []
    for x, y, width, height, title, under in boxes:
        content.append(f'<rect class="block" x="{x}" y="{y}" width="{width}" height="{height}" rx="4"/>')
        content.append(text(x + width / 2, y + 18, title, "middle", "title"))
        content.append(text(x + width / 2, y + 34, under, "middle", "under"))
    paths = [
        [(110, 92), (160, 92)],
        [(290, 92), (360, 92)],
        [(460, 92), (690, 92)],
        [(485, 92), (485, 192), (460, 192)],
        [(565, 92), (565, 170)],
        [(360, 192), (345, 192), (345, 226)],
        [(290, 192), (312, 192), (312, 226)],
        [(290, 262), (328, 262), (328, 246)],
        [(225, 114), (225, 130), (140, 130), (140, 332), (160, 332)],
        [(140, 192), (160, 192)],
        [(140, 262), (160, 262)],
        [(320, 92), (320, 40), (400, 40)],
    ]
    content += [line(path, "air") for path in paths]
    for x, y in ((320, 92), (485, 92), (565, 92), (140, 192), (140, 262)):
        content.append(f'<circle cx="{x}" cy="{y}" r="3" fill="#3b6d11"/>')
    content += [
        '<circle class="block" cx="725" cy="92" r="35"/>',
        text(725, 90, "Bubble", "middle", "title"),
        text(725, 104, "on its barb", "middle", "under"),
        text(628, 84, f"{LINE_M} m, bore 0.8 mm", "middle", "under"),
        text(328, 240, "open air", "middle", "under"),
        text(406, 44, "to the fill valves of the other bubbles", "start", "under"),
    ]
    return drawing(
        "The air of one bubble",
        "Pump, reservoir with relief valve, dump valve and sensor; for each bubble fill valve, vent valve, sensor and tube.",
        (780, 374),
        content,
    )


def parts() -> str:
    """The list, counted for each board."""
    rows = [
        "| part | " + " | ".join(board.NAME for board in BOARDS) + " | what to look for |",
        "|---|" + "---|" * len(BOARDS) + "---|",
    ]
    for name, count, what in PARTS:
        rows.append(f"| {name} | " + " | ".join(count(board) or "–" for board in BOARDS) + f" | {what} |")
    return "\n".join(rows) + "\n"


def pwm(board: ModuleType) -> bool:
    """Whether the Pico's own PWM has the valves."""
    return board.VALVES == "pwm"


def chips(board: ModuleType) -> int:
    """Chips beside the Pico."""
    return len(board.CONVERTERS) + shifters(board) + buffers(board) + expanders(board)


def shifters(board: ModuleType) -> int:
    """74AHCT125, of which each lifts four lines."""
    return ceil((2 + len(board.CONVERTERS)) / 4)


def buffers(board: ModuleType) -> int:
    """74AHCT541, of which each has the valves of four bubbles."""
    return ceil(board.BUBBLES / 4) if pwm(board) else 0


def expanders(board: ModuleType) -> int:
    """PCA9685."""
    return 0 if pwm(board) else len(board.DRIVERS)


def sees(zero: str, step: str) -> str:
    """What a sensor of the boards has to be, and the highest pressure that is seen."""
    seen = (BOARDS[0].COUNT_HIGH - getattr(BOARDS[0], zero)) * getattr(BOARDS[0], step) // 1000
    return f"0 to {ceil(seen / 10) * 10} kPa gauge, 5 V ratiometric; {seen} kPa are seen"


PARTS = (
    ("Raspberry Pi Pico", lambda board: "1", "RP2040; one with pins soldered on"),
    ("bubble", lambda board: str(board.BUBBLES), "silicone, 5 mm at rest, cast as one sheet; each on a barb"),
    ("fill valve", lambda board: str(board.BUBBLES), "2/2, 5 V, **normally closed**, opens in 1.2 ms"),
    ("vent valve", lambda board: str(board.BUBBLES), "the same, **normally open**"),
    ("restrictor 0.2 mm", lambda board: str(2 * board.BUBBLES), "one on every fill and vent valve"),
    ("tube, bore 0.8 mm", lambda board: f"{LINE_M * board.BUBBLES:.1f} m", f"{LINE_M} m for each bubble, all of a length"),
    ("sensor of a bubble", lambda board: str(board.BUBBLES), sees("SENSOR_ZERO", "SENSOR_PA_PER_COUNT")),
    ("sensor of the reservoir", lambda board: "1", sees("SUPPLY_ZERO", "SUPPLY_PA_PER_COUNT")),
    ("pump", lambda board: "1", "diaphragm, 5 V, 3 L/min"),
    ("reservoir", lambda board: "1", "50 mL"),
    ("relief valve", lambda board: "1", "80 kPa: it needs no firmware"),
    ("dump valve", lambda board: "1", "2/2, 5 V, normally closed"),
    ("emergency stop", lambda board: "1", "two contacts that open when it is pressed"),
    ("5 V supply", lambda board: "1", "for the coils of all valves at once, and the pump"),
    ("MCP3208", lambda board: str(len(board.CONVERTERS)), "12 bits, eight inputs, SPI"),
    ("74AHCT125", lambda board: str(shifters(board)), "lifts 3.3 V to 5 V; AHCT or HCT, not AHC"),
    ("74AHCT541", lambda board: str(buffers(board) or ""), "the same for valves; its /OE is the way to let go of all"),
    ("PCA9685", lambda board: str(expanders(board) or ""), "16 outputs, I2C, with EXTCLK and /OE on pins"),
    ("MOSFET, N channel", lambda board: str(2 * board.BUBBLES + 2), "fully on at 3 V; valves, pump, dump valve"),
    ("diode", lambda board: str(2 * board.BUBBLES + 2), "across each coil and the pump"),
    ("resistor 100 kΩ", lambda board: str(2 * board.BUBBLES + 2), "gate to ground"),
    ("resistor 10 kΩ", lambda board: "1", "`DISABLE` to 3.3 V"),
    ("resistors 1.8 kΩ and 3.3 kΩ", lambda board: "2 each", "dividers of MISO and of the reservoir's sensor"),
    ("resistor 1 kΩ", lambda board: "" if pwm(board) else "2", "SDA and SCL to 3.3 V"),
    ("capacitor 100 nF", lambda board: str(chips(board)), "one beside each chip"),
)  # fmt: skip
"""Name, how many a board needs, and what to look for when buying."""


def uses(board: ModuleType) -> dict[int, str]:
    """What each GPIO of a board is."""
    found = {
        board.PIN_PUMP: "pump",
        board.PIN_DUMP: "dump valve",
        board.PIN_MISO: "MISO, from the divider",
        board.PIN_SCK: "SCK",
        board.PIN_MOSI: "MOSI",
        board.PIN_DISABLE: "`DISABLE`",
        board.PIN_ESTOP: "emergency stop",
        board.PIN_SUPPLY: "reservoir's sensor",
        **{select: f"chip select of MCP3208 {n}" for n, (select, _) in enumerate(board.CONVERTERS)},
    }
    if pwm(board):
        found |= {2 * n + k: f"{what} {n}" for n in range(board.BUBBLES) for k, what in enumerate(("fill", "vent"))}
    else:
        found |= {board.PIN_SDA: "SDA", board.PIN_SCL: "SCL", board.PIN_CLOCK: "EXTCLK"}
    return found


def pins() -> str:
    """The Pico's pins in their order, as they are wired."""
    used = [uses(board) for board in BOARDS]
    rows = [
        "| pin | GPIO | " + " | ".join(f"`{board.NAME}`" for board in BOARDS) + " |",
        "|---|---|" + "---|" * len(BOARDS),
    ]
    for number, pin in sorted(PICO_PINS.items(), key=lambda item: item[1]):
        rows.append(f"| {pin} | {number} | " + " | ".join(use.get(number, "free") for use in used) + " |")
    return "\n".join(rows) + "\n"


def page() -> str:
    """The page with the tables of today."""
    text = (generated.ROOT / PAGE).read_text(encoding="utf-8")
    for name, content in {"parts": parts(), "pins": pins()}.items():
        begin, end = BEGIN.format(name), END.format(name)
        before, rest = text.split(begin)
        text = f"{before}{begin}\n{content}\n{end}{rest.split(end)[1]}"
    return text


FILES = {PICTURES / "wiring_air.svg": lambda: air_drawing(BOARDS[0]), PAGE: page}
FILES |= {PICTURES / f"wiring_{board.NAME}_valves.svg": lambda board=board: valves_drawing(board) for board in BOARDS}
FILES |= {
    PICTURES / f"wiring_{board.NAME}_sensors.svg": lambda board=board: converters_drawing(board) for board in BOARDS
}

if __name__ == "__main__":
    generated.main(FILES)
