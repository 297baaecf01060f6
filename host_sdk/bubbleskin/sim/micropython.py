"""The firmware in another process, in lockstep; above all in a real MicroPython (unix port) with a heap like the board's."""

import contextlib
import select
import subprocess
import sys
import tempfile
from array import array
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import bubble_firmware
import bubble_protocol
from bubble_firmware.drivers.flash import SECTOR
from bubble_firmware.hal.lockstep import LINK_IN, LINK_OUT, LISTEN_ONLY, RESET
from bubbleskin import boards
from bubbleskin.errors import LinkError
from bubbleskin.sim.firmware import Firmware, Outputs
from bubbleskin.toolchain.interpreter import own_micropython
from bubbleskin.toolchain.unix import micropython

HEAP = "448k"
"""What the firmware needs here: 116 kB of data (19 bubbles), as on the Pico, which has 237 kB for them. In this heap
are also the firmware's code, 137 kB, and 17 kB that stand for flash; and compiling the code takes room and leaves holes."""

FLASH_BYTES = 4 * SECTOR
"""What stands for flash there; it is blank when the process begins."""

_PATIENCE = 10.0  # wall seconds for one tick, which takes well under a millisecond

_PROGRAM = """
import gc, sys
gc.threshold(16384)  # bytes: what compiling leaves behind goes at once, or the code lies all over the heap
sys.path[:] = {path!r}
from bubble_firmware.main import lockstep
{import_board}
lockstep(board, {boot_id}, {boot_ticks})
"""


def source_path() -> list[str]:
    """The folders that hold the packages which run on the device."""
    return [str(Path(package.__path__[0]).parent) for package in (bubble_protocol, bubble_firmware)]


def board_import(board: ModuleType) -> str:
    """The statement that gives a program the data of `board` as `board`; a board's own file lies in its path."""
    if boards.own_file(board):
        return f"import {board.NAME} as board"
    return f"from bubble_firmware.boards import {board.NAME} as board"


class LockstepFirmware(Firmware):
    """A `Firmware` in another process, which `command` starts, talked to through `bubble_firmware.hal.lockstep`.

    `what`: how sentences call it. `advice`: what to do where the command does not run.
    """

    def __init__(self, command: Sequence[str | Path], bubbles: int, what: str, advice: str = ""):
        self._what = what
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - read when the process has died
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                bufsize=0,
                start_new_session=True,  # a terminal's Ctrl-C is for us, who then end it ourselves
            )
        except OSError as error:
            self._errors.close()
            raise LinkError(f"{command[0]} does not run ({error.strerror}).{advice}") from None
        self._n = bubbles
        self._size = 2 + 4 * self._n + 4 + LINK_OUT

    def tick(self, counts: array, link: bytes) -> Outputs:
        """See `Firmware`."""
        return self._exchange(len(link).to_bytes(2, "little") + counts.tobytes() + link.ljust(LINK_IN, b"\0"))

    def listen(self, link: bytes, phase_us: int) -> Outputs:
        """See `Firmware`."""
        head = (len(link) | LISTEN_ONLY).to_bytes(2, "little") + phase_us.to_bytes(2, "little")
        return self._exchange(head.ljust(2 + 2 * (self._n + 1), b"\0") + link.ljust(LINK_IN, b"\0"))

    def _exchange(self, block: bytes) -> Outputs:
        self._write(block)
        answer = self._read()
        sent = int.from_bytes(answer[:2], "little")
        pulses = array("H", answer[2 : 2 + 4 * self._n])
        pump, dump = array("H", answer[2 + 4 * self._n : 6 + 4 * self._n])
        if sys.byteorder == "big":
            pulses.byteswap()
        at = self._size - LINK_OUT
        return Outputs(pulses, pump, bool(dump), answer[at : at + sent])

    def reset(self) -> None:
        """See `Firmware`; flash is in the process, which goes on."""
        self._write(bytes([RESET]) * (2 + 2 * (self._n + 1) + LINK_IN))

    def close(self) -> None:
        """End the process."""
        with contextlib.suppress(OSError):
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe:
                    pipe.close()
        try:
            self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()

    def _write(self, block: bytes) -> None:
        try:
            assert self._process.stdin is not None
            self._process.stdin.write(block)
        except OSError:
            raise self._died() from None

    def _read(self) -> bytes:
        pipe = self._process.stdout
        assert pipe is not None
        answer = b""
        while len(answer) < self._size:
            ready, _, _ = select.select([pipe], [], [], _PATIENCE)
            if not ready:
                self._process.kill()
                raise LinkError(f"{self._what} has hung: no tick within {_PATIENCE:g} s.")
            part = pipe.read(self._size - len(answer))
            if not part:
                raise self._died()
            answer += part
        return answer

    def _died(self) -> LinkError:
        status = self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines() or ["it said nothing"]
        return LinkError(f"{self._what} has ended with status {status}: {lines[-1].rstrip('.')}.")


class MicroPythonFirmware(LockstepFirmware):
    """The firmware of `board` in MicroPython, with flash that is blank."""

    interpreter = "micropython"

    def __init__(self, board: ModuleType, boot_id: int, boot_ticks: int = -1):
        interpreter = own_micropython() or micropython()  # built now where it has not been, which is said
        self.boot_id = boot_id
        self.boot_ticks = boot_ticks
        self.flash_at_start = b"\xff" * FLASH_BYTES
        path, import_board = source_path(), board_import(board)
        own = boards.own_file(board)
        if own:
            path.append(str(own.parent))
        program = _PROGRAM.format(path=path, import_board=import_board, boot_id=boot_id, boot_ticks=boot_ticks)
        super().__init__(
            [interpreter, "-X", f"heapsize={HEAP}", "-c", program],
            board.BUBBLES,
            "The firmware in MicroPython",
            " Set MICROPYTHON to a 32-bit MicroPython (unix port).",
        )
