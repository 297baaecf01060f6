"""What a wristband keeps without power: the replies to STORE_INFO, STORE_SAVE and STORE_RESET."""

from dataclasses import dataclass
from typing import Self

from bubble_protocol.schema import errors, store
from bubbleskin.link.message import Message

SOURCES = {number: name for number, name, _ in store.SOURCES}
_SLOTS = {number: name for number, name, _ in store.SLOTS}
_ERRORS = {number: name for number, name, _ in errors.ERRORS}


@dataclass(frozen=True)
class StoreInfo:
    """The state of a wristband's store."""

    source: str
    """Where what was in use at boot, or was saved since, stands: slot_a, slot_b; or why it is what the firmware was made
    with: factory (nothing stored), damaged, foreign (of newer firmware or another board), none (no store)."""
    generation: int
    """Number of the record in use; 65535 is followed by 0."""
    schema: int
    slots: tuple[str, str]
    """What each slot holds: blank, valid, corrupt, foreign or rejected."""
    wear: tuple[int, int]
    """How often each slot has been erased, at least; flash is good for 100 000 times."""
    size: int
    """Bytes of the record in use."""
    capacity: int
    """Bytes of a slot."""
    tables_crc: int
    """CRC-32 of the tables that are stored; those in use, of `health().tables_crc`, are others while they are not saved."""
    error: str
    """Why the last save was refused; empty: it was not."""

    def __repr__(self) -> str:
        failed = f", last save refused: {self.error}" if self.error else ""
        return (
            f"<StoreInfo {self.source}, generation {self.generation}, {self.size} of {self.capacity} bytes, "
            f"slots {self.slots[0]} and {self.slots[1]}{failed}>"
        )

    @classmethod
    def of(cls, reply: Message) -> Self:
        """From the reply to STORE_INFO, STORE_SAVE or STORE_RESET."""
        return cls(
            source=SOURCES.get(reply["source"], "unknown"),
            generation=reply["generation"],
            schema=reply["schema"],
            slots=(_SLOTS.get(reply["slot_a"], "unknown"), _SLOTS.get(reply["slot_b"], "unknown")),
            wear=(reply["wear_a"], reply["wear_b"]),
            size=reply["size"],
            capacity=reply["capacity"],
            tables_crc=reply["tables_crc"],
            error=_ERRORS.get(reply["error"], "unknown") if reply["error"] else "",
        )
