"""A simulated board for other programs: in real time, on a pseudo-terminal or a TCP port."""

import contextlib
import os
import select
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator

from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.sim.board import Simulated
from bubbleskin.sim.pacing import Pace

_OUT_MAX = 65536
"""Bytes kept for a program that does not read; older ones are dropped, as a full USB buffer does."""


class End(ABC):
    """The place at which another program finds the board. `name` is the port or URL that it opens."""

    name: str

    @abstractmethod
    def wait(self, seconds: float) -> bytes:
        """Bytes for the board, at the latest after `seconds`."""

    @abstractmethod
    def write(self, data: bytes) -> int:
        """Hand over what fits; returns how many bytes."""

    @abstractmethod
    def close(self) -> None:
        """Give the place back."""


class PtyEnd(End):
    """A pseudo-terminal; `name` is the port that another program opens."""

    def __init__(self) -> None:
        try:
            import pty
            import tty
        except ImportError:
            raise LinkError("This system has no pseudo-terminals. Serve on a TCP port instead: --port 7707.") from None
        self._own, self._other = pty.openpty()  # the other end stays open, so that programs may come and go
        tty.setraw(self._other)
        os.set_blocking(self._own, False)
        self.name = os.ttyname(self._other)

    def wait(self, seconds: float) -> bytes:
        """Bytes for the board, at the latest after `seconds`."""
        ready, _, _ = select.select([self._own], [], [], max(seconds, 0.0))
        return os.read(self._own, 4096) if ready else b""

    def write(self, data: bytes) -> int:
        """Hand over what fits; returns how many bytes."""
        try:
            return os.write(self._own, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Give the pseudo-terminal back."""
        os.close(self._own)
        os.close(self._other)


class TcpEnd(End):
    """A TCP port of this machine, for one program at a time; `name` is the URL that it opens."""

    def __init__(self, port: int):
        if not 0 <= port <= 65535:
            raise InvalidInput(f"{port} is not a TCP port; ports are 1 to 65535, 0 takes a free one.")
        self._listener = socket.socket()
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind(("127.0.0.1", port))
        except OSError as error:
            self._listener.close()
            raise LinkError(
                f"Port {port} cannot be served ({error.strerror}); choose another, or 0 for a free one."
            ) from None
        self._listener.listen(1)
        self._client: socket.socket | None = None
        self.name = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def wait(self, seconds: float) -> bytes:
        """Bytes for the board, at the latest after `seconds`."""
        ready, _, _ = select.select([self._client or self._listener], [], [], max(seconds, 0.0))
        if not ready:
            return b""
        if self._client is None:
            self._client, _ = self._listener.accept()
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        with contextlib.suppress(OSError):
            data = self._client.recv(4096)
            if data:
                return data
        self._drop()
        return b""

    def write(self, data: bytes) -> int:
        """Hand over what fits; returns how many bytes. Without a client, everything is dropped."""
        if self._client is None:
            return len(data)
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._drop()
            return len(data)

    def close(self) -> None:
        """Give the port back."""
        self._drop()
        self._listener.close()

    def _drop(self) -> None:
        if self._client:
            self._client.close()
        self._client = None


def serve(board: Simulated, end: End, running: Callable[[], bool] = lambda: True) -> Iterator[Simulated]:
    """Run `board` at the wall clock's pace behind `end` for as long as `running()`; yields the board after every tick."""
    pace = Pace(board)
    out = bytearray()
    tick_us = round(board.tick_s * 1e6)
    while running():
        while (ahead := -pace.behind()) > 0:
            data = end.wait(ahead)
            if data:
                board.to_device += data
                phase = tick_us + round(pace.behind() * 1e6)
                board.listen(min(max(phase, 0), tick_us))
                _hand_over(board, end, out)
        board.to_device += end.wait(0)
        board.tick()
        _hand_over(board, end, out)
        yield board


def _hand_over(board: Simulated, end: End, out: bytearray) -> None:
    """What the board sends, and what `out` still has of it, as far as it fits."""
    out += board.from_device
    board.from_device.clear()
    del out[: end.write(bytes(out)) if out else 0]
    del out[: max(0, len(out) - _OUT_MAX)]
