"""Serial ports, and anything else that pyserial opens; which of them have wristbands at their other end."""

import contextlib
import errno
import os
import select
import threading
import time
from collections.abc import Callable
from typing import Any

import serial  # pyserial, not this module
from serial.tools import list_ports

from bubbleskin.boards import DEFAULT
from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.link.errors import connection_lost
from bubbleskin.link.transport import Transport

USB_IDS = ((0x2E8A, 0x0005),)
"""Vendor and product of a Pico that runs MicroPython."""

_POLL_S = 0.01
"""Seconds that one read of an rfc2217 port waits."""
_REOPEN_S = 0.02
"""Seconds that `reopen` takes at most."""


class SerialTransport(Transport):
    """A serial port, or anything that pyserial opens: /dev/ttyACM0, COM3, socket://…, rfc2217://…"""

    blocks = True
    reopens = True

    def __init__(self, url: str):
        self.name = url
        # Each change of an rfc2217 port's timeout is negotiated with its server: it keeps one.
        self._negotiates = url.startswith("rfc2217:")
        # Whether the bytes of its file are those of the port; spy:// and its like see to what passes.
        self._plain = "://" not in url or url.startswith("socket://")
        self._port = self._open()
        self._waitable: int | None = None
        self._watch()
        self._attempt: Attempt | None = None

    def _open(self) -> Any:
        url = self.name
        options: dict[str, Any] = {"timeout": _POLL_S} if self._negotiates else {"timeout": 0, "write_timeout": 2.0}
        if "://" not in url:
            options["exclusive"] = True
        try:
            return serial.serial_for_url(url, baudrate=115200, **options)
        except ValueError as error:
            raise InvalidInput(f"{url} is not a port or URL that can be opened: {error}.") from None
        except (serial.SerialException, OSError) as error:
            raise LinkError(_why_not(url, error)) from None

    def _watch(self) -> None:
        """Know what `select` can wait for, where it can."""
        self._waitable = None
        if not self._negotiates and os.name == "posix":
            with contextlib.suppress(OSError, AttributeError):
                self._waitable = self._port.fileno()

    def reopen(self) -> None:
        """Open the port again after it has gone; `LinkError` where it is not there yet. Takes no longer than 20 ms."""
        if self._attempt is None:
            self._attempt = Attempt(self._close_and_open)
        if self._attempt.done(_REOPEN_S):  # closing a socket sleeps, finding another machine may take seconds
            attempt, self._attempt = self._attempt, None
            self._port = attempt.result()
            self._watch()
        else:
            raise LinkError(f"{self.name} is still being opened.")

    def _close_and_open(self) -> Any:
        self.close()
        return self._open()

    @property
    def port(self) -> Any:
        """The pyserial port itself, for what is no wristband (yet): MicroPython's prompt."""
        return self._port

    def read(self, timeout: float) -> bytes:
        """Wait up to `timeout` seconds for bytes; take all that are there."""
        try:
            if self._negotiates:
                return self._read_polling(timeout)
            if self._waitable is not None:  # each change of a port's timeout costs as much as the whole read
                ready, _, _ = select.select([self._waitable], [], [], max(timeout, 0.0))
                if not ready:
                    return b""
                return self._take(self._waitable) if self._plain else bytes(self._port.read(4096))
            self._port.timeout = max(timeout, 0.0)
            first = self._port.read(1)
            if not first:
                return b""
            self._port.timeout = 0
            return bytes(first + self._port.read(4096))
        except (serial.SerialException, OSError, TypeError, ValueError) as error:  # the last two: closed under our feet
            raise connection_lost(self.name, error) from None

    def _take(self, descriptor: int) -> bytes:
        """What has come: pyserial would wait for it once more."""
        try:
            data = os.read(descriptor, 4096)
        except BlockingIOError:  # another program has been faster
            return b""
        if not data:
            raise OSError("the other end has gone")
        return data

    @property
    def descriptor(self) -> int | None:
        """See `Transport`."""
        return None if self._waitable == -1 else self._waitable

    def _read_polling(self, timeout: float) -> bytes:
        until = self.now() + timeout
        while True:
            data = bytes(self._port.read(max(1, self._port.in_waiting)))
            if data or self.now() >= until:
                return data

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        try:
            if self._plain and self._waitable is not None:  # pyserial waits for room even after the last byte
                with contextlib.suppress(BlockingIOError):
                    data = data[os.write(self._waitable, data) :]
            if data:
                self._port.write(data)
        except serial.SerialTimeoutException:
            raise LinkError(
                f"{self.name} takes no data. It may hang: unplug it, plug it in and connect again."
            ) from None
        except (serial.SerialException, OSError) as error:
            raise connection_lost(self.name, error) from None

    def now(self) -> float:
        """The wall clock's seconds."""
        return time.monotonic()

    def close(self) -> None:
        """Let go of the port."""
        self._waitable = -1 if self._waitable is not None else None  # its number may soon be another file's
        left = getattr(self._port, "_socket", None)  # pyserial forgets to close it when the other end has gone
        with contextlib.suppress(serial.SerialException, OSError):
            self._port.close()
        if left:
            left.close()

    def leave_behind(self) -> None:
        """See `Transport`. A socket is closed, not shut down: that would end the connection of the first process."""
        left = getattr(self._port, "_socket", None)
        if left:
            left.close()
            self._port.is_open = False
        else:
            self.close()


class Attempt:
    """Something that may take long and fail, tried in a thread."""

    def __init__(self, act: Callable[[], Any]):
        self._act = act
        self._got: Any = None
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._got = self._act()
        except Exception as error:
            self._error = error

    def done(self, seconds: float) -> bool:
        """Whether it has ended, after waiting up to so long."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def result(self) -> Any:
        """What came of it; raises what it raised."""
        if self._error:
            raise self._error
        return self._got


def attached() -> list[str]:
    """The ports of all wristbands plugged in, by USB id."""
    return sorted(port.device for port in list_ports.comports() if (port.vid, port.pid) in USB_IDS)


def only_attached() -> str:
    """The port of the one wristband that is plugged in; `LinkError` where there is none, or more than one."""
    ports = attached()
    if not ports:
        raise LinkError(
            f"No wristband is attached. Plug one in, name its port, or use a simulated one: sim://{DEFAULT}."
        )
    if len(ports) > 1:
        raise LinkError(f"{len(ports)} wristbands are attached, at {', '.join(ports)}: name the one you mean.")
    return ports[0]


def _why_not(url: str, error: Exception) -> str:
    """Why a port does not open, in a sentence."""
    code = getattr(error, "errno", None)
    text = str(error)
    if code == errno.ENOENT or "could not find" in text:
        ports = [port.device for port in list_ports.comports()]
        there = f"The ports here are {', '.join(sorted(ports))}." if ports else "No serial port is here at all."
        return f"There is no {url}. {there} Without a wristband, use sim://{DEFAULT}."
    if code in (errno.EACCES, errno.EPERM):
        return f"You may not open {url}. On Linux, join its group (often `sudo usermod -aG dialout $USER`) and log in again."
    if code in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK) or "exclusively lock" in text:
        return f"{url} is in use by another program. Close it, or use `lsof {url}` to find it."
    if "refused" in text.lower():
        return f"Nothing listens at {url}. Start it first, for example with `bubbleskin sim --port 7707`."
    return f"Cannot open {url}: {text}."
