# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""Payloads to integers and back, driven by the schema; the same code on host and device.

Values travel in an `array('i')` in schema order: fixed fields first, then the repeated group over and
over. A text takes TEXT_SIZE values. An unsigned 32-bit value above 2**31 - 1 stands in it as its two's complement.
"""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, micropython, ptr8, ptr32
from bubble_protocol.schema.messages import FIRST_SIZES, MESSAGES, TEXT

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    Field = tuple[str, int, str, int | None, int | None, str]

TEXT_SIZE = 16  # bytes of a text, each a value of its own


@micropython.viper
def _pack(kind: ptr8, value: ptr32, out: ptr8, kinds: int, times: int, at: int, index: int) -> int:
    """Write one value per kind, `times` over, from `value[at:]` to `out[index:]`; returns the index after them."""
    while times > 0:
        i = 0
        while i < kinds:
            rest = value[at]
            size = kind[i] & 15
            while size > 0:
                out[index] = rest & 255
                rest >>= 8
                index += 1
                size -= 1
            at += 1
            i += 1
        times -= 1
    return index


@micropython.viper
def _unpack(kind: ptr8, value: ptr32, data: ptr8, kinds: int, times: int, at: int, index: int) -> int:
    """Read one value per kind, `times` over, from `data[index:]` to `value[at:]`; returns the index after them."""
    while times > 0:
        i = 0
        while i < kinds:
            size = kind[i] & 15
            top = data[index + size - 1]
            if top > 127 and (size == 4 or kind[i] > 127):
                top -= 256
            rest = top
            step = size - 2
            while step >= 0:
                rest = rest << 8 | data[index + step]
                step -= 1
            value[at] = rest
            index += size
            at += 1
            i += 1
        times -= 1
    return index


@micropython.viper
def _first_out_of_range(value: ptr32, lows: ptr32, highs: ptr32, fixed: int, stride: int, end: int) -> int:
    """The index of the first value that is not within its limits, -1 where there is none."""
    i = 0
    limit = 0
    while i < end:
        if value[i] < lows[limit] or value[i] > highs[limit]:
            return i
        i += 1
        limit += 1
        if limit == fixed + stride:
            limit = fixed
    return -1


def _kinds(fields: "Sequence[Field]") -> bytes:
    """One kind per value: a text is 16 bytes."""
    kinds = bytearray()
    for field in fields:
        if field[1] == TEXT:
            for _ in range(TEXT_SIZE):
                kinds.append(1)
        else:
            kinds.append(field[1])
    return bytes(kinds)


def _limits(fields: "Sequence[Field]", which: int, none: int) -> "array[int]":
    """One limit per value, `none` where every value is allowed."""
    limits = []
    for field in fields:
        for _ in range(TEXT_SIZE if field[1] == TEXT else 1):
            limit = field[which]
            limits.append(none if limit is None else limit)
    return array("i", limits)  # of its very size: one that has grown keeps room for more


class Message:
    """How one message is packed: made once from the schema, allocates nothing when used."""

    # As of a message without limits, which most are: where the code is on the heap, there is no room for what says nothing.
    _lows: "array[int] | None" = None
    _highs: "array[int] | None" = None

    def __init__(
        self, message_id: int, name: str, fixed: "tuple[Field, ...]", repeated: "tuple[Field, ...]", meaning: str
    ):
        self.id = message_id
        self.name = name
        self.fixed = fixed
        self.repeated = repeated
        self.meaning = meaning
        self._fixed_kinds = _kinds(fixed)
        self._repeated_kinds = _kinds(repeated)
        self.fixed_values = len(self._fixed_kinds)
        self.stride_values = len(self._repeated_kinds)
        for field in fixed + repeated:
            if field[3] is not None or field[4] is not None:
                self._lows = _limits(fixed + repeated, 3, -0x80000000)
                self._highs = _limits(fixed + repeated, 4, 0x7FFFFFFF)
                break
        self.fixed_size = sum(kind & 15 for kind in self._fixed_kinds)
        self.stride = sum(kind & 15 for kind in self._repeated_kinds)
        self.size_min = FIRST_SIZES.get(message_id, self.fixed_size)

    def count(self, size: int) -> int:
        """Repetitions in a payload of `size` bytes, or -1 where no payload of this message has that size.

        Without a repeated group it may be longer, by what a newer version has appended, and shorter, down to
        `size_min`, by what this one has.
        """
        if self.stride == 0:
            return 0 if size >= self.size_min else -1
        rest = size - self.fixed_size
        if rest < 0 or rest % self.stride:
            return -1
        return rest // self.stride

    def pack(self, values: "array[int]", count: int, payload: bytearray, index: int) -> int:
        """Write the fixed fields and `count` repetitions to `payload[index:]`; returns the index after them."""
        index = _pack(self._fixed_kinds, values, payload, self.fixed_values, 1, 0, index)
        if count:
            index = _pack(self._repeated_kinds, values, payload, self.stride_values, count, self.fixed_values, index)
        return index

    def unpack(self, payload: bytearray, index: int, size: int, values: "array[int]") -> int:
        """Read `payload[index:index + size]` into `values`; returns the repetitions, -1 where the size is wrong.

        Fields that an older version does not send are 0; `payload` gets zeros in their place.
        """
        count = self.count(size)
        while count >= 0 and size < self.fixed_size:
            payload[index + size] = 0
            size += 1
        if count >= 0:
            index = _unpack(self._fixed_kinds, values, payload, self.fixed_values, 1, 0, index)
        if count > 0:
            _unpack(self._repeated_kinds, values, payload, self.stride_values, count, self.fixed_values, index)
        return count

    def first_out_of_range(self, values: "array[int]", count: int) -> int:
        """The index of the first of `values` that is outside the schema's limits, -1 where all are within."""
        if self._lows is None:
            return -1
        end = self.fixed_values + count * self.stride_values
        return _first_out_of_range(values, self._lows, self._highs, self.fixed_values, self.stride_values, end)


BY_ID = {data[0]: Message(*data) for data in MESSAGES}
BY_NAME = {message.name: message for message in BY_ID.values()}


def schema_lines() -> "Iterator[bytes]":
    """`schema_bytes`, message by message: a small heap has no room for all of it at once."""
    first = True
    for message_id, name, fixed, repeated, _ in MESSAGES:
        fields = ",".join("%s:%d" % (field[0], field[1]) for field in fixed)
        group = ",".join("%s:%d" % (field[0], field[1]) for field in repeated)
        yield ("%s%d %s(%s)[%s]" % ("" if first else "\n", message_id, name, fields, group)).encode()
        first = False


def schema_bytes() -> bytes:
    """What the schema's CRC is taken of: everything that decides the bytes on the wire, in canonical form."""
    return b"".join(schema_lines())
