"""From numba's functions to one piece of native code. Imported only to compile: numba comes with it."""

from collections.abc import Mapping
from typing import Any

from llvmlite import binding as llvm
from numba.core import types

from bubbleskin.native import entry

_RETURNS = {types.int64: "i64", types.float64: "double", types.none: ""}


def native_code(functions: Mapping[str, Any]) -> bytes:
    """An object file with an entry for each of these functions, which have one signature each; their names after it."""
    whole = llvm.parse_assembly("")
    entries = [entry.HEAD]
    for name, function in functions.items():
        ((signature, made),) = function.overloads.items()
        symbol = made.fndesc.llvm_func_name
        whole.link_in(_only(symbol, function.inspect_llvm(signature)))
        kinds = ["ptr" if isinstance(kind, types.CPointer) else _RETURNS[kind] for kind in signature]
        entries.append(entry.entry(name, symbol, kinds, _RETURNS[made.signature.return_type]))
    whole.link_in(llvm.parse_assembly("\n".join(entries)))
    for function in whole.functions:
        if not function.is_declaration and not function.name.startswith(entry.PREFIX):
            function.linkage = llvm.Linkage.internal
    machine = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        jit=True,
        codemodel="jitdefault",
    )
    _clean(whole, machine)
    _check(whole)
    return machine.emit_object(whole) + b"\n" + " ".join(functions).encode()


def _check(module: llvm.ModuleRef) -> None:
    """Raise RuntimeError where native code would need numba when it runs: LLVM ends the process that misses a symbol."""
    ours = ("numba_", "NRT_")
    missing = [
        function.name for function in module.functions if function.is_declaration and function.name.startswith(ours)
    ]
    if missing:
        raise RuntimeError(f"it needs {', '.join(missing)} of numba")


def _only(symbol: str, text: str) -> llvm.ModuleRef:
    """A module of the function `symbol` and what it calls: not numba's own ways in, which need numba when they run."""
    module = llvm.parse_assembly(text)
    for function in module.functions:
        if not function.is_declaration and function.name != symbol:
            function.linkage = llvm.Linkage.internal
    _clean(module, None)
    return module


def _clean(module: llvm.ModuleRef, machine: llvm.TargetMachine | None) -> None:
    """Take out what nobody calls."""
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    machine = machine or llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine()
    builder = llvm.create_pass_builder(machine, options)
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, builder)
