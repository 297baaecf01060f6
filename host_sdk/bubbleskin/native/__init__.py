"""Functions that are compiled, without waiting for numba where they are compiled already or need none.

`load` keeps native code in the cache folder: what numba has made, or LLVM of an `Assembly`. `njit` is numba's, but imports it
only when a function is called; `resolve` is for who uses numba itself.
"""

from bubbleskin.native.assembly import Assembly, Signature
from bubbleskin.native.later import njit, resolve
from bubbleskin.native.said import UNKEPT, expect_compiling, say_once
from bubbleskin.native.store import load

__all__ = ["UNKEPT", "Assembly", "Signature", "expect_compiling", "load", "njit", "resolve", "say_once"]
