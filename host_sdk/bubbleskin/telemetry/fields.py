"""Telemetry by columns: names to bits, and a message to a `State`."""

from collections.abc import Iterable

import numpy as np

from bubble_protocol import codec, frame
from bubble_protocol.schema import telemetry
from bubbleskin.checks import several, shown
from bubbleskin.device.faults import board_fault_names, fault_names
from bubbleskin.device.state import State, mode_name, status_name
from bubbleskin.errors import InvalidInput
from bubbleskin.link.message import Message

NAMES = tuple(name for _, name, _, _, _ in telemetry.COLUMNS)
"""What can be chosen."""
USUAL = ("height", "pressure", "target", "status", "faults", "sd")
"""What comes where nothing was chosen."""


def most(bubbles: int) -> int:
    """How many columns a frame has room for."""
    message = codec.BY_NAME["TELEMETRY_FIELDS"]
    return min((frame.PAYLOAD_MAX - message.fixed_size) // (message.stride * bubbles), len(NAMES))


def mask(fields: Iterable[str], bubbles: int) -> int:
    """The bits of some columns; `InvalidInput` for one that there is not, none, or too many."""
    chosen = [fields] if isinstance(fields, str) else several("fields", fields, f"names among {', '.join(NAMES)}")
    for name in chosen:
        if not isinstance(name, str) or name not in NAMES:
            raise InvalidInput(f"Telemetry has no field {shown(name)}; choose among {', '.join(NAMES)}.")
    if not 1 <= len(set(chosen)) <= most(bubbles):
        raise InvalidInput(
            f"{len(set(chosen))} fields for {bubbles} bubbles; a message has room for 1 to {most(bubbles)}."
        )
    return sum(bit for bit, name, _, _, _ in telemetry.COLUMNS if name in chosen)


def state(message: Message, tick: float, bubbles: int, lost: int = 0) -> State:
    """The state in TELEMETRY_FIELDS; of what was not chosen, numbers are NaN, status unknown and faults empty."""
    chosen = [(name, size) for bit, name, _, size, _ in telemetry.COLUMNS if message["fields"] & bit]
    rows = message.columns["value"].reshape(bubbles, len(chosen))
    columns = {name: rows[:, index] * size for index, (name, size) in enumerate(chosen)}
    nothing = np.full(bubbles, np.nan)
    thousandths = {name: column / 1000 for name, column in columns.items()}
    return State(
        time=message["ticks"] * tick,
        mode=mode_name(message["mode"]),
        height_mm=thousandths.get("height", nothing),
        alone_mm=thousandths.get("height", nothing),
        pressure_kpa=thousandths.get("pressure", nothing),
        target_mm=thousandths.get("target", nothing),
        status=tuple(status_name(number) for number in columns.get("status", np.full(bubbles, -1)).tolist()),
        faults=tuple(fault_names(bits) for bits in columns.get("faults", np.zeros(bubbles, int)).tolist()),
        sd_mm=thousandths.get("sd"),
        setpoint_mm=thousandths.get("setpoint"),
        fill_ms=thousandths.get("fill"),
        vent_ms=thousandths.get("vent"),
        supply_kpa=message["supply_pa"] / 1000,
        board_faults=board_fault_names(message["board_faults"]),
        lost=lost,
    )
