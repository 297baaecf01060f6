"""Puts compiled code into the viper functions of this process, in place: whoever holds a function has the fast one.

A module's functions are compiled when one of them is called for the first time, and kept by `bubbleskin.native`, so that no
unchanged source is compiled twice. Where nothing can be compiled or kept, the functions stay the plain Python that they
are.
"""

import ctypes
import os
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from bubble_protocol import mpy_compat
from bubbleskin import native
from bubbleskin.errors import InvalidInput
from bubbleskin.sim.jit import assemble, translate

SWITCH = "BUBBLESKIN_JIT"
MODES = ("1", "0", "check")

_lock = threading.RLock()
functions_of: dict[str, dict[str, FunctionType]] = {}  # as they are written, by module and name
_held: dict[str, dict[str, FunctionType]] = {}  # what callers hold
_plain: dict[tuple[str, str], tuple[CodeType, dict[str, Any] | None]] = {}
_TRANSLATION = ("translate.py", "assemble.py")


def enable() -> None:
    """Compile viper functions from now on, as `BUBBLESKIN_JIT` says; those that have been defined already, too."""
    mode = os.environ.get(SWITCH) or "1"
    if mode not in MODES:
        raise InvalidInput(f"{SWITCH} is {mode!r}: it may be 1 (compiled), 0 (plain Python) or check (plain, checked).")
    if mode == "0" or mpy_compat.on_viper:
        return
    install = _check if mode == "check" else _await
    mpy_compat.on_viper = install
    for held, function in mpy_compat.VIPER:
        install(held, function)


def waiting() -> list[str]:
    """The modules whose functions are compiled when one of them is called."""
    return sorted(_held)


def compile_module(module: str) -> None:
    """Compile the functions of a module now, or load what was compiled before."""
    _compile(module)


def _check(held: FunctionType, function: FunctionType) -> None:
    function.__code__ = translate.checked_code(function)
    function.__kwdefaults__ = {"_whole": whole}


def whole(value: Any) -> Any:
    """The value, if it is within 32 bits."""
    if type(value) is int and not -0x80000000 <= value <= 0x7FFFFFFF:
        raise OverflowError(f"{value} is beyond 32 bits: on the chip it would be another number")
    return value


def _await(held: FunctionType, function: FunctionType) -> None:
    """Let the first call of this function compile its module."""
    module, name = function.__module__, function.__name__
    if module.startswith("bubble_firmware.drivers."):
        return  # they read and write the chip's registers, for which tests give them what is no memory
    written = FunctionType(function.__code__, function.__globals__, name)  # the code is about to be another
    written.__annotations__ = function.__annotations__
    functions_of.setdefault(module, {})[name] = written
    _held.setdefault(module, {})[name] = held
    _plain[module, name] = held.__code__, held.__kwdefaults__

    def first(*arguments, _held, _compile):  # type: ignore[no-untyped-def]
        _compile()
        return _held(*arguments)

    held.__code__ = first.__code__
    held.__kwdefaults__ = {"_held": held, "_compile": lambda: _compile(module)}


def _compile(module: str) -> None:
    with _lock:
        waiting = _held.pop(module, {})
        made = _made(module, functions_of[module]) if waiting else None  # else another thread has been faster
        for name, held in waiting.items():
            if made is None:
                held.__code__, held.__kwdefaults__ = _plain[module, name]
            else:
                _fill(held, functions_of[module][name], made[name])


def _made(module: str, functions: dict[str, FunctionType]) -> dict[str, Callable[..., Any]] | None:
    """The compiled functions, or None where there can be none: said once."""
    names = vars(sys.modules[module])
    try:
        return native.load(
            module.rpartition(".")[2],
            _made_of(module, names),
            lambda: assemble.assembly(functions, names),
            unkept=False,
        )
    except (translate.NotViperError, OSError, ImportError, RuntimeError) as problem:
        reason = getattr(problem, "strerror", None) or problem  # without names that differ from module to module
        native.say_once(
            f"The simulated firmware runs as plain Python, some times slower: nothing can be compiled: {reason}."
        )
        return None


def _made_of(module: str, names: Mapping[str, Any]) -> bytes:
    """What the compiled functions of a module depend on: its source, its constants, and the translation."""
    files = [Path(sys.modules[module].__file__ or ""), *(Path(__file__).with_name(f) for f in _TRANSLATION)]
    constants = sorted((name, value) for name, value in names.items() if type(value) is int)
    return b"".join(file.read_bytes() for file in files) + repr(constants).encode()


def _fill(held: FunctionType, function: FunctionType, compiled: Callable[..., Any]) -> None:
    """Let `held` call `compiled` with addresses in place of buffers.

    The address of the buffer that each parameter had last is remembered: in a tick they are always the same.
    """
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    places = [name for name in names if function.__annotations__.get(name) is not int]
    memo: list[Any] = []
    lines, given = [], []
    for name in names:
        if name in places:
            at = len(memo)
            memo += [None, 0, None]  # the buffer, its address, what keeps it where it is
            lines.append(f"    if {name} is not _memo[{at}]:\n        locate(_memo, {at}, {name})\n")
            given.append(f"_memo[{at + 1}]")
        else:
            given.append(name)
    source = f"def called({', '.join(names)}, *, _call, _memo, locate):\n{''.join(lines)}    return _call({', '.join(given)})\n"
    space: dict[str, Any] = {}
    exec(source, space)
    held.__code__ = space["called"].__code__
    held.__kwdefaults__ = {"_call": compiled, "_memo": memo, "locate": locate}


_NOTHING = ctypes.c_char * 0


def locate(memo: list[Any], at: int, buffer: Any) -> None:
    """Remember where `buffer` is. The hold on it makes Python refuse to move it."""
    if isinstance(buffer, bytes):
        hold: Any = ctypes.c_char_p(buffer)
        address = ctypes.cast(hold, ctypes.c_void_p).value or 0
    else:
        hold = _NOTHING.from_buffer(buffer)
        address = ctypes.addressof(hold)
    memo[at : at + 3] = buffer, address, hold
