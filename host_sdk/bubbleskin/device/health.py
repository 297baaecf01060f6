"""How a device is: the replies to INFO and TICKS."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bubble_protocol.schema.self_test import OUTCOMES
from bubbleskin.device.faults import board_fault_names
from bubbleskin.device.state import bubbles_of, mode_name
from bubbleskin.device.store import SOURCES
from bubbleskin.link.message import Message

_SELF_TESTS = {number: name for number, name, _ in OUTCOMES}


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

    def __repr__(self) -> str:
        faults = ", ".join(self.board_faults) or "no fault of the board"
        return f"<Health {self.mode}, {faults}, supply {self.supply_kpa:.1f} kPa, self-test {self.self_test}>"

    @classmethod
    def of(cls, reply: Message, tick: float) -> Self:
        """From the reply to INFO; `tick`: the device's period, s."""
        return cls(
            time=reply["ticks"] * tick,
            late_ticks=reply["late_ticks"],
            tick_worst=reply["tick_worst_us"] * 1e-6,
            exceptions=reply["exceptions"],
            frames_good=reply["frames_good"],
            frames_bad=reply["frames_bad"],
            telemetry_dropped=reply["telemetry_dropped"],
            heap_free=reply["heap_free"],
            supply_kpa=reply["supply_pa"] / 1000,
            tables_crc=reply["tables_crc"],
            mode=mode_name(reply["mode"]),
            board_faults=board_fault_names(reply["board_faults"]),
            self_test=_SELF_TESTS.get(reply["self_test"], "unknown"),
            untrue_zero=bubbles_of(reply["untrue_zero"]),
            unfilled=bubbles_of(reply["unfilled"]),
            unvented=bubbles_of(reply["unvented"]),
            store=SOURCES.get(reply["store"], "unknown"),
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

    def __repr__(self) -> str:
        return f"<TickHistogram {self.worked.sum()} ticks in bins of {self.work_bin * 1e6:g} µs>"

    @classmethod
    def of(cls, reply: Message) -> Self:
        """From the reply to TICKS."""
        return cls(reply["work_us"] * 1e-6, reply["delay_us"] * 1e-6, reply.columns["worked"], reply.columns["delayed"])
