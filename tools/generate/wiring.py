"""What a board on a Raspberry Pi Pico is wired of: its drawings, its parts and the Pico's pins, from the board's file."""

from types import ModuleType

from svg import ROW, Block, Pin, drawing, straight, text, trunk, y_of

PICO_PINS = {
    **dict(
        zip(range(22), (1, 2, 4, 5, 6, 7, 9, 10, 11, 12, 14, 15, 16, 17, 19, 20, 21, 22, 24, 25, 26, 27), strict=True)
    ),
    **{22: 29, 26: 31, 27: 32, 28: 34},
}
"""The pin of the Pico's edge for each GPIO; GPIO 25 has none, it is the LED on it."""
MCP3208 = {"CLK": 13, "DIN": 11, "CS": 10, "DOUT": 12}
"""Pins of its 16-pin package; channel n is pin n + 1."""
GATES_125 = ((2, 3), (5, 6), (9, 8), (12, 11))
"""Input and output of each gate of a 74AHCT125."""
BUFFERS_541 = tuple((2 + n, 18 - n) for n in range(8))
"""Input and output of each buffer of a 74AHCT541."""
OUTPUTS_PCA = (*range(6, 14), *range(15, 23))
"""The pins of the PCA9685's outputs."""
PCA_NOTES = (
    "Numbers of the PCA9685 are of its TSSOP package.",
    "The low bits of its address are A0, A1 and so on: at 3.3 V for a one, else to ground.",
)
GAP = 4
"""Rows between one block and the next below it."""


def gpio(number: int) -> str:
    """A GPIO with the pin of the Pico's edge."""
    return f"GPIO {number}, pin {PICO_PINS[number]}"


def valve(bubble: int, output: int) -> str:
    """The valve at an even or odd output."""
    return f"vent {bubble}, NO" if output % 2 else f"fill {bubble}, NC"


def drivers(board: ModuleType) -> list[tuple[str, str, list[int]]]:
    """Title, what stands below it, and the bubbles of each chip between Pico and transistors."""
    bubbles = list(range(board.BUBBLES))
    if board.VALVES == "pwm":
        return [("74AHCT541", f"{n + 1}, at 5 V", bubbles[4 * n : 4 * n + 4]) for n in range(-(-board.BUBBLES // 4))]
    found, first = [], 0
    for address, count in board.DRIVERS:
        found.append(("PCA9685", f"address 0x{address:02x}, at 3.3 V", bubbles[first : first + count]))
        first += count
    return found


def valves_drawing(board: ModuleType) -> str:
    """From the Pico to valves, pump and dump valve."""
    pico = Block("Raspberry Pi Pico", board.NAME, 20, 150)
    pwm = board.VALVES == "pwm"
    commons = (("/OE 1, 19", board.PIN_DISABLE, "stop"),)
    if not pwm:
        commons = (
            ("SDA 27", board.PIN_SDA, "bus"),
            ("SCL 26", board.PIN_SCL, "bus"),
            ("EXTCLK 25", board.PIN_CLOCK, "bus"),
            ("/OE 23", board.PIN_DISABLE, "stop"),
        )
    nets: list[list[tuple[Block, int]]] = [[] for _ in commons]
    content: list[str] = []
    row = 0
    for title, under, bubbles in drivers(board):
        chip = Block(title, under, 270, 150)
        gates, coils = Block("MOSFET", "each", 470, 76), Block("Valves", "5 V coils", 596, 110)
        for net, (name, number, _) in zip(nets, commons, strict=True):
            chip.left.append(Pin(row, name))
            if not net:
                pico.right.append(Pin(row, gpio(number)))
            net.append((chip, row))
            row += 1
        for output in range(2 * len(bubbles)):
            if pwm:
                at, to = BUFFERS_541[output]
                pico.right.append(Pin(row, gpio(2 * bubbles[0] + output)))
                chip.left.append(Pin(row, f"A{output + 1} {at}"))
                chip.right.append(Pin(row, f"Y{output + 1} {to}"))
                content += straight(pico, chip, [row], "valve")
            else:
                chip.right.append(Pin(row, f"LED{output} {OUTPUTS_PCA[output]}"))
            gates.left.append(Pin(row, "gate"))
            coils.left.append(Pin(row, valve(bubbles[output // 2], output)))
            content += straight(chip, gates, [row], "valve") + straight(gates, coils, [row], "valve")
            row += 1
        content += [*chip.draw(), *gates.draw(), *coils.draw()]
        row += GAP - 1
    for place, (net, (_, _, kind)) in enumerate(zip(nets, commons, strict=True)):
        content += trunk(250 - 16 * place, [(pico, net[0][1])], net, kind)
    gates, loads = Block("MOSFET", "each", 470, 76), Block("Supply", "5 V", 596, 110)
    for what, number in (("pump", board.PIN_PUMP), ("dump valve, NC", board.PIN_DUMP)):
        pico.right.append(Pin(row, gpio(number)))
        gates.left.append(Pin(row, "gate"))
        loads.left.append(Pin(row, what))
        content += straight(pico, gates, [row], "valve") + straight(gates, loads, [row], "valve")
        row += 1
    content += [*pico.draw(), *gates.draw(), *loads.draw()]
    notes = [
        "MOSFET: N channel, source to ground, 100 kΩ from gate to ground, a diode across the coil;",
        "the coil's other end is at 5 V behind the emergency stop's second contact.",
        "NC: normally closed, NO: normally open.",
        f"GPIO {board.PIN_DISABLE} has 10 kΩ to 3.3 V{'' if pwm else ', SDA and SCL have 1 kΩ'}.",
        *([] if pwm else PCA_NOTES),
    ]
    return finished(f"{board.NAME}: valves, pump and dump valve", notes, row, 726, content)


def converters_drawing(board: ModuleType) -> str:
    """From the sensors and the emergency stop to the Pico."""
    sensors: list[Block] = []
    chips: list[Block] = []
    content: list[str] = []
    row, bubble = 0, 0
    for number, (_, channels) in enumerate(board.CONVERTERS):
        sensor = Block("Sensors", "gauge, 5 V ratiometric", 20, 150)
        chip = Block("MCP3208", f"{number}, at 5 V", 220, 130)
        sensor.right = [Pin(row + n, f"bubble {bubble + n}") for n in range(channels)]
        chip.left = [Pin(row + n, f"CH{n} {n + 1}") for n in range(channels)]
        chip.right = [Pin(row + n, f"{name} {pin}") for n, (name, pin) in enumerate(MCP3208.items())]
        content += straight(sensor, chip, range(row, row + channels), "analog")
        sensors.append(sensor)
        chips.append(chip)
        row += max(channels, 4) + GAP - 1
        bubble += channels
    lifted = [("CLK", board.PIN_SCK), ("DIN", board.PIN_MOSI), *(("CS", select) for select, _ in board.CONVERTERS)]
    pico = Block("Raspberry Pi Pico", board.NAME, 680, 150)
    shifters, at = [], 0
    for first in range(0, len(lifted), len(GATES_125)):
        gates = lifted[first : first + len(GATES_125)]
        shifter = Block("74AHCT125", f"{first // 4 + 1}, at 5 V, /OE to ground", 460, 170)
        for n, (_, number) in enumerate(gates):
            shifter.left.append(Pin(at + n, f"{n + 1}Y {GATES_125[n][1]}"))
            shifter.right.append(Pin(at + n, f"{n + 1}A {GATES_125[n][0]}"))
            pico.left.append(Pin(at + n, gpio(number)))
        content += straight(shifter, pico, range(at, at + len(gates)), "bus")
        shifters += [(shifter, at + n) for n in range(len(gates))]
        content += shifter.draw()
        at += len(gates) + GAP - 1
    buses = {chip.rows[0] + n for chip in chips[1:] for n in range(len(MCP3208))}
    at = next(free for free in range(at, at + 9) if free not in buses)  # no wire lies on another
    divider = Block("Divider", "1.8 kΩ over 3.3 kΩ", 460, 170, [Pin(at, "5 V")], [Pin(at, "3.3 V")])
    pico.left.append(Pin(at, gpio(board.PIN_MISO)))
    content += [*divider.draw(), *straight(divider, pico, [at], "bus")]
    answers = [(chip, chip.rows[0] + 3) for chip in chips]
    for place, n in enumerate((0, 1)):
        content += trunk(446 - 13 * place, [(chip, chip.rows[0] + n) for chip in chips], [shifters[n]], "bus")
    for n, chip in enumerate(chips):
        content += trunk(420 - 13 * n, [(chip, chip.rows[0] + 2)], [shifters[2 + n]], "bus")
    content += trunk(420 - 13 * len(chips), answers, [(divider, at)], "bus")
    row = max(row, at + GAP)
    supply = Block("Reservoir's sensor", "gauge, 5 V ratiometric", 20, 150, right=[Pin(row, "reservoir")])
    second = Block("Divider", "1.8 kΩ over 3.3 kΩ", 460, 170, [Pin(row, "5 V")], [Pin(row, "3.3 V")])
    pico.left.append(Pin(row, gpio(board.PIN_SUPPLY)))
    content += [*straight(supply, second, [row], "analog"), *straight(second, pico, [row], "analog")]
    row += GAP
    button = Block(
        "Emergency stop", "closed unless pressed", 460, 170, [Pin(row, "ground")], [Pin(row, "first contact")]
    )
    pico.left.append(Pin(row, gpio(board.PIN_ESTOP)))
    content += straight(button, pico, [row], "stop")
    for block in (*sensors, *chips, supply, second, button, pico):
        content += block.draw()
    notes = [
        "Numbers beside names are pins of the chips' DIP packages. VDD and VREF of each MCP3208 are at the sensors' 5 V,",
        "AGND and DGND at ground. Every chip has 100 nF beside it.",
        "A divider is 1.8 kΩ from the 5 V signal to the pin, and 3.3 kΩ from the pin to ground.",
    ]
    return finished(f"{board.NAME}: sensors and emergency stop", notes, row + 1, 850, content)


def finished(title: str, notes: list[str], rows: int, width: int, content: list[str]) -> str:
    """The drawing with its notes below it."""
    bottom = y_of(rows) + ROW
    content = content + [text(20, bottom + 17 * n, note, kind="under") for n, note in enumerate(notes)]
    return drawing(title, " ".join(notes), (width, bottom + 17 * len(notes)), content)
