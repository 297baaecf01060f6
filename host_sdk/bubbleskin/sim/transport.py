"""The link to a simulated board: reading with a timeout lets virtual time pass."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from bubbleskin import boards
from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.link.transport import Transport
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.faults import Faults, LossyTransport
from bubbleskin.sim.flash import NorFlash


class Board(Protocol):
    """What a link needs of a board that is simulated, one way or another."""

    to_device: bytearray
    from_device: bytearray
    tick_s: float

    @property
    def time(self) -> float:
        """Virtual seconds since the start."""

    def tick(self) -> None:
        """Let one period pass."""

    def listen(self, phase_us: int) -> None:
        """Let the firmware answer what has come, `phase_us` after a period has begun."""

    def close(self) -> None:
        """End it."""


_SHARES = ("spread", "loss")
_BEHIND = 0.1  # seconds a real-time simulation may lag before it gives up catching up


class SimulatedTransport:
    """A `Transport` to a simulated board. With `realtime`, virtual time keeps pace with the wall's."""

    def __init__(self, board: Board, name: str, realtime: bool = False):
        self.board = board
        self.name = name
        self.blocks = realtime
        self._pace = Pace(board) if realtime else None
        self._closed = False

    def read(self, timeout: float) -> bytes:
        """Step the board until it sends something or `timeout` virtual seconds have passed."""
        self._check()
        board = self.board
        until = board.time + timeout
        while not board.from_device and board.time < until:
            if self._pace:
                self._pace.wait()
            board.tick()
        data = bytes(board.from_device)
        board.from_device.clear()
        return data

    def write(self, data: bytes) -> None:
        """Hand bytes to the board; it reads them in its next tick."""
        self._check()
        self.board.to_device += data

    def now(self) -> float:
        """Virtual seconds since the board's start."""
        return self.board.time

    @property
    def behind(self) -> float:
        """Seconds that a board in real time is behind the wall clock, because nobody has read for a while."""
        return self._pace.owed() if self._pace else 0.0

    def close(self) -> None:
        """End the simulation."""
        self._closed = True
        self.board.close()

    def _check(self) -> None:
        if self._closed:
            raise LinkError(f"The connection to {self.name} is closed; connect again.")


class Pace:
    """Keeps a board's virtual time at the wall's, tick by tick."""

    def __init__(self, board: Board):
        self._board = board
        self._start = time.monotonic() - board.time

    def owed(self) -> float:
        """Seconds that the board is behind the wall clock; below zero where it is ahead."""
        owed = time.monotonic() - self._start - self._board.time
        if owed > _BEHIND:  # the machine is too slow, or was asleep: let virtual time slip
            self._start += owed
            return 0.0
        return owed

    def wait(self) -> None:
        """Sleep until the next tick is due."""
        ahead = -self.owed()
        if ahead > 0:
            time.sleep(ahead)


@dataclass(frozen=True)
class Options:
    """What may follow the `?` of a simulated board's URL."""

    seed: int = 0
    spread: float = 0.0
    realtime: bool = False
    loss: float = 0.0
    contact: bool = True
    store: Path | None = None
    """The file that keeps its flash."""

    @classmethod
    def parse(cls, options: dict[str, str], url: str) -> "Options":
        """From the URL's query; `InvalidInput` for what is not known or not a number."""
        values: dict[str, float] = {}
        store = options.get("store")
        if store is not None and not (store and url.startswith("sim:")):
            raise InvalidInput(
                f"{url} has store={store!r}; only sim:// keeps its store in a file: store=wristband.bin."
            )
        for key, text in options.items():
            if key not in cls.__dataclass_fields__:
                known = ", ".join(cls.__dataclass_fields__)
                raise InvalidInput(f"{url} has the option {key!r}; known are {known}.")
            if key == "store":
                continue
            try:
                values[key] = float(text) if key in _SHARES else int(text)
            except ValueError:
                kind = "a number" if key in _SHARES else "a whole number"
                raise InvalidInput(f"{url} has {key}={text!r}, which is not {kind}.") from None
        return cls(
            int(values.get("seed", 0)),
            values.get("spread", 0.0),
            bool(values.get("realtime", 0)),
            values.get("loss", 0.0),
            bool(values.get("contact", 1)),
            Path(store) if store else None,
        )


def open_board(scheme: str, name: str, options: dict[str, str]) -> tuple[Transport, Board]:
    """The board of `sim://name?…`, `micropython://name?…` or `rp2040://name?…`, and the link to it.

    `name`: a board's, or the path of a board's file.
    """
    url = f"{scheme}://{name}"
    chosen = Options.parse(options, url)
    faults = Faults(drop=chosen.loss)  # refused before anything is started
    transport, board = _open(scheme, name, url, chosen)
    return LossyTransport(transport, faults, seed=chosen.seed) if chosen.loss else transport, board


def _open(scheme: str, name: str, url: str, chosen: Options) -> tuple[SimulatedTransport, Board]:
    data = boards.load(name)  # refused before anything is started
    if scheme == "rp2040":
        from bubbleskin.sim.rp2040 import open_chip

        chip = open_chip(name, seed=chosen.seed, spread=chosen.spread, contact=chosen.contact)
        return SimulatedTransport(chip, url, chosen.realtime), chip
    firmware = None
    if scheme == "micropython":
        from bubbleskin.sim.micropython import MicroPythonFirmware

        firmware = MicroPythonFirmware(data, boot_id=chosen.seed + 1)
    try:
        flash = NorFlash(path=chosen.store) if chosen.store else None
        board = SimulatedBoard(
            name, seed=chosen.seed, spread=chosen.spread, contact=chosen.contact, firmware=firmware, flash=flash
        )
    except BaseException:
        if firmware:
            firmware.close()
        raise
    return SimulatedTransport(board, url, chosen.realtime), board
