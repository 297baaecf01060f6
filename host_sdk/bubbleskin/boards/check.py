"""Whether a board's file defines what firmware and simulator need, and what the hardware allows."""

import re
from itertools import combinations, pairwise
from math import dist
from types import ModuleType
from typing import Any

from bubble_firmware.control.nominal import KNOTS
from bubble_firmware.control.table import pressure_top
from bubble_firmware.drivers import clock, pca9685
from bubbleskin.boards.fields import EXPANDER_FIELDS, FIELDS, GPIOS, NEIGHBOUR, Field
from bubbleskin.errors import InvalidInput

NAME_BYTES = 16
"""Of a board's name on the wire."""
PWM_BUBBLES = 7
"""Two valves a PWM slice, and the eighth slice is the pump's."""
PER_CHIP = 8
"""Bubbles that one PCA9685 or one MCP3208 has channels for."""
NEAREST = 0.75
"""So many pitches must be between any two bubbles."""

_SYSTEM_MHZ = 125
_LAYOUT_MAX_UM = 500_000
_RISING = (  # each less than the next
    ("HEIGHT_REST_UM", "HEIGHT_MAX_UM"),
    ("BUDGET_FREE_PA", "PRESSURE_MAX_PA", "SUPPLY_PA", "SUPPLY_MAX_PA"),
    ("SUPPLY_LOW_PA", "SUPPLY_PA"),
    ("DEADBAND_UM", "SETTLED_UM"),
    ("COUNT_LOW", "SENSOR_ZERO", "COUNT_HIGH"),
    ("COUNT_LOW", "SUPPLY_ZERO", "COUNT_HIGH"),
    ("PULSE_MIN_US", "TICK_US"),
)


def check(data: ModuleType, what: str, name: str | None = None) -> None:
    """Raise `InvalidInput`, with a sentence about `what`, unless `data` is a whole board; `name`: that of its file."""
    try:
        _check_name(data, name)
        for field in FIELDS:
            _check_number(data, field)
        for names in _RISING:
            _check_rising(data, names)
        _check_limits(data)
        _check_layout(data)
        _check_valves(data)
        _check_chips(data, "CONVERTERS", range(30), "chip select and channels of each MCP3208")
        _check_pins(data)
    except _FlawError as flaw:
        raise InvalidInput(f"{what} {flaw}.") from None


class _FlawError(Exception):
    pass


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _get(data: ModuleType, name: str, meaning: str) -> Any:
    try:
        return getattr(data, name)
    except AttributeError:
        raise _FlawError(f"does not define {name}: {meaning}") from None


def _check_name(data: ModuleType, name: str | None) -> None:
    found = _get(data, "NAME", "its name")
    if not isinstance(found, str) or not re.fullmatch(rf"[a-z][a-z0-9_]{{0,{NAME_BYTES - 1}}}", found):
        raise _FlawError(
            f"has NAME = {found!r}; a name is up to {NAME_BYTES} small letters, digits and underscores, a letter first"
        )
    if name is not None and found != name:
        raise _FlawError(f"has NAME = {found!r}; a board is called as its file, here {name!r}")


def _check_number(data: ModuleType, field: Field) -> None:
    value = _get(data, field.name, f"{field.meaning}, {field.allowed_text} {field.unit}".rstrip())
    if not _is_whole(value):
        raise _FlawError(
            f"has {field.name} = {value!r}; a whole number is wanted, {field.allowed_text} {field.unit}".rstrip()
        )
    if value not in field.allowed:
        unit = f" {field.unit}" if field.unit else ""
        raise _FlawError(f"has {field.name} = {value}{unit} ({field.meaning}); {field.allowed_text}{unit} is allowed")


def _check_rising(data: ModuleType, names: tuple[str, ...]) -> None:
    for less, more in pairwise(names):
        low, high = getattr(data, less), getattr(data, more)
        if low >= high:
            raise _FlawError(f"has {less} = {low} and {more} = {high}; {less} must be the lesser")


def _check_limits(data: ModuleType) -> None:
    """A sensor must see its limit from below, and a bubble at its greatest height stay within its pressure."""
    for zero, scale, limit in (
        ("SENSOR_ZERO", "SENSOR_PA_PER_COUNT", "PRESSURE_MAX_PA"),
        ("SUPPLY_ZERO", "SUPPLY_PA_PER_COUNT", "SUPPLY_MAX_PA"),
    ):
        reach = (data.COUNT_HIGH - getattr(data, zero)) * getattr(data, scale)
        if reach <= getattr(data, limit):
            raise _FlawError(
                f"has {limit} = {getattr(data, limit)}, and its sensor is believed up to {reach} Pa only; "
                f"lower {limit} or mend {zero} and {scale}"
            )
    needed = next(pressure for height, pressure in KNOTS if height >= data.HEIGHT_MAX_UM)
    if needed >= data.PRESSURE_MAX_PA:
        raise _FlawError(
            f"has PRESSURE_MAX_PA = {data.PRESSURE_MAX_PA}, and HEIGHT_MAX_UM = {data.HEIGHT_MAX_UM} takes {needed} Pa; "
            "lower the height or raise the pressure"
        )
    if pressure_top(data) <= needed:
        raise _FlawError(
            f"has AIR_MAX_UJ = {data.AIR_MAX_UJ}, and HEIGHT_MAX_UM = {data.HEIGHT_MAX_UM} at {needed} Pa takes more; "
            "lower the height or raise the air"
        )
    for name in ("VALVE_OPENS_US", "VALVE_CLOSES_US"):
        if getattr(data, name) > data.TICK_US // 2:
            raise _FlawError(
                f"has {name} = {getattr(data, name)}; half of TICK_US, {data.TICK_US // 2} µs, is the most"
            )


def _check_layout(data: ModuleType) -> None:
    layout = _get(data, "LAYOUT", "where its bubbles are, a pair (x, y) in µm for each")
    if not isinstance(layout, tuple) or not all(_is_pair(pair) for pair in layout):
        raise _FlawError("has a LAYOUT that is not a tuple of pairs of whole numbers, (x, y) in µm for each bubble")
    if len(layout) != data.BUBBLES:
        raise _FlawError(
            f"has {len(layout)} pairs in LAYOUT and BUBBLES = {data.BUBBLES}; there must be a pair for each bubble"
        )
    far = [i for i, (x, y) in enumerate(layout) if max(abs(x), abs(y)) > _LAYOUT_MAX_UM]
    if far:
        raise _FlawError(
            f"has bubble {far[0]} at {layout[far[0]]} µm in LAYOUT; {_LAYOUT_MAX_UM} µm from the middle is the most"
        )
    if data.BUBBLES == 1:
        return
    gap, i, j = min((dist(layout[i], layout[j]), i, j) for i, j in combinations(range(data.BUBBLES), 2))
    if gap < NEAREST * data.PITCH_UM:
        raise _FlawError(
            f"has bubbles {i} and {j} only {gap:.0f} µm from each other in LAYOUT; at least {NEAREST:g} of "
            f"PITCH_UM = {data.PITCH_UM} is wanted"
        )
    if gap >= NEIGHBOUR * data.PITCH_UM:
        raise _FlawError(
            f"has no bubbles nearer to each other than {gap:.0f} µm in LAYOUT, and PITCH_UM = {data.PITCH_UM}: mend one of them"
        )


def _is_pair(pair: object) -> bool:
    return isinstance(pair, tuple) and len(pair) == 2 and all(_is_whole(value) for value in pair)


def _check_valves(data: ModuleType) -> None:
    valves = _get(data, "VALVES", 'what drives its valves, "pwm" or "pca9685"')
    if valves == "pwm":
        if data.BUBBLES > PWM_BUBBLES:
            raise _FlawError(
                f'has VALVES = "pwm" and {data.BUBBLES} bubbles; the chip has PWM for {PWM_BUBBLES}: use "pca9685"'
            )
    elif valves == "pca9685":
        for field in EXPANDER_FIELDS:
            _check_number(data, field)
        _check_chips(data, "DRIVERS", range(0x40, 0x80), "I2C address and bubbles of each PCA9685")
        try:
            clock.divider(_SYSTEM_MHZ, data.TICK_US, pca9685.CLOCKS)
        except ValueError:
            raise _FlawError(f"has TICK_US = {data.TICK_US}; with PCA9685 it must be a multiple of 2000") from None
    else:
        raise _FlawError(f'has VALVES = {valves!r}; "pwm" and "pca9685" are known')


def _check_chips(data: ModuleType, name: str, keys: range, meaning: str) -> None:
    chips = _get(data, name, f"{meaning}, a pair for each")
    if not isinstance(chips, tuple) or not all(_is_pair(pair) for pair in chips):
        raise _FlawError(f"has {name} = {chips!r}; a tuple of pairs is wanted: {meaning}")
    for key, bubbles in chips:
        if key not in keys or bubbles not in range(1, PER_CHIP + 1):
            raise _FlawError(
                f"has ({key}, {bubbles}) in {name}; {keys[0]} to {keys[-1]} and 1 to {PER_CHIP} are allowed: {meaning}"
            )
    if len({key for key, _ in chips}) < len(chips):
        raise _FlawError(f"names one chip twice in {name}: {meaning}")
    if sum(bubbles for _, bubbles in chips) != data.BUBBLES:
        raise _FlawError(f"has {sum(bubbles for _, bubbles in chips)} bubbles in {name} and BUBBLES = {data.BUBBLES}")


def _check_pins(data: ModuleType) -> None:
    """No pin has two uses, and each is one that a Pico hands out."""
    uses = [(field.name, getattr(data, field.name)) for field in FIELDS if field.name.startswith("PIN_")]
    uses += [("CONVERTERS", pin) for pin, _ in data.CONVERTERS]
    if data.VALVES == "pwm":
        uses += [('VALVES = "pwm"', pin) for pin in range(2 * data.BUBBLES)]
    else:
        uses += [(field.name, getattr(data, field.name)) for field in EXPANDER_FIELDS]
    taken: dict[int, str] = {}
    for name, pin in uses:
        if pin not in GPIOS:
            raise _FlawError(f"uses GPIO {pin} for {name}; a Raspberry Pi Pico does not hand it out")
        if pin in taken:
            raise _FlawError(f"uses GPIO {pin} twice, for {taken[pin]} and for {name}")
        taken[pin] = name
