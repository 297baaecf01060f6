"""What else there is to judge: power, emergency stop, sensors at rest, reservoir, and shapes."""

from collections.abc import Iterable

from bubbleskin.bringup.evidence import EmergencyStop, Reservoir, Rest
from bubbleskin.bringup.findings import Finding
from bubbleskin.calibrate.verdict import ZERO_MOST_PA
from bubbleskin.device.health import Health
from bubbleskin.fault_guide import guide

NOISE_LEAST_PA, NOISE_MOST_PA = 3.0, 300.0
"""A sensor without noise repeats itself; one with six times the usual has a wire that picks something up."""
DUMPED_KPA = 10.0
"""Less is left in the reservoir two seconds after the dump valve has opened."""
_FULL_SHARE = 0.9


def of_faults(names: Iterable[str], where: str) -> list[Finding]:
    """Faults that the firmware has found, with what its guide says of them."""
    return [
        Finding(
            name,
            (where,),
            f"The firmware has found {name} of {where}.",
            f"{guide(name).remedy}.",
            f"Look for {guide(name).cause}.",
        )
        for name in names
    ]


def power(health: Health, supply_low_kpa: float) -> list[Finding]:
    """Of a board whose supplies are on; its emergency stop is looked at later."""
    findings = of_faults(
        [name for name in health.board_faults if name not in ("emergency_stop", "self_test")], "the board"
    )
    if health.supply_kpa < supply_low_kpa and "supply_lost" not in health.board_faults:
        findings.append(
            Finding(
                "supply_low",
                ("pump",),
                f"The reservoir has {health.supply_kpa:.1f} kPa and needs {supply_low_kpa:.0f} kPa.",
                "Check the pump's current and its hose, and the reservoir and the dump valve for leaks.",
                "It has had ten seconds to fill.",
            )
        )
    return findings


_RIGHT = EmergencyStop(False, True, False)


def emergency_stop(seen: EmergencyStop) -> list[Finding]:
    """Whether its loop is closed while it is released, and open while it is pressed."""
    if seen == _RIGHT:
        return []
    said = "The firmware took it for {} when released, for {} when pressed, and for {} when released again.".format(
        *("pressed" if one else "released" for one in (seen.released, seen.pressed, seen.released_again))
    )
    name, cause, remedy = {
        (True, False, True): (
            "estop_normally_open",
            "The emergency stop works the wrong way round: its contact in the loop is normally open.",
            "Wire the loop to its normally closed contact, so that a broken wire stops the board too.",
        ),
        (True, True, True): (
            "estop_loop_open",
            "The emergency stop's loop is broken, or not plugged in.",
            "Check its plug and its wires: released, the contact joins the input with ground.",
        ),
        (False, False, False): (
            "estop_without_effect",
            "The emergency stop does nothing: its loop is bridged, or the input is shorted to ground.",
            "Find the bridge: pressed, the contact must open the loop.",
        ),
    }.get(
        (seen.released, seen.pressed, seen.released_again),
        (
            "estop_unsure",
            "The emergency stop does not do the same thing twice.",
            "Look for a loose wire or a button that catches, and begin again.",
        ),
    )
    return [Finding(name, ("emergency stop",), cause, remedy, said)]


def rest(seen: Rest) -> list[Finding]:
    """Of every sensor without pressure."""
    findings: list[Finding] = []
    for bubble, (zero, noise, faults) in enumerate(zip(seen.zero_pa, seen.noise_pa, seen.faults, strict=True)):
        where = f"sensor {bubble}"
        told = f"It says {zero:.0f} Pa with {noise:.0f} Pa of noise without pressure."
        if faults:
            findings += of_faults(faults, f"bubble {bubble}")
        elif abs(zero) > ZERO_MOST_PA:
            findings.append(
                Finding(
                    "sensor_zero_off",
                    (where,),
                    f"Sensor {bubble} is off by more than {ZERO_MOST_PA / 1000:g} kPa, or there is pressure in its line.",
                    f"Pull bubble {bubble} off its barb; if the sensor then says the same, check its supply and change it.",
                    told,
                )
            )
        elif noise < NOISE_LEAST_PA:
            findings.append(
                Finding(
                    "sensor_still",
                    (where,),
                    f"Sensor {bubble} repeats itself.",
                    "Check its supply and its converter.",
                    told,
                )
            )
        elif noise > NOISE_MOST_PA:
            findings.append(
                Finding(
                    "sensor_noisy",
                    (where,),
                    f"Sensor {bubble} has too much noise.",
                    "Keep its wires away from the pump's and the valves', and check their ground.",
                    told,
                )
            )
    return findings


def reservoir(seen: Reservoir) -> list[Finding]:
    """Of pump and dump valve."""
    findings = []
    if seen.noticed_kpa is None:
        findings.append(
            Finding(
                "supply_not_noticed",
                ("pump", "reservoir's sensor"),
                "The firmware has not noticed that the pump is off.",
                "Check that the pump was off, and the reservoir's sensor; then begin again.",
                f"The reservoir went from {seen.before_kpa:.1f} to {seen.dumped_kpa:.1f} kPa while air was taken from it.",
            )
        )
    elif seen.dumped_kpa > DUMPED_KPA:
        findings.append(
            Finding(
                "dump_valve_dead",
                ("dump valve",),
                "The dump valve does not open.",
                "Check its wires and its driver, then the valve.",
                f"Two seconds after the firmware had opened it, {seen.dumped_kpa:.1f} kPa were left of {seen.noticed_kpa:.1f}.",
            )
        )
    if seen.filled_kpa < _FULL_SHARE * seen.before_kpa:
        findings.append(
            Finding(
                "supply_low",
                ("pump",),
                "The reservoir does not fill again.",
                "Check that the pump is on, its hose, and that the dump valve closes.",
                f"It reached {seen.filled_kpa:.1f} kPa in {seen.fill_s:.1f} s.",
            )
        )
    return findings


def not_settled(said: str) -> Finding:
    """A shape that was not reached, and no fault that says why."""
    return Finding(
        "not_settled",
        ("bubbles",),
        "A low shape was not reached, and the firmware has found no fault.",
        "Look whether the rubber is the sheet of the board's tables; if it is another, `bubbleskin fit` makes tables of it.",
        said,
    )


def wrong_bubble(bubble: int) -> Finding:
    """Somebody has seen another bubble rise than was asked."""
    return Finding(
        "wrong_bubble",
        (f"bubble {bubble}",),
        f"Another bubble rose than bubble {bubble}.",
        "Check the numbers of the places against the layout in the board's file: see docs/boards.md.",
        "You said so; the sensors agree with the wires.",
    )


def not_flat(left_kpa: list[float]) -> list[Finding]:
    """Bubbles that keep pressure after VENT."""
    return [
        Finding(
            "vent_valve_stuck",
            (f"vent valve {bubble}",),
            f"Vent valve {bubble} does not open far enough.",
            f"Pull tube {bubble} off to let the air out, and clean the valve.",
            f"{kpa:.1f} kPa were left two seconds after VENT.",
        )
        for bubble, kpa in enumerate(left_kpa)
        if kpa > 1.0
    ]
