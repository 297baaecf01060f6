"""What sets each bubble apart besides its table: the replies to CALIBRATION_READ, and what CALIBRATION_WRITE takes."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bubble_protocol import codec, frame
from bubbleskin.checks import finite
from bubbleskin.device.info import Info
from bubbleskin.errors import InvalidInput
from bubbleskin.link.link import Link
from bubbleskin.link.message import Message

APART_MOST = 1.3
"""Of one restrictor's flow to the middle one's: a bore of 0.2 mm that is 0.02 mm off makes 1.2."""

_Integers = NDArray[np.int64]

_WIRE = codec.BY_NAME["CALIBRATION_WRITE"]
_ROWS_MOST = (frame.PAYLOAD_MAX - _WIRE.fixed_size) // _WIRE.stride
"""How many bubbles one message has room for."""
_VENT = "vent_"  # before the names of what the vent valve has apart
_SHORT = ("zero", "opens_us", "closes_us", "flow_gain")  # what older firmware knows: both valves alike
_NAMES = {  # of the wire's fields
    "fill_opens_us": "opens_us",
    "fill_closes_us": "closes_us",
    "fill_gain": "flow_gain",
    "vent_gain": "vent_flow_gain",
}


@dataclass(frozen=True, eq=False)
class Trim:
    """What sets each bubble apart besides its table, (n,) each, whole numbers as the firmware has them.

    Where a figure of the vent valve is None, it is as that of the fill valve; what else is None stays what the wristband has.
    """

    zero: _Integers
    """Sensor counts without pressure."""
    opens_us: _Integers
    """Of the fill valve, from current to open, µs."""
    closes_us: _Integers
    """From no current to closed, µs."""
    flow_gain: _Integers
    """Flow of its restrictor: root of pressures (8 Pa) to µJ/ms, /65536."""
    vent_opens_us: _Integers | None = None
    """The same of the vent valve."""
    vent_closes_us: _Integers | None = None
    vent_flow_gain: _Integers | None = None
    flow_sd: _Integers | None = None
    """Standard deviation of both flows, a share, /65536."""
    curve_sd: _Integers | None = None
    """Standard deviation of the table's pressures, the memory of the rubber included, a share, /65536."""
    leak: _Integers | None = None
    """Air that the bubble loses, µJ/s for each kPa, /16: 845 is 1 % of the air in a bubble of 12 mm in a second."""

    def __repr__(self) -> str:
        return (
            f"<Trim of {len(self.zero)} bubbles: zero {_range(self.zero)} counts, opens in {_range(self.opens_us)} µs, "
            f"closes in {_range(self.closes_us)} µs, flow {_range(self.flow_gain)}>"
        )

    @classmethod
    def of(cls, replies: Sequence[Message]) -> Self:
        """From the replies to CALIBRATION_READ, or from the one to TRIM_READ."""
        names = replies[0].columns
        return cls(**{_NAMES.get(name, name): np.concatenate([r.columns[name] for r in replies]) for name in names})

    def rows(self, now: Self) -> list[tuple[int, ...]]:
        """One row per bubble, as CALIBRATION_WRITE wants them, for a wristband that has the trim `now`.

        `InvalidInput` where that cannot be.
        """
        return self._rows(len(now.zero), [(field.name, self._or(field.name, now)) for field in fields(self)])

    def short_rows(self, bubbles: int) -> list[tuple[int, ...]]:
        """One row per bubble, as TRIM_WRITE wants them: what sets its valves apart from each other is left out."""
        return self._rows(bubbles, [(name, getattr(self, name)) for name in _SHORT])

    def _or(self, name: str, now: Self) -> _Integers:
        values: _Integers | None = getattr(self, name)
        if values is not None:
            return values
        other: _Integers = getattr(self, name[len(_VENT) :]) if name.startswith(_VENT) else getattr(now, name)
        return other

    def _rows(self, bubbles: int, given: Sequence[tuple[str, _Integers]]) -> list[tuple[int, ...]]:
        rows = []
        for name, numbers in given:
            values = finite(name, numbers)
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
    for name in ("flow_gain", "vent_flow_gain"):
        if (values := getattr(trim, name)) is not None:
            _check_flows(name, values)


def _check_flows(name: str, values: _Integers) -> None:
    flow = np.maximum(values, 1)  # the device refuses none
    middle = float(np.median(flow))
    apart = np.maximum(flow / middle, middle / flow)
    bubble = int(apart.argmax())
    if apart[bubble] > APART_MOST:
        raise InvalidInput(
            f"{name} of bubble {bubble} is {values[bubble]} and the middle one is {middle:g}: those of a board are "
            f"within a factor of {APART_MOST:g}. Look for dirt in the valve and measure again; anyway=True uploads it."
        )


def _range(values: _Integers) -> str:
    low, high = np.min(values), np.max(values)
    return f"{low}" if low == high else f"{low} to {high}"


async def read(link: Link, info: Info) -> Trim:
    """What a device uses."""
    if not info.tells_sd:
        return Trim.of([await link.call("TRIM_READ")])
    replies: list[Message] = []
    while (first := sum(len(reply.columns["zero"]) for reply in replies)) < info.bubbles:
        replies.append(await link.call("CALIBRATION_READ", (first,)))
    return Trim.of(replies)


async def write(link: Link, info: Info, trim: Trim, anyway: bool) -> None:
    """Let it use `trim`; unless `anyway`, only where its figures go together. Raises `InvalidInput`."""
    rows = trim.rows(await read(link, info)) if info.tells_sd else trim.short_rows(info.bubbles)
    if not anyway:
        check(trim)
    if not info.tells_sd:
        await link.call("TRIM_WRITE", (), rows)
        return
    for first in range(0, len(rows), _ROWS_MOST):
        await link.call("CALIBRATION_WRITE", (first,), rows[first : first + _ROWS_MOST])
