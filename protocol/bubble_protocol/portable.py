"""What MicroPython has and CPython lacks, so that one source runs on both.

On MicroPython the compiler itself knows `@micropython.viper`, `const` and the pointer casts; the names
here only have to exist. On CPython a viper function is an ordinary function and a pointer cast is a view
of the same memory, so it computes the same integers as long as nothing overflows 32 bits; storing an
overflow in an `array('i')` raises there, which is how the tests would find it.
"""

import gc

try:
    import micropython
    from micropython import const

    ptr8 = ptr16 = ptr32 = None

    def heap_free():
        """Free bytes of the garbage collected heap."""
        return gc.mem_free()  # type: ignore[attr-defined]

except ImportError:

    class micropython:  # type: ignore[no-redef]  # noqa: N801
        """The decorators that the device's compiler knows, as plain functions."""

        @staticmethod
        def viper(function):
            """Leave the function as it is."""
            return function

    def const(value):
        """Leave the value as it is."""
        return value

    def ptr8(buffer):
        """The buffer as unsigned bytes."""
        return buffer

    def ptr16(buffer):
        """The buffer as unsigned 16-bit words."""
        return memoryview(buffer).cast("B").cast("H")

    def ptr32(buffer):
        """An `array('i')` as signed 32-bit words."""
        return buffer

    def heap_free():
        """Free bytes of the heap: 0, CPython's heap has no fixed size."""
        return 0
