"""What the link needs of a way to a device: bytes both ways, and the clock that waiting for them is measured by."""

from abc import ABC, abstractmethod

from bubbleskin.link.errors import connection_lost


class Transport(ABC):
    """A way to a device: what the link needs of one.

    `name`: what sentences call it, such as a port or a URL. `blocks`: whether `read` waits by the wall clock; otherwise
    it returns as soon as a simulation has been stepped. `reopens`: whether `reopen` can bring it back after it has gone.
    """

    name: str
    blocks: bool
    reopens: bool = False

    @abstractmethod
    def read(self, timeout: float) -> bytes:
        """Wait up to `timeout` seconds of this transport's own clock for bytes; none when none came."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Send all of `data`."""

    @abstractmethod
    def now(self) -> float:
        """Seconds on the clock of `read`'s timeout: the wall clock, or a simulation's virtual one."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device."""

    def leave_behind(self) -> None:
        """Let go of this process's copy after a fork, without the other end or the first process noticing."""
        return  # a transport that holds no port has nothing to let go of

    @property
    def descriptor(self) -> int | None:
        """What an event loop can wait for in place of `read`; None where only `read` itself waits, or the port has gone."""
        return None

    @property
    def behind(self) -> float:
        """Seconds of `now` that reading has to catch up with, because nobody has read for a while."""
        return 0.0

    def reopen(self) -> None:
        """Open it again after it has gone; `LinkError` where that cannot be, or not yet."""
        raise connection_lost(self.name)
