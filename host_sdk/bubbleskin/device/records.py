"""What a device says of itself, as plain values."""

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bubble_protocol.schema import modes, statuses
from bubble_protocol.schema.faults import BOARD_FAULTS, FAULTS
from bubble_protocol.schema.self_test import OUTCOMES
from bubbleskin.device.stored import SOURCES
from bubbleskin.link.message import SCHEMA_CRC, Message

_MODES = {number: name for number, name, _ in modes.MODES}
_STATUSES = {number: name for number, name, _ in statuses.STATUSES}
_SELF_TESTS = {number: name for number, name, _ in OUTCOMES}
_TRANSLATED = {"mode", "board_faults", "self_test", "untrue_zero", "unfilled", "unvented", "store"}


def mode_name(number: int) -> str:
    """What the board does."""
    return _MODES.get(number, "unknown")


def status_name(number: int) -> str:
    """What a bubble does."""
    return _STATUSES.get(number, "unknown")


def fault_names(bits: int) -> tuple[str, ...]:
    """Faults of a bubble."""
    return tuple(name for bit, name, _ in FAULTS if bits & bit)


def board_fault_names(bits: int) -> tuple[str, ...]:
    """Faults of the board."""
    return tuple(name for bit, name, _ in BOARD_FAULTS if bits & bit)


def _bits(mask: int) -> tuple[int, ...]:
    return tuple(bit for bit in range(32) if mask >> bit & 1)


_NO_PRESSURE_KPA = 1.0
"""What an empty bubble may still have, or a sensor be off by: 0.03 mm."""
_AT_REST_MM = 0.2
"""How much higher than at rest a height may be and still take no pressure."""


@dataclass(frozen=True)
class Info:
    """Who a device is: constant from one boot to the next, but for `tables_crc`."""

    board: str
    bubbles: int
    firmware: str
    protocol: tuple[int, int]
    same_schema: bool
    """Whether device and SDK were made from the same message schema."""
    boot_id: int
    tick: float
    """Period of the control loop, s."""
    height_rest_mm: float
    height_max_mm: float
    pressure_max_kpa: float
    tables_crc: int

    @classmethod
    def of(cls, hello: Message) -> Self:
        """From the reply to HELLO."""
        return cls(
            board=str(hello.fields["board"]),
            bubbles=hello["bubbles"],
            firmware=f"{hello['firmware_major']}.{hello['firmware_minor']}.{hello['firmware_patch']}",
            protocol=(hello["protocol_min"], hello["protocol_max"]),
            same_schema=hello["schema_crc"] == SCHEMA_CRC,
            boot_id=hello["boot_id"],
            tick=hello["tick_us"] * 1e-6,
            height_rest_mm=hello["height_rest_um"] / 1000,
            height_max_mm=hello["height_max_um"] / 1000,
            pressure_max_kpa=hello["pressure_max_pa"] / 1000,
            tables_crc=hello["tables_crc"],
        )


@dataclass(frozen=True)
class Health:
    """How a device is: its counters since boot."""

    time: float
    """Device time, s since boot."""
    late_ticks: int
    tick_worst: float
    """The longest tick, s."""
    exceptions: int
    """Exceptions that made the firmware vent."""
    frames_good: int
    frames_bad: int
    telemetry_dropped: int
    heap_free: int
    """Bytes; 0 where the heap has no limit."""
    supply_kpa: float
    tables_crc: int
    mode: str
    board_faults: tuple[str, ...]
    """Faults of the board as a whole, such as emergency_stop or watchdog; they stay until `clear_faults`."""
    self_test: str
    """not_run, running, passed, failed or skipped."""
    untrue_zero: tuple[int, ...]
    """Bubbles whose sensor was off or silent without pressure, in the self-test."""
    unfilled: tuple[int, ...]
    """Bubbles that a fill pulse did not reach."""
    unvented: tuple[int, ...]
    """Bubbles that did not vent."""
    store: str
    """Where the tables came from: slot_a, slot_b; or factory, damaged, foreign, none, see `StoreInfo.source`."""

    @classmethod
    def of(cls, reply: Message, tick: float) -> Self:
        """From the reply to INFO."""
        names = {field.name for field in fields(cls)} & set(reply.fields)
        same: dict[str, Any] = {name: reply[name] for name in names - _TRANSLATED}
        return cls(
            time=reply["ticks"] * tick,
            tick_worst=reply["tick_worst_us"] * 1e-6,
            supply_kpa=reply["supply_pa"] / 1000,
            mode=mode_name(reply["mode"]),
            board_faults=board_fault_names(reply["board_faults"]),
            self_test=_SELF_TESTS.get(reply["self_test"], "unknown"),
            untrue_zero=_bits(reply["untrue_zero"]),
            unfilled=_bits(reply["unfilled"]),
            unvented=_bits(reply["unvented"]),
            store=SOURCES.get(reply["store"], "unknown"),
            **same,
        )


@dataclass(frozen=True, eq=False)
class TickHistogram:
    """How long ticks took and how late they began, since boot; bins (k,) of equal width, the last one open above."""

    work_bin: float
    """Width of a bin of `worked`, s."""
    delay_bin: float
    """Width of a bin of `delayed`, s."""
    worked: NDArray[np.int64]
    """Ticks by how long they took."""
    delayed: NDArray[np.int64]
    """Ticks by how long after their period they began."""

    @classmethod
    def of(cls, reply: Message) -> Self:
        """From the reply to TICKS."""
        return cls(reply["work_us"] * 1e-6, reply["delay_us"] * 1e-6, reply.columns["worked"], reply.columns["delayed"])


@dataclass(frozen=True, eq=False)
class State:
    """All bubbles at one moment; arrays have one entry per bubble, in layout order."""

    time: float
    """Device time, s since boot."""
    mode: str
    """idle, active, holding, boot, venting, faulted or stopped: see docs/safety.md."""
    height_mm: NDArray[np.float64]
    """The firmware's estimate."""
    pressure_kpa: NDArray[np.float64]
    """Gauge, at the sensor."""
    target_mm: NDArray[np.float64]
    status: tuple[str, ...]
    """resting, moving, settled, stopped or fault."""
    faults: tuple[tuple[str, ...], ...]
    # Only telemetry with chosen fields has these; elsewhere they are None or NaN.
    setpoint_mm: NDArray[np.float64] | None = None
    """Where the way to the target stands."""
    fill_ms: NDArray[np.float64] | None = None
    """For how long the fill valve is energised in this tick."""
    vent_ms: NDArray[np.float64] | None = None
    supply_kpa: float = float("nan")
    """The reservoir's gauge pressure."""
    board_faults: tuple[str, ...] = ()
    lost: int = 0
    """Telemetry that was due since it was asked for and has not come."""

    @classmethod
    def of(cls, message: Message, tick: float, lost: int = 0) -> Self:
        """From the reply to STATE, or from TELEMETRY."""
        columns = message.columns
        return cls(
            time=message["ticks"] * tick,
            mode=mode_name(message["mode"]),
            height_mm=columns["height_um"] / 1000,
            pressure_kpa=columns["pressure_pa"] / 1000,
            target_mm=columns["target_um"] / 1000,
            status=tuple(status_name(status) for status in columns["status"].tolist()),
            faults=tuple(fault_names(faults) for faults in columns["faults"].tolist()),
            lost=lost,
        )

    @property
    def unsettled(self) -> list[int]:
        """The bubbles that are not where they were asked to be: settled there, or empty because that is what was asked.

        A bubble also rests while it empties, and at the beginning of a ramp from rest.
        """
        empty = (self.pressure_kpa < _NO_PRESSURE_KPA) & (self.height_mm > self.target_mm - _AT_REST_MM)
        return [
            bubble
            for bubble, status in enumerate(self.status)
            if not (status == "settled" or (status == "resting" and empty[bubble]))
        ]

    @property
    def settled(self) -> bool:
        """Whether every bubble is where it was asked to be."""
        return not self.unsettled
