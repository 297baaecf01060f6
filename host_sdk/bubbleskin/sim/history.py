"""What has reached the firmware of a simulated board since power came, and what it has decided: kept, and recorded to files."""

import datetime
import os
import zlib
from array import array
from pathlib import Path
from types import ModuleType

from bubble_protocol.version import FIRMWARE
from bubbleskin.device.state import State
from bubbleskin.errors import InvalidInput
from bubbleskin.files import guarded, path_of
from bubbleskin.sim.firmware import Firmware, Outputs
from bubbleskin.sim.trace_file import LOOK, LOOP, POWER_FAILED, TICK, Calls, Head, board_crc, end_line
from bubbleskin.telemetry.recording import Sink
from bubbleskin.toolchain.frozen import BARE, device_files, digest

BLOCK = 200
"""Calls in a block: a kill loses so many ticks at most, a second of 7 bubbles."""
BYTES_MOST = 16 * 2**20
"""Of all blocks that are kept: hours of a board with telemetry."""
SUFFIX = ".jsonl"


class History:
    """The calls of the `firmware` of `data`, a board, which has not been called yet."""

    def __init__(self, data: ModuleType, firmware: Firmware):
        self.ticks = 0
        self._data = data
        self._firmware = firmware
        self._calls = Calls(data.BUBBLES)
        self._before = 0  # ticks, before those in `_calls`
        self._room = BLOCK  # for more calls in the block
        self._blocks: list[bytes] | None = []
        self._bytes = 0
        self._files: list[TraceFile] = []
        self._interpreter = firmware.interpreter
        self._boot_id, self._boot_ticks, self._flash = firmware.boot_id, firmware.boot_ticks, firmware.flash_at_start

    def tick(self, counts: array, link: bytes, outputs: Outputs) -> None:
        """The firmware has been given this in a tick, and has decided that."""
        self.ticks += 1
        self._calls.counts += counts
        self._called(TICK, 0, link, outputs)

    def listen(self, phase_us: int, link: bytes, outputs: Outputs) -> None:
        """The same between two ticks."""
        self._called(LOOK, phase_us, link, outputs)

    def reset(self) -> None:
        """Power has failed and come back."""
        image = self._firmware.flash_image()
        crc = zlib.crc32(image).to_bytes(4, "little") if image is not None else b""
        self._called(POWER_FAILED, 0, b"", Outputs(array("H"), 0, False, crc))

    def loop(self, is_open: bool) -> None:
        """The loop through the emergency stop has opened, or closed."""
        self._called(LOOP, int(is_open), b"", Outputs(array("H"), 0, False, b""))

    def record(self, path: str | os.PathLike[str]) -> "TraceFile":
        """Begin a file with all that has been, to which all that comes is added until it is closed. Raises `InvalidInput`."""
        place = path_of(path, "the recording")
        if place.suffix != SUFFIX:
            raise InvalidInput(f"{place} does not say its kind; a full recording ends in {SUFFIX}.")
        if self._blocks is None:
            raise InvalidInput(
                f"A full recording begins when power comes, and that is {self.ticks} ticks ago: more than "
                f"{BYTES_MOST >> 20} MB, which is all that is kept. Connect anew, and record from the start."
            )
        self._flush()
        file = TraceFile(place, [self._head().line(), *self._blocks], self)
        self._files.append(file)
        return file

    def close(self, file: "TraceFile | None" = None) -> None:
        """Finish one file, or all."""
        self._flush()
        for each in [file] if file else list(self._files):
            if each in self._files:
                self._files.remove(each)
                each.finish(self.ticks)

    def _head(self) -> Head:
        return Head(
            board=self._data.NAME,
            bubbles=self._data.BUBBLES,
            tick_us=self._data.TICK_US,
            board_crc=board_crc(self._data),
            interpreter=self._interpreter,
            firmware=".".join(map(str, FIRMWARE)),
            firmware_sha256=digest(device_files(BARE)),
            boot_id=self._boot_id,
            boot_ticks=self._boot_ticks,
            flash=self._flash,
            recorded=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        )

    def _called(self, kind: int, phase_us: int, link: bytes, outputs: Outputs) -> None:
        calls = self._calls
        pulses, pump, dump, sent = outputs
        calls.heads += (kind, phase_us, len(link), len(sent), pump, dump)
        calls.pulses += pulses
        if link:
            calls.link += link
        if sent:
            calls.sent += sent
        self._room -= 1
        if not self._room:
            self._flush()

    def _flush(self) -> None:
        """Make a block of the calls so far."""
        if not len(self._calls):
            return
        block = self._calls.take(self._before)
        self._before, self._room = self.ticks, BLOCK
        for file in self._files:
            file.add(block, self.ticks)
        if self._blocks is not None:
            self._blocks.append(block)
            self._bytes += len(block)
            if self._bytes > BYTES_MOST:
                self._blocks = None


class TraceFile(Sink):
    """A full recording while it is written; `rows` are the ticks in it. Made by `History.record`."""

    def __init__(self, path: Path, lines: list[bytes], history: History):
        self.path = path
        self.rows = history.ticks
        self._history = history
        self._broken: InvalidInput | None = None
        with guarded(path, "the recording"):
            self._file = path.open("wb", buffering=0)
        try:
            with guarded(path, "the recording"):
                self._write(b"".join(lines))
        except InvalidInput:
            self._file.close()
            raise

    def write(self, state: State) -> None:
        """Nothing: a state is in what the board has sent."""

    def add(self, block: bytes, ticks: int) -> None:
        """Add a block, after which there are so many ticks. What goes wrong is for `close` to say: here it hits the board.

        A line that is torn then is one that `read` passes over.
        """
        if self._broken:
            return
        try:
            self._write(block)
            self.rows = ticks
        except OSError as error:
            self._broken = InvalidInput(f"{self.path} ends after {self.rows} ticks: {error.strerror}.")

    def finish(self, ticks: int) -> None:
        """Write the last line."""
        if not self._broken:
            self.add(end_line(ticks), ticks)
        self._file.close()

    def close(self) -> None:
        """See `Sink`."""
        self._history.close(self)
        if self._broken:
            why, self._broken = self._broken, None
            raise why

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]
