"""Payloads to integers and back, driven by the schema; the same code on host and device.

Values travel in an `array('i')` in schema order: fixed fields first, then the repeated group over and
over. A text takes 16 values. An unsigned 32-bit value above 2**31 - 1 stands in it as its two's complement.
"""

from bubble_protocol.messages import MESSAGES, TEXT
from bubble_protocol.portable import micropython, ptr8, ptr32


@micropython.viper
def _pack(kinds, start: int, end: int, values, at: int, payload, index: int) -> int:
    """Write one value per kind in `kinds[start:end]`; returns the index after them."""
    kind = ptr8(kinds)
    value = ptr32(values)
    out = ptr8(payload)
    while start < end:
        rest = value[at]
        size = kind[start] & 15
        while size > 0:
            out[index] = rest & 255
            rest >>= 8
            index += 1
            size -= 1
        at += 1
        start += 1
    return index


@micropython.viper
def _unpack(kinds, start: int, end: int, values, at: int, payload, index: int) -> int:
    """Read one value per kind in `kinds[start:end]`; returns the index after them."""
    kind = ptr8(kinds)
    value = ptr32(values)
    data = ptr8(payload)
    while start < end:
        size = kind[start] & 15
        top = data[index + size - 1]
        if top > 127 and (size == 4 or kind[start] > 127):
            top -= 256
        rest = top
        step = size - 2
        while step >= 0:
            rest = rest << 8 | data[index + step]
            step -= 1
        value[at] = rest
        index += size
        at += 1
        start += 1
    return index


def _expand(fields):
    """One kind per value: a text is 16 bytes."""
    kinds = bytearray()
    for field in fields:
        if field[1] == TEXT:
            for _ in range(16):
                kinds.append(1)
        else:
            kinds.append(field[1])
    return bytes(kinds)


class Message:
    """How one message is packed: made once from the schema, allocates nothing when used."""

    def __init__(self, message_id, name, fixed, repeated, meaning):
        self.id = message_id
        self.name = name
        self.fixed = fixed
        self.repeated = repeated
        self.meaning = meaning
        self._fixed_kinds = _expand(fixed)
        self._repeated_kinds = _expand(repeated)
        self.fixed_values = len(self._fixed_kinds)
        self.stride_values = len(self._repeated_kinds)
        self.fixed_size = sum(kind & 15 for kind in self._fixed_kinds)
        self.stride = sum(kind & 15 for kind in self._repeated_kinds)

    def count(self, size):
        """Repetitions in a payload of `size` bytes, or -1 where no payload of this message has that size."""
        rest = size - self.fixed_size
        if self.stride == 0:
            return 0 if rest == 0 else -1
        if rest < 0 or rest % self.stride:
            return -1
        return rest // self.stride

    def pack(self, values, count, payload, index):
        """Write the fixed fields and `count` repetitions to `payload[index:]`; returns the index after them."""
        index = _pack(self._fixed_kinds, 0, self.fixed_values, values, 0, payload, index)
        at = self.fixed_values
        for _ in range(count):
            index = _pack(self._repeated_kinds, 0, self.stride_values, values, at, payload, index)
            at += self.stride_values
        return index

    def unpack(self, payload, index, size, values):
        """Read `payload[index:index + size]` into `values`; returns the repetitions, -1 where the size is wrong."""
        count = self.count(size)
        if count >= 0:
            index = _unpack(self._fixed_kinds, 0, self.fixed_values, values, 0, payload, index)
            at = self.fixed_values
            for _ in range(count):
                index = _unpack(self._repeated_kinds, 0, self.stride_values, values, at, payload, index)
                at += self.stride_values
        return count


BY_ID = {data[0]: Message(*data) for data in MESSAGES}
BY_NAME = {message.name: message for message in BY_ID.values()}


def schema_bytes():
    """What the schema's CRC is taken of: everything that decides the bytes on the wire, in canonical form."""
    parts = []
    for message_id, name, fixed, repeated, _ in MESSAGES:
        fields = ",".join("%s:%d" % (field[0], field[1]) for field in fixed)
        group = ",".join("%s:%d" % (field[0], field[1]) for field in repeated)
        parts.append("%d %s(%s)[%s]" % (message_id, name, fields, group))
    return "\n".join(parts).encode()
