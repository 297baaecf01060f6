"""MicroPython's prompt at the other end of a port, by `mpremote`: scripts and files, and sentences where they fail."""

import ast
import contextlib
import errno
import io
import time
from base64 import b64encode
from collections.abc import Iterator
from typing import Any

import serial
from mpremote.transport import TransportError, TransportExecError
from mpremote.transport_serial import SerialTransport

from bubbleskin.errors import BubbleskinError, LinkError
from bubbleskin.flash.machine import Connection

_CHUNK = 1536  # bytes of a file sent in one go; as source text a third more
_ENTER_S = 3.0

LOOK = """\
import os, sys
def _look(path):
    for entry in os.ilistdir(path):
        name = path + "/" + entry[0]
        if entry[1] & 0x4000:
            print((name, None))
            _look(name)
        else:
            print((name, _sum(name)))
def _sum(name):
    import hashlib
    hash, part, size = hashlib.sha256(), bytearray(512), 0
    with open(name, "rb") as file:
        while True:
            n = file.readinto(part)
            if not n:
                return size, hash.digest()
            size += n
            hash.update(part[:n] if n < 512 else part)
"""
"""Runs on the board: every file below a folder with its size and SHA-256, a line each; a folder has None.

All of them in one piece would need a large one of a heap that the files before have left in small ones.
"""


class Prompt(SerialTransport):
    """The raw prompt of the MicroPython at `connection`. `LinkError` where there is none, or where it goes away."""

    def __init__(self, connection: Connection):
        # Not `super().__init__`, which would open a port by name: ours is open, and may be an emulated one.
        self.serial = connection.port
        self.device_name = connection.name
        self.in_raw_repl = False
        self.use_raw_paste = True
        self.mounted = False
        self.is_pty = False
        self._connection = connection
        self._ready = False  # whether `LOOK` has been run
        with _sentences(self.device_name), contextlib.redirect_stdout(io.StringIO()):  # mpremote prints what it got
            self.enter_raw_repl(soft_reset=False, timeout_overall=_ENTER_S)

    def read_until(
        self,
        min_num_bytes: int,
        ending: bytes,
        timeout: float | None = 10,
        data_consumer: Any = None,
        timeout_overall: float | None = None,
    ) -> bytes:
        """As of `SerialTransport`, but by the connection's clock: that of an emulated board is not the wall's."""
        data = b""
        begin = heard = self._connection.now()
        while not data.endswith(ending):
            if self.serial.inWaiting() > 0:
                byte = self.serial.read(1)
                heard = self._connection.now()
                if data_consumer:
                    data_consumer(byte)
                data = byte if data_consumer else data + byte
                continue
            now = self._connection.now()
            if timeout is not None and now >= heard + timeout:
                break
            if timeout_overall is not None and now >= begin + timeout_overall:
                break
            if self._connection.blocks:
                time.sleep(0.002)
        return data

    def run(self, script: str) -> str:
        """What a script prints."""
        with _sentences(self.device_name):
            said: bytes = self.exec(script)
            return said.decode(errors="replace")

    def value(self, expression: str) -> Any:
        """The value of an expression that is a literal."""
        with _sentences(self.device_name):
            return self.eval(expression)

    def tree(self, path: str) -> dict[str, tuple[int, bytes] | None]:
        """Size and SHA-256 of every file below a folder, None for folders; empty where there is no such folder."""
        try:
            self._learn_to_look()
            lines = self.run(f"_look({path!r})").splitlines()
        except FileNotFoundError:
            return {}
        return dict(ast.literal_eval(line) for line in lines)

    def sum(self, path: str) -> tuple[int, bytes]:
        """Size and SHA-256 of a file."""
        self._learn_to_look()
        found: tuple[int, bytes] = self.value(f"_sum({path!r})")
        return found

    def _learn_to_look(self) -> None:
        if not self._ready:
            self.run(LOOK)
            self._ready = True

    def text(self, path: str) -> str:
        """A small file's content, empty where there is none."""
        try:
            with _sentences(self.device_name):
                return bytes(self.fs_readfile(path)).decode(errors="replace")
        except FileNotFoundError:
            return ""

    def write(self, path: str, data: bytes) -> None:
        """Write a file."""
        script = f"import binascii\nfile = open({path!r}, 'wb')\n"
        for at in range(0, max(len(data), 1), _CHUNK):
            script += f"file.write(binascii.a2b_base64({b64encode(data[at : at + _CHUNK])!r}))\n"
            if at + _CHUNK >= len(data):
                script += "file.close()\n"
            self.run(script)
            script = ""

    def put(self, path: str, data: bytes) -> None:
        """Write a file so that at any moment the old or the new one is there, whole."""
        self.write(path + ".new", data)
        self.rename(path + ".new", path)

    def rename(self, path: str, name: str) -> None:
        """Rename a file, in one step, over another if there is one."""
        self.run(f"import os; os.rename({path!r}, {name!r})")

    def remove(self, path: str, *, folder: bool = False) -> None:
        """Remove a file or an empty folder, if it is there."""
        with contextlib.suppress(FileNotFoundError):
            self.run(f"import os; os.{'rmdir' if folder else 'remove'}({path!r})")

    def leave(self, script: str) -> None:
        """Run a script from which the board does not come back here, such as a reset."""
        with _sentences(self.device_name):
            self.exec_raw_no_follow(script)


@contextlib.contextmanager
def _sentences(name: str) -> Iterator[None]:
    try:
        yield
    except TransportExecError as problem:
        said = problem.error_output.strip().splitlines()
        last = said[-1] if said else "nothing"
        if "ENOENT" in last:
            raise FileNotFoundError(errno.ENOENT, last) from None
        if "ENOSPC" in last:
            raise BubbleskinError(
                f"The board at {name} has no space left. Remove files of your own from it "
                "(`mpremote fs ls`, `mpremote fs rm`), then flash again."
            ) from None
        raise BubbleskinError(f"MicroPython at {name} has failed at a step of flashing: {last}. Flash again.") from None
    except FileNotFoundError:
        raise
    except TransportError as problem:
        raise LinkError(
            f"What is at {name} does not answer as MicroPython's prompt ({problem}). "
            "Unplug it, plug it in, then flash again."
        ) from None
    except (serial.SerialException, OSError, ValueError, SyntaxError) as error:  # the last two: half an answer
        raise LinkError(
            f"The connection to {name} is lost ({error}). Plug the wristband in again, then flash again."
        ) from None
