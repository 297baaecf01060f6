"""The fault log and the settings of a wristband, as plain values."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bubble_protocol.schema import faults, system
from bubble_protocol.schema.settings import SETTINGS
from bubbleskin.errors import InvalidInput
from bubbleskin.link.message import Message

_OF_BUBBLE = {bit: name for bit, name, _ in faults.FAULTS}
_OF_BOARD = {bit: name for bit, name, _ in (*faults.BOARD_FAULTS, *faults.EVENTS)}
_EVENTS = {bit for bit, _, _ in faults.EVENTS}
_NUMBERS = {name: number for number, name, *_ in SETTINGS}

NAMES = {
    "deadman_hold": ("deadman_hold_ms", 1e-3),
    "deadman_vent": ("deadman_vent_ms", 1e-3),
    "budget_kpa_s": ("budget_kpa_s", 1),
}
"""What `configure` takes: the setting on the wire, and its unit in ours."""


@dataclass(frozen=True)
class Fault:
    """One entry of the fault log."""

    id: int
    """Counts from 1 since the wristband's start."""
    time: float
    """Device time, s since boot."""
    name: str
    bubble: int | None
    """None: the board as a whole."""
    value: float
    """What was measured: the bubble's pressure or the reservoir's, kPa; of host_silent the silence, s."""
    acknowledged: bool


@dataclass(frozen=True)
class Setting:
    """One setting in use, and what this wristband allows."""

    value: float
    low: float
    high: float


def entries(reply: Message, tick: float) -> list[Fault]:
    """The entries in a reply to FAULTS_READ."""
    now, columns = reply["ticks"], reply.columns
    found = []
    for number, at, what, bubble, value in zip(*(columns[name].tolist() for name in columns), strict=True):
        board = bubble == faults.BOARD
        found.append(
            Fault(
                id=number,
                time=(now - (now - at) % system.TICKS_WRAP) * tick,
                name=(_OF_BOARD if board else _OF_BUBBLE).get(what, "unknown"),
                bubble=None if board else bubble,
                value=value / 1000,
                acknowledged=number <= reply["acknowledged"],
            )
        )
    return found


def settings(reply: Message) -> dict[str, Setting]:
    """The settings in a reply to SETTING_READ, by their names here."""
    columns = reply.columns
    rows = {
        number: rest
        for number, *rest in zip(*(columns[name].tolist() for name in ("setting", "value", "low", "high")), strict=True)
    }
    return {
        name: Setting(*(number * unit for number in rows[_NUMBERS[wire]]))
        for name, (wire, unit) in NAMES.items()
        if _NUMBERS[wire] in rows
    }


def changes(wanted: Mapping[str, Any], allowed: Mapping[str, Setting]) -> list[tuple[int, int]]:
    """The entries of SETTING_WRITE for what is wanted; `InvalidInput` for what is not allowed."""
    rows = []
    values = {name: setting.value for name, setting in allowed.items()}
    for name, value in wanted.items():
        if name not in allowed:
            raise InvalidInput(f"There is no setting {name!r}; there are {', '.join(allowed)}.")
        limits = allowed[name]
        if not isinstance(value, int | float) or not math.isfinite(value) or not limits.low <= value <= limits.high:
            raise InvalidInput(f"{name} is {value!r}; {limits.low:g} to {limits.high:g} is allowed on this wristband.")
        wire, unit = NAMES[name]
        rows.append((_NUMBERS[wire], round(value / unit)))
        values[name] = value
    if values.get("deadman_vent", math.inf) < values.get("deadman_hold", 0.0):
        raise InvalidInput(
            f"deadman_vent would be {values['deadman_vent']:g} s, less than deadman_hold, {values['deadman_hold']:g} s: "
            "what is vented has to be held before. Give both."
        )
    return rows
