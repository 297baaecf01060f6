"""Bytes and text of a file: not more than a file of ours can have, and decoded as whoever wrote it meant."""

import codecs
import os
from pathlib import Path
from typing import Any

from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput

BYTES_MAX = 64 * 2**20
"""Of a file that is read. What a header or a compressed file claims to hold is never believed."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_AT_ONCE = 2**20
_LOOKED_AT = 512
_LATIN = "\u2260"
"""Beyond these letters and signs (µ, −, °) nothing of ours begins."""


def path_of(path: Any, what: str) -> Path:
    """The path of a file that is `what`, such as 'the layout'; `InvalidInput` for what is no path."""
    if not isinstance(path, str | os.PathLike):
        raise InvalidInput(f"The path of {what} is {shown(path)}; give a text or a Path.")
    name = os.fspath(path)
    if not isinstance(name, str) or not name or "\0" in name:
        raise InvalidInput(f"The path of {what} is {shown(name)}, which names no file.")
    return Path(name)


def read_bytes(path: Any, what: str, most: int = BYTES_MAX) -> bytes:
    """What stands in the file of `what`; `InvalidInput` where it cannot be read or has more than `most` bytes."""
    place = path_of(path, what)
    try:
        with place.open("rb") as file:
            data = b""
            while len(data) <= most and (part := file.read(_AT_ONCE)):
                data += part
    except (OSError, ValueError) as error:  # the second: a name that no system can have
        raise InvalidInput(f"Cannot read {what} {_name(place)}: {_why(error)}.") from None
    if len(data) > most:
        raise InvalidInput(f"{_name(place)} has more than {most // 2**20} MB; {what} cannot be so large.")
    return data


def read_text(path: Any, what: str) -> str:
    """The text in the file of `what`, in UTF-8, UTF-16 or Windows' cp1252; line ends become newlines."""
    data = read_bytes(path, what)
    name = _name(path_of(path, what))
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return _decoded(data[len(mark) :], encoding, name, what)
    start = data[:_LOOKED_AT]
    if b"\0" in start:  # UTF-16 without a mark has one in every second byte of digits
        even, odd = start[::2].count(0), start[1::2].count(0)
        text = _decoded(data, "utf-16-be" if even > odd else "utf-16-le", name, what)
        if any(character > _LATIN for character in text[: _LOOKED_AT // 2]):
            raise _no_text(name, what)
        return text
    try:
        return _checked(data.decode("utf-8"), name, what)
    except UnicodeDecodeError:
        return _decoded(data, "cp1252", name, what)


def _decoded(data: bytes, encoding: str, name: str, what: str) -> str:
    try:
        return _checked(data.decode(encoding), name, what)
    except UnicodeDecodeError:
        raise _no_text(name, what) from None


def _checked(text: str, name: str, what: str) -> str:
    """The text, where it is one: what is none decodes too, but has control characters."""
    if any(character < " " and character not in "\t\n\r\f\v" for character in text):
        raise _no_text(name, what)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _no_text(name: str, what: str) -> InvalidInput:
    return InvalidInput(f"{name} is not text, so it is not {what}: save it as text in UTF-8.")


def _why(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error).rstrip(".")


def _name(path: Path) -> str:
    """A path in a sentence, whatever bytes its name has."""
    return str(path).encode("utf-8", "backslashreplace").decode()
