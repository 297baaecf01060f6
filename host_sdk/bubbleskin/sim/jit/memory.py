# mypy: disable-error-code="call-arg"
"""Memory as viper sees it: addresses are numbers, loads and stores have a width. Used by compiled code only."""

from typing import Any

from llvmlite import ir
from numba import njit
from numba.core import types
from numba.extending import intrinsic

_LOAD = types.int64(types.int64, types.int64)
_STORE = types.void(types.int64, types.int64, types.int64)


def _place(builder: Any, arguments: Any, bits: int) -> Any:
    return builder.gep(builder.inttoptr(arguments[0], ir.IntType(bits).as_pointer()), [arguments[1]])


def _load(bits: int, extend: str) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = builder.load(_place(builder, arguments, bits), align=1)  # a view may begin anywhere
        return getattr(builder, extend)(word, ir.IntType(64))

    return _LOAD, generate


def _store(bits: int) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(builder.trunc(arguments[2], ir.IntType(bits)), _place(builder, arguments, bits), align=1)
        return context.get_dummy_value()

    return _STORE, generate


@intrinsic
def load8(typing: Any, address: Any, index: Any) -> Any:
    """An unsigned byte."""
    return _load(8, "zext")


@intrinsic
def load16(typing: Any, address: Any, index: Any) -> Any:
    """An unsigned word of 16 bits."""
    return _load(16, "zext")


@intrinsic
def load32(typing: Any, address: Any, index: Any) -> Any:
    """A signed word of 32 bits."""
    return _load(32, "sext")


@intrinsic
def store8(typing: Any, address: Any, index: Any, value: Any) -> Any:
    """The lowest 8 bits."""
    return _store(8)


@intrinsic
def store16(typing: Any, address: Any, index: Any, value: Any) -> Any:
    """The lowest 16 bits."""
    return _store(16)


@intrinsic
def store32(typing: Any, address: Any, index: Any, value: Any) -> Any:
    """The lowest 32 bits."""
    return _store(32)


@intrinsic
def wrap(typing: Any, value: Any) -> Any:
    """The lowest 32 bits as a signed number: what a register of the chip holds."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.sext(builder.trunc(arguments[0], ir.IntType(32)), ir.IntType(64))

    return types.int64(types.int64), generate


@intrinsic
def _quotient(typing: Any, numerator: Any, denominator: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.sdiv(*arguments)

    return types.int64(types.int64, types.int64), generate


@njit
def floor_divide(numerator, denominator):  # type: ignore[no-untyped-def]
    """The quotient rounded down, as MicroPython's `mp_small_int_floor_divide` finds it: near the ends of 32 bits it wraps."""
    if denominator == 0:
        raise ZeroDivisionError("division by zero")
    if numerator >= 0:
        if denominator < 0:
            numerator = wrap(numerator - denominator - 1)
    elif denominator >= 0:
        numerator = wrap(numerator - denominator + 1)
    return _quotient(numerator, denominator)
