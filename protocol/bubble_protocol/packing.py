# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""Payloads to integers and back, by what the schema says of their bytes; the same code on host and device.

Values travel in an `array('i')` in schema order: fixed fields first, then the repeated group over and
over. A text takes TEXT_SIZE values. An unsigned 32-bit value above 2**31 - 1 stands in it as its two's complement.

A device asks nothing else of the schema, so `schema.packed` has that much of it: where code is on the heap, names and
tuples of every field would take a sixth of it.
"""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, micropython, ptr8, ptr32
from bubble_protocol.schema.packed import PACKED

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

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


class Packer:
    """How one message is packed: made once, allocates nothing when used.

    `fixed_size` and `stride` are the bytes of the fixed fields and of one repetition, `fixed_values` and `stride_values` their
    values, `size_min` the bytes of the shortest payload that is still understood. `limits`: the lowest of each value and
    the highest of each, None where there is none; None where no value has any.
    """

    # As of a message without limits that has not grown, which most are: where the code is on the heap, there is no room for what
    # says nothing.
    limits: "tuple[Sequence[int | None], Sequence[int | None]] | None" = None
    _first_size: "int | None" = None
    _lows: "array[int] | None" = None
    _highs: "array[int] | None" = None

    def __init__(
        self,
        fixed_kinds: bytes,
        repeated_kinds: bytes,
        first_size: "int | None" = None,
        limits: "tuple[Sequence[int | None], Sequence[int | None]] | None" = None,
    ):
        """Kinds: one for each value, see `schema.messages`."""
        self._fixed_kinds = fixed_kinds
        self._repeated_kinds = repeated_kinds
        self.fixed_values = len(fixed_kinds)
        self.stride_values = len(repeated_kinds)
        self.fixed_size = sum(kind & 15 for kind in fixed_kinds)
        self.stride = sum(kind & 15 for kind in repeated_kinds)
        if first_size is not None:
            self._first_size = first_size
        if limits is not None:
            self.limits = limits
            self._lows = array("i", [-0x80000000 if low is None else low for low in limits[0]])
            self._highs = array("i", [0x7FFFFFFF if high is None else high for high in limits[1]])

    @property
    def size_min(self) -> int:
        """See above."""
        return self.fixed_size if self._first_size is None else self._first_size

    def count(self, size: int) -> int:
        """Repetitions in a payload of `size` bytes, or -1 where no payload of this message has that size.

        Without a repeated group it may be longer, by what a newer version has appended, and shorter, down to
        `size_min`, by what this one has.
        """
        if self.stride == 0:
            least = self._first_size  # and not `size_min`: this is in every request's way
            return 0 if size >= (self.fixed_size if least is None else least) else -1
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


def _packers() -> "dict[int, Packer]":
    """By the message's id. Messages of the same bytes, and half of all are replies with nothing but a time, share one."""
    made: "dict[tuple[Any, ...], Packer]" = {}
    found = {}
    for data in PACKED:
        kinds = data[1:]
        if kinds not in made:
            made[kinds] = Packer(*kinds)
        found[data[0]] = made[kinds]
    return found


BY_ID = _packers()
