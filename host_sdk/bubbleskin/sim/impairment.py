"""A line that is impaired as real ones are, in front of any transport; the same seed impairs it in the same way."""

import random
from collections.abc import Callable
from dataclasses import dataclass, fields

from bubbleskin.errors import InvalidInput
from bubbleskin.link.transport import Transport

_STALL_MAX_S = 60


@dataclass(frozen=True)
class Impairment:
    """How often what goes wrong on a line: shares from 0 to 1 of what is written or read at a time, in both directions.

    `drop`: it is lost. `duplicate`: it comes twice. `reorder`: it comes after the next. `truncate`: its end is
    lost. `flip`: some of its bits are inverted. `stall`: nothing comes for `stall_s` seconds, then all of it.
    `split`: it comes in two parts, the second when the next read comes. `reset`: after the device has answered, and before the
    answer is read, the `reset` of `LossyTransport` is called and the answer is lost.
    """

    drop: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    truncate: float = 0.0
    flip: float = 0.0
    stall: float = 0.0
    split: float = 0.0
    reset: float = 0.0
    stall_s: float = 0.3

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0 <= value <= (_STALL_MAX_S if field.name == "stall_s" else 1):
                what = f"seconds, 0 to {_STALL_MAX_S}" if field.name == "stall_s" else "a share, 0 to 1"
                raise InvalidInput(f"{field.name} is {value}; give {what}.")


class LossyTransport(Transport):
    """A `Transport` around another, on a line with an `impairment` of which `seed` decides when it strikes.

    `reset()`: what restarts the device, such as `SimulatedBoard.reset`. `on`: whether the line is impaired now.
    `counts`: how often each kind has struck. Frames are lost whole, as a USB stack or a radio loses them:
    what is written at a time, and what is read at a time up to each delimiter.
    """

    def __init__(
        self,
        transport: Transport,
        impairment: Impairment,
        *,
        seed: int = 0,
        reset: Callable[[], None] | None = None,
    ):
        if impairment.reset and reset is None:
            raise InvalidInput(
                "An impairment with resets needs something to reset: LossyTransport(…, reset=board.reset)."
            )
        self.name = transport.name
        self.blocks = transport.blocks
        self.reopens = transport.reopens
        self.on = True
        self.counts = dict.fromkeys((field.name for field in fields(impairment) if field.name != "stall_s"), 0)
        self._transport = transport
        self._impairment = impairment
        self._reset = reset
        self._random = random.Random(seed)
        self._late = {False: b"", True: b""}  # reordered: goes with the next; by direction, True: to the device
        self._begun = {False: b"", True: b""}  # a frame whose end has not come
        self._half = b""  # the rest of what was split
        self._quiet_until = 0.0  # s, of the transport's clock
        self._stalled = b""

    def read(self, timeout: float) -> bytes:
        """What comes within `timeout`, or what is left of it."""
        if self._half:
            half, self._half = self._half, b""
            return half
        now = self.now()
        if now < self._quiet_until:
            self._stalled += self._transport.read(min(timeout, self._quiet_until - now))
            if self.now() < self._quiet_until:
                return b""
        data, self._stalled = self._stalled + self._transport.read(timeout if not self._stalled else 0.0), b""
        if not self.on or not data:
            return data
        if self._happens("reset"):
            assert self._reset
            self._reset()
            return b""
        if self._happens("stall"):
            self._quiet_until = self.now() + self._impairment.stall_s
            self._stalled = data
            return b""
        data = self._damaged(data, False)
        if len(data) > 1 and self._happens("split"):
            at = self._random.randrange(1, len(data))
            data, self._half = data[:at], data[at:]
        return data

    def write(self, data: bytes) -> None:
        """Send `data`, or what is left of it."""
        if self.on:
            data = self._damaged(data, True)
        if data:
            self._transport.write(data)

    def now(self) -> float:
        """The clock of the transport behind."""
        return self._transport.now()

    @property
    def behind(self) -> float:
        """That of the transport behind, s."""
        return self._transport.behind

    def reopen(self) -> None:
        """Open the transport behind again."""
        self._transport.reopen()

    def close(self) -> None:
        """Let go of the device."""
        self._transport.close()

    def leave_behind(self) -> None:
        """See `Transport`."""
        self._transport.leave_behind()

    def _damaged(self, data: bytes, outward: bool) -> bytes:
        """Frame by frame."""
        out = []
        *frames, self._begun[outward] = (self._begun[outward] + data).split(b"\0")
        for frame in frames:
            if not frame:
                continue
            whole = frame + b"\0"
            if self._happens("drop"):
                continue
            if self._happens("truncate"):
                whole = whole[: self._random.randrange(len(whole))]
            if whole and self._happens("flip"):
                whole = self._flipped(whole)
            if not self._late[outward] and self._happens("reorder"):
                self._late[outward] = whole
                continue
            out.append(whole)
            if self._happens("duplicate"):
                out.append(whole)
            out.append(self._late[outward])
            self._late[outward] = b""
        return b"".join(out)

    def _flipped(self, data: bytes) -> bytes:
        flipped = bytearray(data)
        for _ in range(self._random.randrange(1, 4)):
            flipped[self._random.randrange(len(flipped))] ^= 1 << self._random.randrange(8)
        return bytes(flipped)

    def _happens(self, kind: str) -> bool:
        share = getattr(self._impairment, kind)
        if not share or self._random.random() >= share:
            return False
        self.counts[kind] += 1
        return True
