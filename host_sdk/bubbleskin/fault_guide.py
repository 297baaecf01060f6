"""For every fault of the schema, how it comes about and what to do: errors, `bubbleskin info` and docs/safety.md say it.

Names and bits are the protocol's (`bubble_protocol.schema.faults`). Cause and remedy stand here, on the host, because the
device has no use for sentences and little memory for them.
"""

from collections.abc import Iterable
from typing import NamedTuple


class Guide(NamedTuple):
    """How a fault comes about, and what its user does about it: a phrase, and a sentence without its full stop."""

    cause: str
    remedy: str


BUBBLE_GUIDE = {
    "overpressure": Guide(
        "a blocked tube, a pinched bubble, or a height that this bubble's rubber does not allow",
        "Free the tube and the bubble, or ask for lower heights",
    ),
    "sensor_lost": Guide(
        "a broken wire, a sensor that is not plugged in, or a converter without supply",
        "Check the sensor's wires and its converter",
    ),
    "valve_time": Guide(
        "a reservoir with too little pressure, or a blocked restrictor: filling takes too long",
        "Check the supply pressure in `health()` and the restrictor",
    ),
    "leak": Guide(
        "a bubble off its barb, a cut, or dirt in the vent valve",
        "Push the bubble back onto its barb; look for cuts, and for dirt in the vent valve",
    ),
    "no_air": Guide(
        "a kinked or lost tube, or a fill valve that does not open",
        "Straighten the tube or put it back; check the fill valve's wires",
    ),
    "valve_stuck": Guide(
        "dirt in a valve or a broken wire to it, or a sensor whose zero has moved",
        "Clean the valves and check their wires; check the sensor's zero with the bubble vented",
    ),
    "sensor_stuck": Guide(
        "a converter that repeats itself, or a sensor without supply",
        "Check the sensor's supply and its converter",
    ),
    "budget": Guide(
        "great heights held for long: pressure above 20 kPa times time adds up",
        "Let the bubble rest, vented, for a minute or two",
    ),
}

BOARD_GUIDE = {
    "emergency_stop": Guide(
        "the button, or a broken wire in its loop",
        "Release the button; if it was not pressed, check the wires of its loop",
    ),
    "supply_lost": Guide(
        "a pump without current, a leak before the valves, a dump valve that stays open, or a sensor of the reservoir that "
        "repeats itself, leaps or does not see the pump's work",
        "Check the pump's current, the reservoir's tubes and the dump valve, then the reservoir's sensor and its wires",
    ),
    "valve_chip": Guide(
        "a loose wire or a missing supply of a valve driver",
        "Check the valve drivers' wires and their supply",
    ),
    "sensor_chip": Guide(
        "a loose wire or a missing supply of a converter",
        "Check the converters' wires and their supply",
    ),
    "exception": Guide(
        "a mistake in the firmware",
        "Update the firmware with `bubbleskin flash`; if it comes again, report it with the output of `bubbleskin info`",
    ),
    "watchdog": Guide(
        "a mistake in the firmware, or a supply that failed for a moment",
        "Check the supply; update the firmware with `bubbleskin flash` if it comes again",
    ),
    "self_test": Guide(
        "a sensor or a valve that did not do what it should without a command",
        "Look in `health()` which bubbles failed at what, mend them and restart the wristband",
    ),
    "overfilled": Guide(
        "dirt in a fill valve, which stays open without current",
        "Clean or change the fill valve of the bubble that has a fault too",
    ),
}

EVENT_GUIDE = {
    "host_silent": Guide(
        "the host's program ended, slept or hung, or its cable was pulled",
        "Keep the connection open for as long as the shape shall stand; `configure(deadman_vent=…)` gives it more time",
    ),
}

GUIDE = BUBBLE_GUIDE | BOARD_GUIDE | EVENT_GUIDE
"""By name."""

_UNKNOWN = Guide("a cause that this SDK does not know", "Update it with `pip install --upgrade bubbleskin`")


def guide(name: str) -> Guide:
    """Cause and remedy of the fault `name`; newer firmware may know more faults than this SDK."""
    return GUIDE.get(name, _UNKNOWN)


def remedies(names: Iterable[str]) -> str:
    """What to do about several faults, in sentences, each said once."""
    return " ".join(dict.fromkeys(f"{guide(name).remedy}." for name in names))
