"""What all bubbles do at one moment: the replies to STATE, and what telemetry makes."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bubble_protocol.schema import modes, statuses
from bubbleskin.device.faults import fault_names
from bubbleskin.link.message import Message
from bubbleskin.pictured import Pictured

_MODES = {number: name for number, name, _ in modes.MODES}
_STATUSES = {number: name for number, name, _ in statuses.STATUSES}

_NO_PRESSURE_KPA = 1.0
"""What an empty bubble may still have, or a sensor be off by: 0.03 mm."""
_AT_REST_MM = 0.2
"""How much higher than at rest a height may be and still take no pressure."""
_LISTED = 7
"""Heights that `repr` lists; of more bubbles it gives the lowest and the highest."""


def mode_name(number: int) -> str:
    """What the board does."""
    return _MODES.get(number, "unknown")


def status_name(number: int) -> str:
    """What a bubble does."""
    return _STATUSES.get(number, "unknown")


def bubbles_of(mask: int) -> tuple[int, ...]:
    """The bubbles whose bits are set."""
    return tuple(bubble for bubble in range(32) if mask >> bubble & 1)


@dataclass(frozen=True, eq=False)
class State(Pictured):
    """All bubbles at one moment; arrays have one entry per bubble, in layout order."""

    time: float
    """Device time, s since boot."""
    mode: str
    """idle, active, holding, boot, venting, faulted or stopped: see docs/safety.md."""
    height_mm: NDArray[np.float64]
    """The top of each bubble above the base plane, as far as is known: what neighbours do included."""
    alone_mm: NDArray[np.float64]
    """The firmware's estimate: how high each bubble would be by itself, with the air that it has."""
    pressure_kpa: NDArray[np.float64]
    """Gauge, at the sensor."""
    target_mm: NDArray[np.float64]
    """The heights asked."""
    status: tuple[str, ...]
    """resting, moving, settled, unsure, missed, stopped or fault. Unsure is at its target as far as is known, which is not far
    enough; missed has come to rest elsewhere, because neighbours hold it there or because the target cannot be had."""
    faults: tuple[tuple[str, ...], ...]
    sd_mm: NDArray[np.float64] | None = None
    """Standard deviation of the heights; nan where nobody knows who lifts whom. None where the firmware is too old to know or
    telemetry was not asked for it."""
    # Only telemetry with chosen fields has these; elsewhere they are None or NaN.
    setpoint_mm: NDArray[np.float64] | None = None
    """Where the way to the target stands, of each bubble by itself."""
    fill_ms: NDArray[np.float64] | None = None
    """For how long the fill valve is energised in this tick."""
    vent_ms: NDArray[np.float64] | None = None
    supply_kpa: float = float("nan")
    """The reservoir's gauge pressure."""
    board_faults: tuple[str, ...] = ()
    lost: int = 0
    """Telemetry that was due since it was asked for and has not come."""

    def __repr__(self) -> str:
        low, high = np.min(self.height_mm), np.max(self.height_mm)
        heights = f"{low:.2f} to {high:.2f}"
        if len(self.height_mm) <= _LISTED:
            heights = ", ".join(f"{height:.2f}" for height in self.height_mm)
        ill = [f"bubble {bubble}: {', '.join(faults)}" for bubble, faults in enumerate(self.faults) if faults]
        doing = "; ".join(ill) or self._doing
        return f"<State at {self.time:.3f} s: {self.mode}, {heights} mm, {doing}>"

    @property
    def _doing(self) -> str:
        if not self.arrived:
            return "not settled"
        return next((worst for worst in ("missed", "unsure") if worst in self.status), "settled")

    @classmethod
    def of(cls, message: Message, tick: float, lost: int = 0) -> Self:
        """From the reply to STATE or ESTIMATE, or from TELEMETRY."""
        columns = message.columns
        return cls(
            time=message["ticks"] * tick,
            mode=mode_name(message["mode"]),
            height_mm=columns["height_um"] / 1000,
            alone_mm=columns["height_um"] / 1000,
            pressure_kpa=columns["pressure_pa"] / 1000,
            target_mm=columns["target_um"] / 1000,
            status=tuple(status_name(status) for status in columns["status"].tolist()),
            faults=tuple(fault_names(faults) for faults in columns["faults"].tolist()),
            sd_mm=columns["sd_um"] / 1000 if "sd_um" in columns else None,
            lost=lost,
        )

    @property
    def unsettled(self) -> list[int]:
        """The bubbles that are not where they were asked to be, as far as is known, or empty because that is what was asked.

        A bubble also rests while it empties, and at the beginning of a ramp from rest.
        """
        empty = (self.pressure_kpa < _NO_PRESSURE_KPA) & (self.height_mm > self.target_mm - _AT_REST_MM)
        return [
            bubble
            for bubble, status in enumerate(self.status)
            if not (status in ("settled", "unsure", "missed") or (status == "resting" and empty[bubble]))
        ]

    @property
    def arrived(self) -> bool:
        """Whether every bubble is where it was asked to be, as far as is known, or has missed that for good."""
        return not self.unsettled

    @property
    def settled(self) -> bool:
        """Whether every bubble is where it was asked to be, and that is known well enough: none is unsure or has missed it."""
        return self.arrived and "unsure" not in self.status and "missed" not in self.status
