"""What a wristband keeps without power: the state of its store, and the figures of its bubbles."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bubble_protocol.schema import errors, store
from bubbleskin.errors import InvalidInput
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
    """What each slot holds: blank, whole, torn, other, unfit."""
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


@dataclass(frozen=True, eq=False)
class Trim:
    """What sets each bubble apart besides its table, (n,) each, whole numbers as the firmware has them."""

    zero: NDArray[np.int64]
    """Sensor counts without pressure."""
    opens_us: NDArray[np.int64]
    """From current to an open valve, µs."""
    closes_us: NDArray[np.int64]
    """From no current to a closed valve, µs."""
    flow_gain: NDArray[np.int64]
    """Flow of the restrictor: root of pressures (8 Pa) to µJ/ms, /65536."""

    @classmethod
    def of(cls, reply: Message) -> Self:
        """From the reply to TRIM_READ."""
        return cls(**reply.columns)

    def rows(self, bubbles: int) -> list[tuple[int, ...]]:
        """One row per bubble, as the wire wants them; `InvalidInput` where that cannot be."""
        rows = []
        for name in ("zero", "opens_us", "closes_us", "flow_gain"):
            values = np.asarray(getattr(self, name))
            if values.shape != (bubbles,):
                raise InvalidInput(
                    f"{name} has the shape {values.shape}; give one number for each of {bubbles} bubbles."
                )
            if not (np.isfinite(values).all() and (values == np.rint(values)).all()):
                raise InvalidInput(f"{name} must be whole numbers; {values.tolist()} are not.")
            if (values < 0).any() or (values > 65535).any():
                raise InvalidInput(f"{name} is {values.tolist()}; numbers from 0 to 65535 are allowed.")
            rows.append(values.astype(int).tolist())
        return list(zip(*rows, strict=True))
