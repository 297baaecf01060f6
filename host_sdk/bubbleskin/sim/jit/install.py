"""Puts compiled code into the viper functions of this process, in place: whoever holds a function has the fast one.

A module's functions are compiled when one of them is called for the first time. What numba makes is kept in the cache
folder, by what it is made of, so that no unchanged source is compiled twice. Where nothing can be compiled or kept, the
functions stay the plain Python that they are.
"""

import ctypes
import hashlib
import importlib.util
import os
import sys
import tempfile
import threading
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import platformdirs

from bubble_protocol import mpy_compat
from bubbleskin.errors import InvalidInput
from bubbleskin.sim.jit import translate

SWITCH = "BUBBLESKIN_JIT"
MODES = ("1", "0", "check")

_lock = threading.RLock()
functions_of: dict[str, dict[str, FunctionType]] = {}  # as they are written, by module and name
_held: dict[str, dict[str, FunctionType]] = {}  # what callers hold
_plain: dict[tuple[str, str], tuple[CodeType, dict[str, Any] | None]] = {}
_said: set[str] = set()


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
    written = FunctionType(function.__code__, function.__globals__, name)  # the code is about to be another
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
                _fill(held, functions_of[module][name], getattr(made, f"compiled_{name}"))


def _made(module: str, functions: dict[str, FunctionType]) -> ModuleType | None:
    """The module of compiled functions, or None where there can be none: said once."""
    try:
        source = translate.compiled_source(functions, vars(sys.modules[module]))
        return _load(module.rpartition(".")[2], source)
    except (translate.NotViperError, OSError, ImportError, RuntimeError) as problem:
        _say_once(
            f"The simulated firmware runs as plain Python, some times slower: {module} cannot be compiled: {problem}."
        )
        return None


def _load(name: str, source: str) -> ModuleType:
    """The module with this source, from the cache folder; numba keeps there what it makes of it."""
    memory = Path(translate.__file__).with_name("memory.py").read_bytes()
    made_of = source.encode() + memory + version("numba").encode() + sys.version.encode()
    name = f"{name}_{hashlib.sha256(made_of).hexdigest()[:16]}"
    path = Path(platformdirs.user_cache_dir("bubbleskin")) / "viper" / f"{name}.py"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        _say_once("Compiling the firmware for this computer, once: up to 20 s.")
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".new")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(source)
        Path(temporary).replace(path)  # two processes may do this at once
    spec = importlib.util.spec_from_file_location(f"bubbleskin_viper_{name}", path)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[made.__name__] = made  # numba finds what it has kept by the name
    spec.loader.exec_module(made)
    return made


def _say_once(sentence: str) -> None:
    if sentence.split(":")[0] not in _said:
        _said.add(sentence.split(":")[0])
        print(sentence, file=sys.stderr, flush=True)


def _fill(held: FunctionType, function: FunctionType, compiled: Callable[..., Any]) -> None:
    """Let `held` call `compiled` with addresses in place of buffers.

    The address of the buffer that each parameter had last is remembered: in a tick they are always the same.
    """
    tree = translate.parsed(function)
    places = translate.pointers(tree)
    names = [argument.arg for argument in tree.args.args]
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
