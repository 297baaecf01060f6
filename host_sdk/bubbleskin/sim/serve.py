"""A simulated board for other programs: in real time, on a pseudo-terminal or a TCP port."""

import contextlib
import math
import os
import select
import socket
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator

from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.sim.board import Simulated
from bubbleskin.sim.pacing import Pace

_OUT_MAX = 65536
"""Bytes kept for a program that does not read; older ones are dropped, as a full USB buffer does."""
_IN_MAX = 4096
"""Bytes kept for the board, eight times what the SDK has under way; more are dropped as they come."""
_READ = 65536
"""Bytes taken at once: a program that floods the board must not keep it from its ticks."""
_SILENT_S = 1.0
"""Seconds of silence after which a program gives way to one that comes. The SDK says something every 0.1 s."""
_PATIENCE_S = 0.2
"""Seconds that a program waits for one that has the board: it may have gone, and what it left not have been read."""
_LEAVING = 16
"""Programs that have been turned away and may not have read why, at most."""

HELD = "Another program holds this simulated board. Close it, or serve another board at a port of its own."
"""What a program is told, as text between two delimiters, that comes while another one is alive."""
GIVEN_WAY = "This simulated board has gone to another program, because nothing was heard from you."


class End(ABC):
    """The place at which another program finds the board. `name` is the port or URL that it opens."""

    name: str
    visits = 0
    """How many programs have come so far, where that is known: what was under way for one is nothing to the next."""

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
        return os.read(self._own, _READ) if ready else b""

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
    """A TCP port of this machine, for one program at a time; `name` is the URL that it opens.

    A program that comes gets the board, unless another one has it and has been heard within a second: then it is told so
    and turned away.
    """

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
        self._listener.listen(_LEAVING)
        self._listener.setblocking(False)
        self._client: socket.socket | None = None
        self._heard_at = -math.inf  # never
        self._patient_until = 0.0  # until when one that has knocked waits; 0: nobody has
        self._leaving: deque[tuple[float, socket.socket]] = deque()  # and when to close them
        self.name = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def wait(self, seconds: float) -> bytes:
        """Bytes for the board, at the latest after `seconds`."""
        now = time.monotonic()
        ends = [client for _, client in self._leaving]
        if self._client:
            ends.append(self._client)
        if not self._client or now >= self._patient_until:
            ends.append(self._listener)
        ready, _, _ = select.select(ends, [], [], max(seconds, 0.0))
        data = b""
        if self._client and self._client in ready:
            data = self._receive(self._client)
        if self._leaving:
            self._see_off(ready)
        if self._listener in ends and self._knocked(self._listener in ready) and self._welcome():
            return b""  # what the last one has said is nothing to this one
        return data

    def _receive(self, client: socket.socket) -> bytes:
        data = _received(client)
        if data:
            self._heard_at = time.monotonic()
        elif data is not None:
            self._drop()
        return data or b""

    def _knocked(self, ready: bool) -> bool:
        """Whether to let in who has come: not at once where another one has the board and may be about to go."""
        if ready and not self._patient_until and self._is_held():
            self._patient_until = time.monotonic() + _PATIENCE_S
            return False
        if not ready:
            self._patient_until = 0.0
        return ready

    def _is_held(self) -> bool:
        return self._client is not None and time.monotonic() < self._heard_at + _SILENT_S

    def _welcome(self) -> bool:
        """Give the board to the program that has come, or say why not; whether it has it."""
        try:
            client, _ = self._listener.accept()
        except OSError:  # it has gone again
            return False
        client.setblocking(False)
        if self._is_held():
            self._turn_away(client, HELD)
            return False
        if self._client:
            self._turn_away(self._client, GIVEN_WAY)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client
        self._heard_at = -math.inf
        self.visits += 1
        return True

    def _turn_away(self, client: socket.socket, why: str) -> None:
        """Say why and end; closed when the other end is, or a program that had unread bytes of its own would not read it."""
        with contextlib.suppress(OSError):
            client.send(b"\0" + why.encode() + b"\0")
            client.shutdown(socket.SHUT_WR)
        self._leaving.append((time.monotonic() + _SILENT_S, client))

    def _see_off(self, ready: list[socket.socket]) -> None:
        """Close those who have read why they must go, or have had the time to."""
        for entry in list(self._leaving):
            until, client = entry
            gone = client in ready and _received(client) == b""
            if gone or time.monotonic() > until or len(self._leaving) > _LEAVING:
                self._leaving.remove(entry)
                client.close()

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
        while self._leaving:
            self._leaving.pop()[1].close()
        self._listener.close()

    def _drop(self) -> None:
        if self._client:
            self._client.close()
        self._client = None


def _received(client: socket.socket) -> bytes | None:
    """What has come from a program; no bytes where it has gone, None where it only seemed that something has come."""
    try:
        return client.recv(_READ)
    except BlockingIOError:
        return None
    except OSError:
        return b""


def serve(board: Simulated, end: End, running: Callable[[], bool] = lambda: True) -> Iterator[Simulated]:
    """Run `board` at the wall clock's pace behind `end` for as long as `running()`; yields the board after every tick."""
    pace = Pace(board)
    between = _Between(board, end)
    tick_us = round(board.tick_s * 1e6)
    while running():
        while (ahead := -pace.behind()) > 0:
            if between.take(ahead):
                phase = tick_us + round(pace.behind() * 1e6)
                board.listen(min(max(phase, 0), tick_us))
                between.hand_over()
        between.take(0.0)
        board.tick()
        between.hand_over()
        yield board


class _Between:
    """What is under way between `board` and the program at `end`: never more than fits, and none of another program's."""

    def __init__(self, board: Simulated, end: End):
        self._board = board
        self._end = end
        self._visits = end.visits
        self._out = bytearray()

    def take(self, seconds: float) -> bool:
        """Give the board what comes within so long; whether anything has."""
        data = self._end.wait(seconds)
        waiting = self._board.to_device
        if self._end.visits != self._visits:
            self._visits = self._end.visits
            waiting.clear()
            self._out.clear()
        if not data:
            return False
        waiting += data[: max(0, _IN_MAX - len(waiting))]
        return True

    def hand_over(self) -> None:
        """Give the program what the board sends, and what is left of before, as far as it fits."""
        out = self._out
        out += self._board.from_device
        self._board.from_device.clear()
        if out:
            del out[: self._end.write(bytes(out))]
            del out[: max(0, len(out) - _OUT_MAX)]
