"""What MicroPython has and CPython lacks, so that one source runs on both.

On MicroPython the compiler itself knows `@micropython.viper`, `const` and the pointer casts; the names
here only have to exist. On CPython a viper function is an ordinary function and a pointer cast is a view
of the same memory, so it computes the same integers as long as nothing overflows 32 bits; storing an
overflow in an `array('i')` raises there, which is how the tests would find it.

MicroPython has no `typing` either. It compiles annotations of functions away without looking at them, so device files
have them like any others; a name that only they need is imported under `TYPE_CHECKING`, and then stands in quotes.
"""

import gc
from array import array

TYPE_CHECKING = False  # as in `typing`: a type checker takes it for true

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FunctionType
    from typing import Any

    Buffer = bytes | bytearray | memoryview
    Words = array[int] | memoryview[int]

try:
    import micropython
    from micropython import const

    ptr8 = ptr16 = ptr32 = uint = None
    COMPILED = True

    def heap_free() -> int:
        """Free bytes of the garbage collected heap."""
        return gc.mem_free()  # type: ignore[attr-defined]

    def collect() -> None:
        """Free what nobody holds."""
        gc.collect()

except ImportError:
    COMPILED = False
    VIPER: "list[tuple[FunctionType, FunctionType]]" = []
    """Every viper function so far: (what callers hold, the function as it is written)."""
    on_viper: "Callable[[FunctionType, FunctionType], None] | None" = None
    """Called with every further one, where somebody compiles them."""

    class micropython:  # type: ignore[no-redef]  # noqa: N801
        """The decorators that the device's compiler knows, as plain functions."""

        @staticmethod
        def viper(function: "FunctionType") -> "FunctionType":
            """Leave the function as it is, but for casting the arguments that are annotated as pointers to half words."""
            code = function.__code__
            casts = []
            for name in code.co_varnames[: code.co_argcount]:
                kind = function.__annotations__.get(name)
                casts.append(kind if kind is ptr16 else None)  # the others leave a buffer as it is
            held = function
            if any(casts):

                def held(*arguments: "Any", _function: "Any" = function, _casts: "Any" = casts) -> "Any":  # type: ignore[misc]
                    return _function(*[cast(a) if cast else a for cast, a in zip(_casts, arguments, strict=True)])

            VIPER.append((held, function))
            if on_viper:
                on_viper(held, function)
            return held

    def const(value: int) -> int:
        """Leave the value as it is."""
        return value

    def ptr8(buffer: "Any") -> "Any":
        """The buffer as unsigned bytes."""
        return buffer

    def ptr16(buffer: "Any") -> "Any":
        """The buffer as unsigned 16-bit words."""
        return memoryview(buffer).cast("B").cast("H")

    def ptr32(buffer: "Any") -> "Any":
        """An `array('i')`, or a pointer further on in one, as signed 32-bit words."""
        return buffer

    class _Address:
        """A pointer as a number, good for adding bytes to: that is the pointer further on."""

        __slots__ = ("words",)

        def __init__(self, words: "Words"):
            self.words = words

        def __add__(self, size: int) -> memoryview:
            words = self.words
            return (memoryview(words) if isinstance(words, array) else words)[size >> 2 :]

    def uint(pointer: "Words") -> _Address:
        """The address in a pointer."""
        return _Address(pointer)

    def heap_free() -> int:
        """Free bytes of the heap: 0, CPython's heap has no fixed size."""
        return 0

    def collect() -> None:
        """Nothing: CPython frees by itself, and a look at all objects of a large program takes 0.2 s."""
