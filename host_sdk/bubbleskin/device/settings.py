"""What can be set on a wristband: the replies to SETTING_READ, and what SETTING_WRITE takes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bubble_protocol.schema.settings import SETTINGS
from bubbleskin.checks import number
from bubbleskin.errors import InvalidInput
from bubbleskin.link.message import Message

_NUMBERS = {name: number for number, name, *_ in SETTINGS}

NAMES = {
    "deadman_hold": ("deadman_hold_ms", 1e-3),
    "deadman_vent": ("deadman_vent_ms", 1e-3),
    "budget_kpa_s": ("budget_kpa_s", 1),
    "atmosphere_kpa": ("atmosphere_pa", 1e-3),
    "rezero_mm": ("rezero_um", 1e-3),
}
"""What `configure` takes: the setting on the wire, and its unit in ours."""


@dataclass(frozen=True)
class Setting:
    """One setting in use, and what this wristband allows."""

    value: float
    low: float
    high: float


def settings_of(reply: Message) -> dict[str, Setting]:
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


def changes(wanted: Mapping[str, float], allowed: Mapping[str, Setting]) -> list[tuple[int, int]]:
    """The entries of SETTING_WRITE for what is wanted; `InvalidInput` for what is not allowed."""
    rows = []
    values = {name: setting.value for name, setting in allowed.items()}
    for name, value in wanted.items():
        if name not in allowed:
            raise InvalidInput(f"There is no setting {name!r}; there are {', '.join(allowed)}.")
        limits = allowed[name]
        value = number(name, value, limits.low, limits.high)
        wire, unit = NAMES[name]
        rows.append((_NUMBERS[wire], round(value / unit)))
        values[name] = value
    if values.get("deadman_vent", math.inf) < values.get("deadman_hold", 0.0):
        raise InvalidInput(
            f"deadman_vent would be {values['deadman_vent']:g} s, less than deadman_hold, {values['deadman_hold']:g} s: "
            "what is vented has to be held before. Give both."
        )
    return rows
