"""What a board's file defines: every number with its unit, what is allowed and what it means. docs/boards.md is made of it."""

from collections.abc import Collection
from dataclasses import dataclass

from bubble_firmware.control.nominal import KNOTS

BUBBLES_MAX = 24
"""As many as a frame has room for, see STATE_REPLY."""
NEIGHBOUR = 1.25
"""Bubbles nearer than so many pitches are neighbours: they touch when they grow."""
RELIEF_PA = 80000
"""At which the reservoir's relief valve opens, without any firmware."""
GPIOS = (*range(23), 25, 26, 27, 28)
"""The pins that a Raspberry Pi Pico hands out, and the LED's."""


@dataclass(frozen=True)
class Field:
    """One number of a board."""

    name: str
    unit: str
    allowed: Collection[int]
    meaning: str

    @property
    def allowed_text(self) -> str:
        """What is allowed, in words."""
        if isinstance(self.allowed, range):
            low, high, step = self.allowed[0], self.allowed[-1], self.allowed.step
            return f"{low} to {high}" + (f" in steps of {step}" if step > 1 else "")
        numbers = [str(number) for number in self.allowed]
        return numbers[0] if len(numbers) == 1 else f"{', '.join(numbers[:-1])} or {numbers[-1]}"


def _to(low: int, high: int, step: int = 1) -> range:
    return range(low, high + 1, step)


FIELDS = (
    Field("BUBBLES", "", _to(1, BUBBLES_MAX), "how many bubbles there are"),
    Field("TICK_US", "µs", _to(2000, 20000, 1000), "period of control and valves"),
    Field("PITCH_UM", "µm", _to(1000, 100000), "distance between the centres of neighbours"),
    # Limits.
    Field("HEIGHT_REST_UM", "µm", _to(1000, KNOTS[-1][0]), "height of a bubble without pressure"),
    Field("HEIGHT_MAX_UM", "µm", _to(1000, KNOTS[-1][0]), "the greatest height that may be asked"),
    Field("PRESSURE_MAX_PA", "Pa", _to(1000, 65535), "gauge pressure at which a bubble is vented"),
    Field(
        "AIR_MAX_UJ",
        "µJ",
        _to(1000, 260000),
        "air in a bubble and its line that a table may ask for, at the greatest height",
    ),
    Field("FILL_MAX_US", "µs", _to(1000, 2000000), "longest a fill valve may stay open at a time"),
    Field("SUPPLY_PA", "Pa", _to(1000, RELIEF_PA), "pressure that the pump keeps in the reservoir"),
    Field("SUPPLY_MAX_PA", "Pa", _to(1000, RELIEF_PA), "pressure at which the dump valve opens"),
    Field("SUPPLY_LOW_PA", "Pa", _to(1000, RELIEF_PA), "less for long, and the supply is lost"),
    Field("BUDGET_KPA_S", "kPa s", _to(1, 36000), "pressure above BUDGET_FREE_PA times time that a bubble may take"),
    Field("BUDGET_FREE_PA", "Pa", _to(0, 65535), "pressure that counts nothing, and below which a bubble recovers"),
    Field("SEQUENCE_BYTES", "bytes", _to(1024, 65536), "memory for the steps of a sequence"),
    # Sensors.
    Field("SENSOR_ZERO", "counts", _to(0, 4095), "what a bubble's sensor reads at no pressure"),
    Field("SENSOR_PA_PER_COUNT", "Pa", _to(1, 100), "gauge pressure of one count more"),
    Field("SUPPLY_ZERO", "counts", _to(0, 4095), "the same of the reservoir's sensor"),
    Field("SUPPLY_PA_PER_COUNT", "Pa", _to(1, 100), "the same of the reservoir's sensor"),
    Field("COUNT_LOW", "counts", _to(0, 4095), "at or below this a sensor is not believed"),
    Field("COUNT_HIGH", "counts", _to(0, 4095), "at or above this neither"),
    Field("FROZEN_US", "µs", _to(50000, 500000), "a sensor that says the same for so long is not believed"),
    # Valves and lines.
    Field("VALVE_OPENS_US", "µs", _to(0, 10000), "from current to an open valve"),
    Field("VALVE_CLOSES_US", "µs", _to(0, 10000), "from no current to a closed valve"),
    Field("PULSE_MIN_US", "µs", _to(1, 20000), "the shortest pulse that opens a valve"),
    Field("CONDUCTANCE", "1e-6 dm³/(s bar)", _to(100, 40000), "sonic conductance of valve and restrictor"),
    Field("CRITICAL_RATIO", "1/256", _to(1, 255), "critical pressure ratio of the restrictor"),
    Field("DEAD_VOLUME_MM3", "mm³", _to(1, 5000), "volume of valve node and tube of one bubble"),
    Field("TUBE_PA_PER_FLOW", "Pa per µJ/ms", _to(0, 100), "pressure lost along the tube"),
    Field("QUIET_US", "µs", _to(0, 100000), "from a closed valve until the sensor reads the bubble"),
    # Control.
    Field("GAIN_P", "1/256", _to(0, 1024), "share of the missing air in one dose"),
    Field("GAIN_D", "1/256", _to(0, 1024), "of its change"),
    Field("DEADBAND_UM", "µm", _to(1, 1000), "no dose for less"),
    Field("SETTLED_UM", "µm", _to(1, 1000), "a bubble this near its target counts as there"),
    Field(
        "SURE_UM", "µm", _to(1, 1000), "and as settled where its height is known as well as that: a standard deviation"
    ),
    Field("FLOW_SD", "/65536", _to(1, 16384), "how far restrictors are from CONDUCTANCE: standard deviation, a share"),
    Field(
        "CURVE_SD",
        "/65536",
        _to(1, 16384),
        "how far pressures are from the table's, the rubber's memory included: a share",
    ),
    # The chip.
    Field("PIN_PUMP", "GPIO", (14,), "pump, the PWM of slice 7"),
    Field("PIN_DUMP", "GPIO", GPIOS, "dump valve"),
    Field("PIN_MISO", "GPIO", (0, 4, 16, 20), "SPI0, from the converters"),
    Field("PIN_SCK", "GPIO", (2, 6, 18, 22), "SPI0, clock"),
    Field("PIN_MOSI", "GPIO", (3, 7, 19, 23), "SPI0, to the converters"),
    Field("PIN_DISABLE", "GPIO", GPIOS, "high: no valve has current"),
    Field("PIN_ESTOP", "GPIO", GPIOS, "emergency stop, high when pressed"),
    Field("PIN_LED", "GPIO", GPIOS, "LED"),
    Field("PIN_SUPPLY", "GPIO", (26, 27, 28), "the reservoir's sensor, on the chip's own converter"),
)
"""Of every board."""

EXPANDER_FIELDS = (
    Field("PIN_SDA", "GPIO", (0, 4, 8, 12, 16, 20), "I2C0"),
    Field("PIN_SCL", "GPIO", (1, 5, 9, 13, 17, 21), "I2C0"),
    Field("PIN_CLOCK", "GPIO", (21,), "GPOUT0: the clock of all PCA9685"),
)
"""Of a board whose valves are on PCA9685."""
