"""`wristband7`: a hexagon of 7 bubbles, one MCP3208, 14 valves on the RP2040's own PWM."""

from bubble_firmware.boards.parts.bubble_5mm import *
from bubble_firmware.boards.parts.pico import *

NAME = "wristband7"
BUBBLES = 7
TICK_US = 5000

# Where the bubbles are, seen from above: x to the right, y up. The centre, then counterclockwise from the right.
PITCH_UM = 10000
LAYOUT = (
    (0, 0),
    (10000, 0),
    (5000, 8660),
    (-5000, 8660),
    (-10000, 0),
    (-5000, -8660),
    (5000, -8660),
)

# The chip: numbers are GPIOs.
VALVES = "pwm"  # bubble i: fill on GPIO 2i, vent on 2i + 1, channels A and B of PWM slice i
CONVERTERS = ((17, 7),)  # chip select and channels in use of each MCP3208
