"""A full recording replayed: read, lived through, compared; what came of it."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from bubbleskin import boards, checks
from bubbleskin.errors import InvalidInput
from bubbleskin.files import path_of
from bubbleskin.replays.compare import Difference, first_difference
from bubbleskin.replays.players import FirmwarePlayer, OtherProcess, Player, in_process, source_folders
from bubbleskin.sim.micropython import source_path
from bubbleskin.sim.trace_file import POWER_FAILED, TICK, Head, Trace, board_crc, read
from bubbleskin.toolchain.frozen import BARE, device_files, digest

ON = ("cpython", "micropython", "rp2040")
"""Where a firmware can live through a recording again."""
_TOLD = 100  # ticks between two calls of `progress`

Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Replayed:
    """What came of a replay."""

    path: Path
    board: str
    on: str
    """Where it ran."""
    difference: Difference | None
    """The first value that differs, None where nothing does."""
    ticks: int
    """How many were compared."""
    duration_s: float
    """How long they took on the board."""
    resets: int
    """How often power failed in them."""
    wall_s: float
    """How long the replay took."""
    notes: tuple[str, ...]
    """Sentences on what is not as it was: another firmware, another board, a recording that was not closed."""

    @property
    def identical(self) -> bool:
        """Whether every tick gave what was recorded."""
        return self.difference is None

    def __str__(self) -> str:
        if self.difference:
            return f"{self.path} differs on {self.on} at {self.difference}."
        resets = f" with {self.resets} power failure{'s' * (self.resets != 1)}" if self.resets else ""
        return f"{self.path} is identical on {self.on}: {self.ticks} ticks{resets}, {self.duration_s:.1f} s of {self.board}."


def replay(
    path: str | os.PathLike[str],
    on: str = "cpython",
    *,
    firmware: str | os.PathLike[str] | None = None,
    board: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Replayed:
    """Let a firmware live through the full recording at `path`, and compare what it decides, to the first difference.

    `on`: "cpython", "micropython" (built where it has not been), or "rp2040", the emulated chip. `firmware`: the folder of
    another version, such as a checkout of it; None is this one. `board`: the file of the board, where it is not one of
    ours. `progress(done, all)` is called with ticks. Raises `InvalidInput` for a file that is no whole recording.
    """
    checks.one_of("on", on, ON)
    if progress is not None:
        checks.function("progress", progress, "a function of two numbers, ticks done and all of them, or None")
    folder = path_of(firmware, "the firmware") if firmware is not None else None
    sources = source_folders(folder) if folder else None
    if sources and on == "rp2040":
        raise InvalidInput(
            "The emulated chip runs this version's firmware; replay another one on cpython or micropython."
        )
    trace = read(Path(path_of(path, "the full recording")))
    data = _board(trace, board)
    player = _player(trace.head, data, on, sources)
    begun = time.monotonic()
    ticks = resets = 0
    difference = None
    try:
        for call, decided in player.play(trace.calls()):
            found = first_difference(call, decided, trace.head.tick_us)
            if found:
                tick = max(0, ticks if call.kind == TICK else ticks - 1)
                difference = Difference(tick, tick * trace.head.tick_us * 1e-6, *found)
                break
            ticks += call.kind == TICK
            resets += call.kind == POWER_FAILED
            if progress and (ticks % _TOLD == 0 or ticks == trace.ticks):
                progress(ticks, trace.ticks)
    finally:
        player.close()
    return Replayed(
        path=path_of(path, "the full recording"),
        board=trace.head.board,
        on=on,
        difference=difference,
        ticks=ticks,
        duration_s=ticks * trace.head.tick_us * 1e-6,
        resets=resets,
        wall_s=time.monotonic() - begun,
        notes=tuple(_notes(trace, data, folder)),
    )


def _player(head: Head, data: ModuleType, on: str, sources: list[str] | None) -> Player:
    if on == "rp2040":
        from bubbleskin.replays.chip import ChipPlayer

        return ChipPlayer(head, data)
    if on == "cpython" and sources is None:
        return in_process(head, data)
    return FirmwarePlayer(OtherProcess(head, data, on, sources or source_path()))


def _board(trace: Trace, board: str | os.PathLike[str] | None) -> ModuleType:
    """The data of the board that was recorded."""
    head = trace.head
    if board is None and head.board not in boards.NAMES:
        raise InvalidInput(
            f"{trace.name} is of the board {checks.shown(head.board)}, which is not one of ours; give its file: "
            f"board='{head.board}.py', or --board."
        )
    data = boards.load(str(path_of(board, "the board")) if board is not None else head.board)
    if (head.board, head.bubbles, head.tick_us) != (data.NAME, data.BUBBLES, data.TICK_US):
        raise InvalidInput(
            f"{trace.name} is of the board {head.board}, {head.bubbles} bubbles and ticks of {head.tick_us} µs, not of "
            f"{data.NAME}, {data.BUBBLES} bubbles and ticks of {data.TICK_US} µs."
        )
    return data


def _notes(trace: Trace, data: ModuleType, folder: Path | None) -> list[str]:
    found = []
    if not trace.closed:
        found.append("The recording was not closed; its last block may be missing.")
    if folder:
        found.append(f"The firmware is that of {folder}.")
    elif digest(device_files(BARE)) != trace.head.firmware_sha256:
        found.append(f"The firmware that was recorded, {trace.head.firmware}, is another than this.")
    if not folder and board_crc(data) != trace.head.board_crc:
        found.append(f"The data of {data.NAME} are others than those that were recorded.")
    return found
