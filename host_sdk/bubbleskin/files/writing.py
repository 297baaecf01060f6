"""All that is written goes through here: a disk that is full is one sentence, and no half of a file takes a whole one's place."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bubbleskin.errors import InvalidInput
from bubbleskin.files.reading import path_of


@contextlib.contextmanager
def guarded(path: Any, what: str) -> Iterator[Path]:
    """Write the file of `what` within this; whatever the system refuses is one sentence."""
    place = path_of(path, what)
    try:
        yield place
    except (OSError, UnicodeError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise InvalidInput(
            f"{what[:1].upper()}{what[1:]} {place} cannot be written: {why}.".replace("..", ".")
        ) from None


def write_bytes(path: Any, data: bytes, what: str) -> None:
    """Write a whole file, or leave the one that was there as it was."""
    with guarded(path, what) as place:
        if place.exists() and not place.is_file():  # a device, a pipe
            place.write_bytes(data)
            return
        real = Path(os.path.realpath(place))
        handle, name = tempfile.mkstemp(dir=real.parent, prefix=f".{real.name[:64]}.", suffix=".new")
        try:
            with os.fdopen(handle, "wb") as new:
                new.write(data)
            os.chmod(name, real.stat().st_mode if real.exists() else 0o666 & ~_umask())  # noqa: PTH101 - as the rest here
            os.replace(name, real)  # noqa: PTH105
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(name)  # noqa: PTH108
            raise


def write_text(path: Any, text: str, what: str) -> None:
    """`write_bytes` of a text, in UTF-8."""
    with guarded(path, what):
        data = text.encode("utf-8")
    write_bytes(path, data, what)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
