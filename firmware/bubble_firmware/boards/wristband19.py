"""`wristband19`: a hexagon of 19 bubbles, three MCP3208, 38 valves on three PCA9685."""

from bubble_firmware.boards.parts.bubble_5mm import *
from bubble_firmware.boards.parts.pico import *

NAME = "wristband19"
BUBBLES = 19
TICK_US = 10000

# Where the bubbles are, seen from above: x to the right, y up. Ring by ring, counterclockwise from the right.
PITCH_UM = 10000
LAYOUT = (
    (0, 0),
    (10000, 0),
    (5000, 8660),
    (-5000, 8660),
    (-10000, 0),
    (-5000, -8660),
    (5000, -8660),
    (20000, 0),
    (15000, 8660),
    (10000, 17321),
    (0, 17321),
    (-10000, 17321),
    (-15000, 8660),
    (-20000, 0),
    (-15000, -8660),
    (-10000, -17321),
    (0, -17321),
    (10000, -17321),
    (15000, -8660),
)

# The chip: numbers are GPIOs.
VALVES = "pca9685"
PIN_SDA = 4  # I2C0, 1 MHz
PIN_SCL = 5
PIN_CLOCK = 21  # GPOUT0: the clock of all PCA9685, so that their periods are the tick's
DRIVERS = ((0x40, 7), (0x41, 6), (0x42, 6))  # address and bubbles of each PCA9685
CONVERTERS = ((17, 7), (22, 6), (27, 6))  # chip select and channels in use of each MCP3208
