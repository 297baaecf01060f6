"""What can go wrong on a wristband: names of faults, what to do about them, and its fault log."""

from dataclasses import dataclass

from bubble_protocol.schema import faults, system
from bubbleskin.fault_guide import guide
from bubbleskin.link.link import Link
from bubbleskin.link.message import Message

MEANINGS = {name: meaning for _, name, meaning in (*faults.FAULTS, *faults.BOARD_FAULTS, *faults.EVENTS)}
"""What each fault means, by name."""

_OF_BUBBLE = {bit: name for bit, name, _ in faults.FAULTS}
_OF_BOARD = {bit: name for bit, name, _ in (*faults.BOARD_FAULTS, *faults.EVENTS)}


def fault_names(bits: int) -> tuple[str, ...]:
    """The faults of a bubble whose bits are set."""
    return tuple(name for bit, name, _ in faults.FAULTS if bits & bit)


def board_fault_names(bits: int) -> tuple[str, ...]:
    """The faults of the board whose bits are set."""
    return tuple(name for bit, name, _ in faults.BOARD_FAULTS if bits & bit)


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

    @property
    def meaning(self) -> str:
        """What the wristband has found."""
        return MEANINGS.get(self.name, "a fault that this SDK does not know")

    @property
    def cause(self) -> str:
        """How that may have come about."""
        return guide(self.name).cause

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return guide(self.name).remedy

    @property
    def where(self) -> str:
        """The bubble or the board, in words."""
        return "the board" if self.bubble is None else f"bubble {self.bubble}"

    def __repr__(self) -> str:
        seen = "acknowledged" if self.acknowledged else "not acknowledged"
        return f"<Fault {self.id}: {self.name} of {self.where} at {self.time:.3f} s, {seen}>"

    def __str__(self) -> str:
        return (
            f"{self.name} of {self.where} at {self.time:.3f} s: {self.meaning}. Look for {self.cause}. {self.remedy}."
        )


async def acknowledged(link: Link, tick: float, request: str, fields: tuple[int, ...] = ()) -> float:
    """Acknowledge by CLEAR or FAULTS_ACK: seconds until what it was has been isolated for long enough; `tick`: s."""
    left_ms = (await link.call(request, fields))["isolated_ms"]
    return left_ms * 1e-3 + tick if left_ms else 0.0


async def read_log(link: Link, tick: float) -> list[Fault]:
    """All entries that a device has, oldest first; `tick`: its period, s."""
    found: list[Fault] = []
    while True:
        reply = await link.call("FAULTS_READ", (found[-1].id if found else 0,))
        more = _entries(reply, tick)
        found += more
        if not more or found[-1].id == reply["newest"]:
            return found


def _entries(reply: Message, tick: float) -> list[Fault]:
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
