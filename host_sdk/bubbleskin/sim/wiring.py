"""How a simulated board is wired to its bubbles: tubes, valves and sensor wires that are swapped, valves without current, the
emergency stop's contact.

The firmware knows nothing of it, as on a bench. A manifold has a place for each bubble, with the fill valve, the vent valve, the
sensor and the tube that bear its number; `Wiring` says what is not where its number says. Figures and failures of the plant are
those of the bubble that a place leads to.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput
from bubbleskin.sim.plant import Plant

FILL, VENT = 0, 1
VALVES = ("fill", "vent")
CONTACTS = ("closed", "open")
"""What the emergency stop's contact in the loop is while nobody presses it; `closed` is what the firmware expects."""
_NONE = -1
_One = TypeVar("_One")


@dataclass(frozen=True)
class Wiring:
    """What of a board is wired wrongly; as it stands here, nothing."""

    tubes: tuple[tuple[int, int], ...] = ()
    """Pairs of bubbles whose tubes are exchanged."""
    valves: tuple[tuple[str, str], ...] = ()
    """Pairs of valves whose wires are exchanged, such as ("fill2", "fill5") or ("fill2", "vent2")."""
    sensors: tuple[tuple[int, int], ...] = ()
    """Pairs of bubbles whose sensors' wires are exchanged."""
    dead: tuple[str, ...] = ()
    """Valves that get no current, such as "vent3": a fill valve stays shut, a vent valve open."""
    estop: str = CONTACTS[0]
    """The emergency stop's contact, one of `CONTACTS`."""

    @property
    def right(self) -> bool:
        """Whether all wires and tubes are where they should be."""
        return self == RIGHT

    @property
    def said(self) -> list[str]:
        """Names of the parts that are wired wrongly."""
        return [name for name in NAMES if getattr(self, name) != getattr(RIGHT, name)]

    def checked(self, n: int) -> "Wiring":
        """The same, of a board with `n` bubbles; `InvalidInput` where that has no such part, or one is moved twice."""
        for name in ("tubes", "sensors"):
            for number in _once(name, [bubble for pair in getattr(self, name) for bubble in pair]):
                if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < n:
                    _refuse(name, number, f"give two bubbles from 0 to {n - 1}, such as {name}=0-1")
        known = valve_names(n)
        for name in ("valves", "dead"):
            asked: Iterable[Any] = [valve for pair in self.valves for valve in pair] if name == "valves" else self.dead
            for valve in _once(name, list(asked)):
                if valve not in known:
                    example = "fill0-fill1" if name == "valves" else "vent0"
                    _refuse(name, valve, f"valves are fill0 to fill{n - 1} and vent0 to vent{n - 1}: {name}={example}")
        if self.estop not in CONTACTS:
            _refuse("estop", self.estop, f"its contact is one of {', '.join(CONTACTS)}")
        return self

    @classmethod
    def parse(cls, texts: dict[str, str]) -> "Wiring":
        """From texts by the names of its parts: `{"tubes": "1-4,2-3", "valves": "fill2-fill5", "estop": "open"}`."""
        readers: dict[str, Callable[[str, str], Any]] = {
            "tubes": lambda name, text: tuple((_number(name, a), _number(name, b)) for a, b in _pairs(name, text)),
            "sensors": lambda name, text: tuple((_number(name, a), _number(name, b)) for a, b in _pairs(name, text)),
            "valves": _pairs,
            "dead": lambda _, text: tuple(text.split(",")),
            "estop": lambda _, text: text,
        }
        return cls(**{name: readers[name](name, text) for name, text in texts.items()})

    def coils(self, n: int) -> NDArray[np.int64]:
        """Which coil each output drives, (2n,), -1 for none: 2*i* is the fill valve of bubble *i*, 2*i* + 1 its vent."""
        coils = np.arange(2 * n)
        known = valve_names(n)
        for one, other in self.valves:
            _exchange(coils, known.index(one), known.index(other))
        dead = np.isin(coils, [known.index(valve) for valve in self.dead])
        places = self._places(n)
        moved = 2 * places[coils // 2] + coils % 2
        moved[dead] = _NONE
        return moved

    def channels(self, n: int) -> NDArray[np.int64]:
        """Of which bubble's line each sensor input reads the pressure, (n,)."""
        channels = np.arange(n)
        for one, other in self.sensors:
            _exchange(channels, one, other)
        return self._places(n)[channels]

    def _places(self, n: int) -> NDArray[np.int64]:
        """Which bubble each place of the manifold leads to."""
        places = np.arange(n)
        for one, other in self.tubes:
            _exchange(places, one, other)
        return places


NAMES = tuple(field.name for field in fields(Wiring))
RIGHT = Wiring()


def valve_names(n: int) -> list[str]:
    """Names of all valves of `n` bubbles, in the order of their outputs."""
    return [f"{valve}{bubble}" for bubble in range(n) for valve in VALVES]


class Wires:
    """`wiring` of `n` bubbles, for a board that is stepped by the period."""

    def __init__(self, wiring: Wiring, n: int):
        self.channels = wiring.channels(n)
        coils = wiring.coils(n)
        self._driven = np.flatnonzero(coils != _NONE)
        self._coils = coils[self._driven]
        self._crossed = self._driven % 2 != self._coils % 2  # a fill's output on a vent's coil opens it without current
        self._open = np.zeros((n, 2))
        self._open[:, VENT] = 1.0  # what no output drives is as it is without current

    def advance(self, plant: Plant, tick: float, pulses: NDArray[np.float64], pump: float, dump: bool) -> None:
        """Step `plant` by a period of `tick` s in which outputs play `pulses`, s, (n, 2): fill's current, vent's gap in it."""
        told = pulses.ravel()[self._driven]
        cuts = {cut for cut in told[self._crossed].tolist() if 0.0 < cut < tick}
        begin = 0.0
        for end in (*sorted(cuts), tick):  # an interval of the plant begins where a valve is told to open
            length = end - begin
            straight = np.clip(told - begin, 0.0, length)
            opened = np.where(self._crossed, np.where(told <= begin, length, 0.0), straight)
            each = self._open * length
            each.ravel()[self._coils] = opened
            plant.advance(length, each[:, FILL], each[:, VENT], pump, dump)
            begin = end


def _exchange(numbers: NDArray[np.int64], one: int, other: int) -> None:
    numbers[[one, other]] = numbers[[other, one]]


def _pairs(name: str, text: str) -> tuple[tuple[str, str], ...]:
    pairs = []
    for said in text.split(","):
        one, dash, other = said.partition("-")
        if not (one and dash and other):
            example = "fill2-fill5" if name == "valves" else "1-4"
            _refuse(name, said, f"give what is exchanged with a dash between, such as {name}={example}")
        pairs.append((one, other))
    return tuple(pairs)


def _number(name: str, text: str) -> int:
    if not text.isdecimal():
        _refuse(name, text, f"give two bubbles by their numbers, such as {name}=1-4")
    return int(text)


def _once(name: str, parts: list[_One]) -> list[_One]:
    twice = [part for part in parts if parts.count(part) > 1]
    if twice:
        _refuse(name, twice[0], "name each part once")
    return parts


def _refuse(name: str, value: Any, allowed: str) -> NoReturn:
    raise InvalidInput(f"The wiring has {shown(value)} for {name}; {allowed}.")
