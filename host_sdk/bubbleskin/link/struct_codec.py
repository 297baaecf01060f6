"""The schema's messages packed and unpacked by `struct` and numpy: on CPython five times as fast as the device's codec.

What stands where is the schema's; this only turns it into formats, once. The shared codec, which works byte by byte, is
what the device runs: a test holds both against each other for every message.
"""

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bubble_protocol import codec
from bubble_protocol.frame import HEADER
from bubble_protocol.schema import messages

_LETTERS = {
    messages.U8: "B",
    messages.U16: "H",
    messages.U32: "I",
    messages.I16: "h",
    messages.I32: "i",
}


class Columns(Mapping[str, NDArray[np.int64]]):
    """The repeated fields by name, made when they are asked for."""

    def __init__(self, data: bytearray, row: np.dtype[np.void]):
        self._data = data
        self._row = row

    def __getitem__(self, name: str) -> NDArray[np.int64]:
        if name not in self:
            raise KeyError(name)
        return np.frombuffer(self._data, self._row)[name].astype(np.int64)

    def __contains__(self, name: object) -> bool:
        return name in (self._row.names or ())

    def __iter__(self) -> Iterator[str]:
        return iter(self._row.names or ())

    def __len__(self) -> int:
        return len(self._row.names or ())


class StructCodec:
    """Packs and unpacks the payloads of one message."""

    def __init__(self, message: codec.Message):
        self.message = message
        self._names = tuple(field[0] for field in message.fixed)
        self._texts = tuple(field[0] for field in message.fixed if field[1] == messages.TEXT)
        self._fixed = "".join("16B" if field[1] == messages.TEXT else _LETTERS[field[1]] for field in message.fixed)
        self._group = "".join(_LETTERS[field[1]] for field in message.repeated)
        self._unpack = struct.Struct("<" + self._fixed.replace("16B", "16s")).unpack_from
        self._packs: dict[int, Callable[..., bytes]] = {}
        self._row = np.dtype([(field[0], f"<{_LETTERS[field[1]]}") for field in message.repeated])

    def pack(self, sequence: int, fixed: Sequence[int], repeated: Sequence[Sequence[int]]) -> bytes:
        """Id, sequence number and payload. `struct.error` for a number that has no room."""
        count = len(repeated)
        pack = self._packs.get(count)
        if pack is None:
            pack = self._packs[count] = struct.Struct("<BH" + self._fixed + self._group * count).pack
        if count:
            return pack(self.message.id, sequence, *fixed, *chain.from_iterable(repeated))
        return pack(self.message.id, sequence, *fixed)

    def unpack(
        self, content: bytearray, size: int
    ) -> tuple[dict[str, int | str], Mapping[str, NDArray[np.int64]]] | None:
        """Fields by name, and columns by name: (count,) each. None where no payload of this message has `size` bytes.

        `content` begins with id and sequence number. Fields that older firmware does not send are 0, and those that
        newer firmware has appended are passed over.
        """
        message = self.message
        count = message.count(size)
        if count < 0:
            return None
        if size < message.fixed_size:
            content = content[: HEADER + size].ljust(HEADER + message.fixed_size, b"\0")
        fields = dict(zip(self._names, self._unpack(content, HEADER), strict=True))
        for name in self._texts:
            fields[name] = fields[name].rstrip(b"\0").decode("ascii", "replace")
        if not self._group:
            return fields, {}
        return fields, Columns(content[HEADER + message.fixed_size : HEADER + size], self._row)


BY_ID = {message_id: StructCodec(message) for message_id, message in codec.BY_ID.items()}
BY_NAME = {entry.message.name: entry for entry in BY_ID.values()}
