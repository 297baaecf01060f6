"""UF2s that have been seen to work: a history on this computer, so that there is a way back."""

import hashlib
from pathlib import Path

from bubbleskin.toolchain.interpreter import cache_folder

_LENGTH = 2
"""UF2s of a board that are held."""


class UnderWay:
    """Which board an update has been begun on and not ended: in its boot loader it could not say so itself.

    A board is known by its name or by the path of its file.
    """

    def __init__(self, folder: Path | None = None):
        self._note = (folder or cache_folder() / "flashed") / "under-way"

    def begin(self, board: str) -> None:
        """From now on the board may be without firmware."""
        self._note.parent.mkdir(parents=True, exist_ok=True)
        self._note.write_text(board)

    def board(self) -> str | None:
        """The board whose update was not ended."""
        return self._note.read_text() if self._note.is_file() else None

    def end(self) -> None:
        """It has answered."""
        self._note.unlink(missing_ok=True)


class History:
    """The last UF2s of one kind of board that answered HELLO after they had been copied, the newest first."""

    def __init__(self, board: str, folder: Path | None = None):
        self._folder = (folder or cache_folder() / "flashed") / board

    def remember(self, data: bytes) -> None:
        """This one has answered."""
        self._folder.mkdir(parents=True, exist_ok=True)
        each = [data, *(old for old in self._all() if old != data)]
        for number, content in reversed(list(enumerate(each[:_LENGTH]))):  # the oldest first: none is ever missing
            new = self._folder / "new"
            new.write_bytes(content)
            new.replace(self._folder / f"{number}.uf2")

    def tried(self, data: bytes) -> None:
        """This one is about to be copied."""
        self._folder.mkdir(parents=True, exist_ok=True)
        (self._folder / "tried").write_text(_digest(data))

    def previous(self) -> Path | None:
        """The newest that worked and is not what was copied last; None where there is none."""
        mark = self._folder / "tried"
        tried = mark.read_text() if mark.is_file() else ""
        for number in range(_LENGTH):
            path = self._folder / f"{number}.uf2"
            if path.is_file() and _digest(path.read_bytes()) != tried:
                return path
        return None

    def _all(self) -> list[bytes]:
        paths = (self._folder / f"{number}.uf2" for number in range(_LENGTH))
        return [path.read_bytes() for path in paths if path.is_file()]


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
