"""Native code in the cache folder, by what it is made of: compiled once, then loaded by llvmlite alone, in milliseconds.

numba itself takes most of a second to import and to look through its registries, and scipy's linear algebra with it.
"""

import ctypes
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import platformdirs
from llvmlite import binding as llvm

from bubbleskin.native.assembly import Assembly
from bubbleskin.native.entry import OBJECTS, PREFIX
from bubbleskin.native.said import say_compiling, say_unkept

_loaded: list[Any] = []  # engines and method tables: the functions live in them


def load(
    name: str, made_of: bytes, make: Callable[[], Mapping[str, Any] | Assembly], *, unkept: bool = True
) -> dict[str, Callable[..., Any]]:
    """The functions that `make` gives, by name, as native code.

    `make` returns numba functions, each compiled for one signature of int64, float64 and pointers, or LLVM's text of some.
    It is called where the cache folder has nothing that was made of the same: `made_of` is all of the source. The versions of
    Python, numba and llvmlite and the processor are added to it. A pointer is given as an address. The functions raise
    ZeroDivisionError, and TypeError for what is no number. Two processes may do this at once.

    Where nothing can be kept, every start compiles and says so, or, if not `unkept`, OSError is raised.
    """
    path = Path(platformdirs.user_cache_dir("bubbleskin")) / "native" / f"{name}-{_key(made_of)}.o"
    code = _read(path)
    if code is None:
        kept = _room(path.parent, unkept)
        say_compiling()
        from bubbleskin.native.build import native_code

        code = native_code(make())
        if kept:
            _keep(code, path)
    return _functions(code)


def _keep(code: bytes, path: Path) -> None:
    """Write the file whole, whoever else does the same; where that fails, such as on a full disk, do without."""
    try:
        handle, file = tempfile.mkstemp(dir=path.parent, suffix=".new")
    except OSError as error:
        return say_unkept(str(path.parent), error)
    try:
        with os.fdopen(handle, "wb") as new:
            new.write(_digest(code) + b"\n" + code)
        Path(file).replace(path)
    except OSError as error:
        Path(file).unlink(missing_ok=True)
        say_unkept(str(path.parent), error)


def _room(folder: Path, unkept: bool) -> bool:
    """Whether files can be made in `folder`, which is made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        if not unkept:
            raise
        say_unkept(str(folder), error)
        return False
    return True


def _key(made_of: bytes) -> str:
    machine = (llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    here = Path(__file__).parent
    ours = b"".join((here / name).read_bytes() for name in ("build.py", "entry.py", "optimized.py"))
    versions = (sys.version, version("numba"), version("llvmlite"))
    return hashlib.sha256(repr((made_of, ours, versions, machine)).encode()).hexdigest()[:24]


def _read(path: Path) -> bytes | None:
    """The native code in a file, if it is whole: LLVM ends the process where it is not."""
    try:
        digest, code = path.read_bytes().split(b"\n", 1)
    except (OSError, ValueError):
        return None
    return code if digest == _digest(code) else None


def _digest(code: bytes) -> bytes:
    return hashlib.sha256(code).hexdigest().encode()


class _Method(ctypes.Structure):
    """`PyMethodDef` of Python's C interface."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


_FASTCALL = 0x80  # METH_FASTCALL: an array of objects and their number


def _functions(code: bytes) -> dict[str, Callable[..., Any]]:
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.restype, new.argtypes = ctypes.py_object, [ctypes.POINTER(_Method), ctypes.c_void_p, ctypes.c_void_p]
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    for symbol, thing in OBJECTS.items():
        llvm.add_symbol(symbol, id(thing))
    machine = llvm.Target.from_default_triple().create_target_machine(jit=True, codemodel="jitdefault")
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    file = llvm.ObjectFileRef.from_data(code)
    engine.add_object_file(file)
    engine.finalize_object()
    names, methods = code.rpartition(b"\n")[2].decode().split(), []
    functions = {}
    for name in names:
        address = engine.get_function_address(PREFIX + name)
        method = _Method(name.encode(), address, _FASTCALL, None)
        functions[name] = new(ctypes.byref(method), None, None)
        methods.append(method)
    _loaded.append((engine, file, methods))
    return functions
