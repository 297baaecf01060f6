"""The host's frame codec beside pymavlink's: encode and parse of a message with a payload of the same size, in turns."""

import time
from collections.abc import Callable, Iterator

import numpy as np

from bubbleskin.bench.rows import Row, share_of
from bubbleskin.errors import BubbleskinError
from bubbleskin.link import message
from bubbleskin.link.reader import Reader

_ROUNDS = 250  # Short ones: what else the machine does falls between some of them.
_CALLS = 40  # In a round.


def rows(size: float = 1.0) -> Iterator[Row]:
    """µs for one message made, framed, taken apart and checked, and the same of pymavlink."""
    kinds: list[tuple[str, str, tuple[int, ...], list[tuple[int, ...]]]] = [
        ("SHOW of 7", "SHOW", (300,), [(8000 + 100 * bubble,) for bubble in range(7)]),
        ("SHOW of 19", "SHOW", (300,), [(8000 + 100 * bubble,) for bubble in range(19)]),
        ("TELEMETRY of 7", "TELEMETRY", (123456, 1), [(8123, 21345, 8100, 2, 0)] * 7),
        ("TELEMETRY of 19", "TELEMETRY", (123456, 1), [(8123, 21345, 8100, 2, 0)] * 19),
    ]
    for title, name, fixed, repeated in kinds:
        reader = Reader()

        def ours(
            name: str = name,
            fixed: tuple[int, ...] = fixed,
            repeated: list[tuple[int, ...]] = repeated,
            reader: Reader = reader,
        ) -> None:
            (_message,) = reader.feed(message.encode(name, 1, fixed, repeated))

        payload = len(message.encode(name, 1, fixed, repeated)) - 9
        theirs, their_name, their_payload = _mavlink(payload)
        mine, other = _in_turns(share_of(_ROUNDS, size), ours, theirs)
        yield Row(f"{title}, {payload} bytes: encode and parse", mine, "µs")
        yield Row(f"  {their_name}, {their_payload} bytes, in pymavlink", other, "µs")
        yield Row("  ours in theirs", mine / other, "×", "≤ 0.8")


def _mavlink(payload: int) -> tuple[Callable[[], None], str, int]:
    """pymavlink's encode and parse of its message with a payload of that size, or the next smaller."""
    try:
        from pymavlink.dialects.v20 import common
    except ImportError:
        raise BubbleskinError("This is measured beside pymavlink: pip install pymavlink.") from None
    plain = [kind for kind in common.mavlink_map.values() if kind.unpacker.size <= payload]
    kind = max(plain, key=lambda kind: (kind.unpacker.size, "s" not in kind.unpacker.format, kind.msgname))
    fields = kind.unpacker.unpack(bytes(range(1, 1 + kind.unpacker.size)))
    values = []
    at = 0
    for place in range(len(kind.ordered_fieldnames)):
        length = kind.array_lengths[place]
        if length and not isinstance(fields[at], bytes):
            values.append(list(fields[at : at + length]))
            at += length
        else:
            values.append(fields[at])
            at += 1
    by_name = dict(zip(kind.ordered_fieldnames, values, strict=True))
    arguments = [by_name[name] for name in kind.fieldnames]
    sender, receiver = common.MAVLink(None, 1, 1), common.MAVLink(None)

    def theirs() -> None:
        (_message,) = receiver.parse_buffer(kind(*arguments).pack(sender))

    return theirs, kind.msgname, kind.unpacker.size


def _in_turns(rounds: int, *runs: Callable[[], None]) -> list[float]:
    """The best time of one call of each, µs."""
    best = np.full(len(runs), np.inf)
    for _ in range(rounds):
        for index, run in enumerate(runs):
            begin = time.perf_counter()
            for _ in range(_CALLS):
                run()
            best[index] = min(best[index], (time.perf_counter() - begin) / _CALLS * 1e6)
    return best.tolist()
