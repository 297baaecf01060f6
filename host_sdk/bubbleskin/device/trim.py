"""What sets each bubble apart besides its table: the reply to TRIM_READ, and what TRIM_WRITE takes."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bubbleskin.checks import finite
from bubbleskin.errors import InvalidInput
from bubbleskin.link.message import Message

APART_MOST = 1.3
"""Of one restrictor's flow to the middle one's: a bore of 0.2 mm that is 0.02 mm off makes 1.2."""


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

    def __repr__(self) -> str:
        return (
            f"<Trim of {len(self.zero)} bubbles: zero {_range(self.zero)} counts, opens in {_range(self.opens_us)} µs, "
            f"closes in {_range(self.closes_us)} µs, flow {_range(self.flow_gain)}>"
        )

    @classmethod
    def of(cls, reply: Message) -> Self:
        """From the reply to TRIM_READ."""
        return cls(**reply.columns)

    def rows(self, bubbles: int) -> list[tuple[int, ...]]:
        """One row per bubble, as the wire wants them; `InvalidInput` where that cannot be."""
        rows = []
        for name in ("zero", "opens_us", "closes_us", "flow_gain"):
            values = finite(name, getattr(self, name))
            if values.shape != (bubbles,):
                raise InvalidInput(
                    f"{name} has the shape {values.shape}; give one number for each of {bubbles} bubbles."
                )
            if not (values == np.rint(values)).all():
                raise InvalidInput(f"{name} must be whole numbers; {values.tolist()} are not.")
            if (values < 0).any() or (values > 65535).any():
                raise InvalidInput(f"{name} is {values.tolist()}; numbers from 0 to 65535 are allowed.")
            rows.append(values.astype(int).tolist())
        return list(zip(*rows, strict=True))


def check(trim: Trim) -> None:
    """`InvalidInput` where the trims of bubbles contradict each other; the device compares each with its board's file."""
    flow = np.maximum(trim.flow_gain, 1)  # the device refuses none
    middle = float(np.median(flow))
    apart = np.maximum(flow / middle, middle / flow)
    bubble = int(apart.argmax())
    if apart[bubble] > APART_MOST:
        raise InvalidInput(
            f"flow_gain of bubble {bubble} is {trim.flow_gain[bubble]} and the middle one is {middle:g}: those of a board are "
            f"within a factor of {APART_MOST:g}. Look for dirt in the valve and measure again; anyway=True uploads it."
        )


def _range(values: NDArray[np.int64]) -> str:
    low, high = np.min(values), np.max(values)
    return f"{low}" if low == high else f"{low} to {high}"
