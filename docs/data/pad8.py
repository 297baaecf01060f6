"""`pad8`: eight bubbles in two rows of four, 12 mm apart; one MCP3208, one PCA9685."""

from bubble_firmware.boards.parts.bubble_5mm import *
from bubble_firmware.boards.parts.pico import *

NAME = "pad8"
BUBBLES = 8
TICK_US = 10000

# Seen from above, x to the right, y up: the lower row from the left, then the upper one.
PITCH_UM = 12000
LAYOUT = (
    (-18000, -6000),
    (-6000, -6000),
    (6000, -6000),
    (18000, -6000),
    (-18000, 6000),
    (-6000, 6000),
    (6000, 6000),
    (18000, 6000),
)

VALVES = "pca9685"
PIN_SDA = 4
PIN_SCL = 5
PIN_CLOCK = 21
DRIVERS = ((0x40, 8),)  # address and bubbles of each PCA9685
CONVERTERS = ((17, 8),)  # chip select and channels in use of each MCP3208
