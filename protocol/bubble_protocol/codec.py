"""Every message of the schema with its names: what `packing` packs, and what the schema's CRC is taken of.

Hosts use it; a device has `packing` alone.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING
from bubble_protocol.packing import TEXT_SIZE, Packer
from bubble_protocol.schema.messages import FIRST_SIZES, MESSAGES, TEXT

if TYPE_CHECKING:
    from collections.abc import Sequence

    Field = tuple[str, int, str, int | None, int | None, str]


def kinds(fields: "Sequence[Field]") -> bytes:
    """One kind per value: a text is 16 bytes."""
    found = bytearray()
    for field in fields:
        if field[1] == TEXT:
            for _ in range(TEXT_SIZE):
                found.append(1)
        else:
            found.append(field[1])
    return bytes(found)


def limits(fields: "Sequence[Field]") -> "tuple[tuple[int | None, ...], tuple[int | None, ...]] | None":
    """The lowest and the highest of each value, see `Packer`."""
    if all(field[3] is None and field[4] is None for field in fields):
        return None
    values = [field for field in fields for _ in range(TEXT_SIZE if field[1] == TEXT else 1)]
    return tuple(value[3] for value in values), tuple(value[4] for value in values)


class Message(Packer):
    """One message: its names and fields as in the schema."""

    def __init__(
        self, message_id: int, name: str, fixed: "tuple[Field, ...]", repeated: "tuple[Field, ...]", meaning: str
    ):
        super().__init__(kinds(fixed), kinds(repeated), FIRST_SIZES.get(message_id), limits(fixed + repeated))
        self.id = message_id
        self.name = name
        self.fixed = fixed
        self.repeated = repeated
        self.meaning = meaning


BY_ID = {data[0]: Message(*data) for data in MESSAGES}
BY_NAME = {message.name: message for message in BY_ID.values()}


def schema_bytes() -> bytes:
    """What the schema's CRC is taken of: everything that decides the bytes on the wire, in canonical form."""
    lines = []
    for message_id, name, fixed, repeated, _ in MESSAGES:
        fields = ",".join("%s:%d" % (field[0], field[1]) for field in fixed)
        group = ",".join("%s:%d" % (field[0], field[1]) for field in repeated)
        lines.append("%d %s(%s)[%s]" % (message_id, name, fields, group))
    return "\n".join(lines).encode()
