"""What numba has made of a function, as LLVM's text. Imported only to compile: numba comes with it."""

from typing import Any

from numba.core import types

from bubbleskin.native.assembly import Signature

_RETURNS = {types.int64: "i64", types.float64: "double", types.none: ""}


def of(function: Any) -> tuple[Signature, str]:
    """How a function of numba's is called, and its module. It has one signature, of int64, float64 and pointers."""
    ((signature, made),) = function.overloads.items()
    kinds = ["ptr" if isinstance(kind, types.CPointer) else _RETURNS[kind] for kind in signature]
    called = Signature(made.fndesc.llvm_func_name, kinds, _RETURNS[made.signature.return_type])
    return called, function.inspect_llvm(signature)
