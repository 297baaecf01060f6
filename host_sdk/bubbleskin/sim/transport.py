"""The link to a simulated board: reading with a timeout lets virtual time pass."""

from bubbleskin import boards
from bubbleskin.errors import LinkError
from bubbleskin.link.transport import Transport
from bubbleskin.sim.board import Simulated, SimulatedBoard
from bubbleskin.sim.flash import NorFlash
from bubbleskin.sim.impairment import Impairment, LossyTransport
from bubbleskin.sim.options import Options
from bubbleskin.sim.pacing import Pace


class SimulatedTransport(Transport):
    """A `Transport` to a simulated board. With `realtime`, virtual time keeps pace with the wall clock's."""

    def __init__(self, board: Simulated, name: str, realtime: bool = False):
        self.board = board
        self.name = name
        self.blocks = realtime
        self._lossy: tuple[Impairment, LossyTransport] | None = None
        self._pace = Pace(board) if realtime else None
        self._clock = 0.0, 0.0, 1.0  # since when the device's clock goes as it does: its time, the host's, and the pace
        self._closed = False

    def read(self, timeout: float) -> bytes:
        """Step the board until it sends something or `timeout` virtual seconds have passed."""
        return self._line.read(timeout) if self.board.line else self.read_board(timeout)

    def write(self, data: bytes) -> None:
        """Hand bytes to the board; it reads them in its next tick."""
        if self.board.line:
            self._line.write(data)
        else:
            self.write_board(data)

    @property
    def _line(self) -> LossyTransport:
        """The line as it was made to fail."""
        asked = self.board.line
        assert asked is not None
        if self._lossy is None or self._lossy[0] is not asked:
            self._lossy = asked, LossyTransport(_Straight(self), asked)
        return self._lossy[1]

    def read_board(self, timeout: float) -> bytes:
        """`read` on a line without failures."""
        self._check()
        board = self.board
        until = board.time + timeout / board.clock_pace
        while not board.from_device and board.time < until:
            if self._pace:
                self._pace.wait()
            board.tick()
        data = bytes(board.from_device)
        board.from_device.clear()
        return data

    def write_board(self, data: bytes) -> None:
        """`write` on a line without failures."""
        self._check()
        self.board.to_device += data

    def now(self) -> float:
        """Virtual seconds since the board's start, by a host's clock: the device's own, but where that was made to fail."""
        board, (at, host, pace) = self.board, self._clock
        now = host + (board.time - at) * pace
        if board.clock_pace != pace:
            self._clock = board.time, now, board.clock_pace
        return now

    @property
    def behind(self) -> float:
        """Seconds that a board in real time is behind the wall clock, because nobody has read for a while."""
        return self._pace.behind() if self._pace else 0.0

    def close(self) -> None:
        """End the simulation."""
        self._closed = True
        self.board.close()

    def _check(self) -> None:
        if self._closed:
            raise LinkError(f"The connection to {self.name} is closed; connect again.")


class _Straight(Transport):
    """The way to the board of `transport`, without the failures of its line."""

    def __init__(self, transport: SimulatedTransport):
        self._transport = transport
        self.name, self.blocks = transport.name, transport.blocks

    def read(self, timeout: float) -> bytes:
        return self._transport.read_board(timeout)

    def write(self, data: bytes) -> None:
        self._transport.write_board(data)

    def now(self) -> float:
        return self._transport.now()

    def close(self) -> None:
        self._transport.close()


def open_board(scheme: str, name: str, options: dict[str, str]) -> tuple[Transport, Simulated]:
    """The board of `sim://name?…`, `micropython://name?…` or `rp2040://name?…`, and the link to it.

    `name`: a board's, or the path of a board's file.
    """
    url = f"{scheme}://{name}"
    chosen = Options.parse(options, url)
    impairment = Impairment(drop=chosen.loss)  # refused before anything is started
    board = _start(scheme, name, chosen)
    try:
        for part, number, how in chosen.fail:
            board.inject(part, number, how)
    except BaseException:
        board.close()
        raise
    transport = SimulatedTransport(board, url, chosen.realtime)
    return LossyTransport(transport, impairment, seed=chosen.seed) if chosen.loss else transport, board


def _start(scheme: str, name: str, chosen: Options) -> Simulated:
    data = boards.load(name)
    if scheme == "rp2040":
        from bubbleskin.sim.rp2040 import open_chip

        return open_chip(
            name,
            seed=chosen.seed,
            spread=chosen.spread,
            contact=chosen.contact,
            wiring=chosen.wiring,
            **chosen.plant,
        )
    firmware = None
    if scheme == "micropython":
        from bubbleskin.sim.micropython import MicroPythonFirmware

        firmware = MicroPythonFirmware(data, boot_id=chosen.seed + 1)
    try:
        flash = NorFlash(path=chosen.store) if chosen.store else None
        board = SimulatedBoard(
            name,
            seed=chosen.seed,
            spread=chosen.spread,
            contact=chosen.contact,
            firmware=firmware,
            flash=flash,
            wiring=chosen.wiring,
            **chosen.plant,
        )
        if chosen.history:
            board.keep_history()
        return board
    except BaseException:
        if firmware:
            firmware.close()
        raise
