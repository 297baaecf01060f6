"""What a bring-up finds: a name for scripts, and a cause and a remedy in sentences."""

from dataclasses import dataclass

MEANINGS = {
    "supply_low": "the reservoir has less pressure than is needed, or does not fill again",
    "estop_normally_open": "the emergency stop works the wrong way round",
    "estop_loop_open": "its loop is broken, or not plugged in",
    "estop_without_effect": "its loop is bridged: pressing it does nothing",
    "estop_unsure": "it does not do the same thing twice",
    "sensor_zero_off": "a sensor is off by more than 1.5 kPa, or there is pressure in its line",
    "sensor_still": "a sensor repeats itself",
    "sensor_noisy": "a sensor has more than six times the usual noise",
    "tubes_swapped": "tubes lead to each other's bubbles",
    "fill_valves_swapped": "wires of fill valves are exchanged",
    "vent_valves_swapped": "wires of vent valves are exchanged",
    "fill_and_vent_swapped": "the output of a vent valve drives a fill valve",
    "sensor_wires_swapped": "wires of sensors are exchanged",
    "fill_valve_dead": "a fill valve lets no air in",
    "vent_valve_dead": "a vent valve does not close, or the bubble leaks as much",
    "vent_valve_stuck": "a vent valve does not open",
    "bubble_off": "a bubble is not on its barb, or has a hole",
    "supply_not_noticed": "the firmware has not noticed that the pump is off",
    "dump_valve_dead": "the dump valve does not open",
    "wrong_bubble": "another bubble rose than was asked",
    "not_settled": "a low shape was not reached, and the firmware has found no fault",
}
"""What there is to find, by name, beside the faults that the firmware finds itself: `bubbleskin.fault_guide`."""


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, by name, with the parts that it is about."""

    name: str
    """Such as tubes_swapped: docs/bring-up.md lists them."""
    parts: tuple[str, ...]
    """Such as "tube 1", "fill valve 4": by the numbers that are written on them."""
    cause: str
    """A sentence."""
    remedy: str
    """A sentence."""
    seen: str
    """What it was inferred from: a sentence."""

    def __str__(self) -> str:
        return f"{self.cause} {self.seen} {self.remedy}"
