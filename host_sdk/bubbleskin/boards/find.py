"""The boards of this firmware by name, and anybody's own by the path of its file."""

import pkgutil
import re
import traceback
from pathlib import Path
from types import ModuleType

from bubble_firmware import boards
from bubbleskin.boards.check import check
from bubbleskin.checks import instance
from bubbleskin.errors import InvalidInput

DEFAULT = boards.DEFAULT
"""The board that is meant where none is named."""


def _natural(name: str) -> list[int | str]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


NAMES: tuple[str, ...] = tuple(
    sorted((found.name for found in pkgutil.iter_modules(boards.__path__) if not found.ispkg), key=_natural)
)
"""Every board of this firmware: the files of its folder `boards`."""


def is_file(board: str | Path) -> bool:
    """Whether `board` is the path of a board's file, and not the name of a board."""
    return Path(board).suffix == ".py"


def load(board: str | Path) -> ModuleType:
    """The data of a board: of one of `NAMES`, or of the board file at the path `board`.

    Raises `InvalidInput` where there is none, or where its file does not define what a board needs.
    """
    instance("The board", board, (str, Path), f"its name, such as {DEFAULT!r}, or the path of its file")
    if is_file(board):
        return _load_file(Path(board).expanduser())
    if board not in NAMES:
        raise InvalidInput(
            f"There is no board {str(board)!r}; there are {' and '.join(NAMES)}. "
            "One of your own is the path of its file, such as ./pad8.py."
        )
    data = boards.load(str(board))
    check(data, f"The board {board}")
    return data


def own_file(data: ModuleType) -> Path | None:
    """The file of a board that is not one of ours, as `load` gives it; None for one of `NAMES`."""
    if data.__name__.startswith(f"{boards.__name__}."):
        return None
    assert data.__file__ is not None
    return Path(data.__file__)


def _load_file(path: Path) -> ModuleType:
    path = path.absolute()
    if not path.is_file():
        raise InvalidInput(f"There is no board file {path}.")
    name = path.stem
    if name in NAMES:
        if path.samefile(Path(boards.__path__[0]) / path.name):
            return load(name)
        raise InvalidInput(f"{path} has the name of one of our boards; call file and board something else than {name}.")
    data = ModuleType(name)
    data.__file__ = str(path)
    try:  # not by an import: that would leave a cache in the user's folder, and forget what has changed within a second
        exec(compile(path.read_bytes(), str(path), "exec"), vars(data))
    except Exception as error:
        raise InvalidInput(f"The board file {path} cannot be read: {_what(error, path)}.") from None
    check(data, f"The board file {path}", name)
    return data


def _what(error: Exception, path: Path) -> str:
    """What went wrong, and in which line of the file."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
    words = error.msg if isinstance(error, SyntaxError) else str(error)
    place = f"line {line}: " if line else ""
    return f"{place}{type(error).__name__}: {words}"
