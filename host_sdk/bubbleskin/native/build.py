"""From LLVM's text, or numba's functions, to one piece of native code. Imported only to compile."""

from collections.abc import Mapping
from typing import Any

from llvmlite import binding as llvm

from bubbleskin.native import entry
from bubbleskin.native.assembly import Assembly, Signature


def native_code(made: Mapping[str, Any] | Assembly) -> bytes:
    """An object file with an entry for each function; their names after it. numba's functions have one signature each."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    whole = llvm.parse_assembly("")
    if isinstance(made, Assembly):
        signatures = made.functions
        whole.link_in(llvm.parse_assembly(made.text))
    else:
        from bubbleskin.native import optimized  # with numba

        signatures = {}
        for name, function in made.items():
            signatures[name], text = optimized.of(function)
            whole.link_in(_only(signatures[name].symbol, text))
    whole.link_in(llvm.parse_assembly(_entries(signatures)))
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
    if isinstance(made, Assembly):
        _optimize(whole, machine)
    else:
        _clean(whole, machine)
    _check(whole)
    return machine.emit_object(whole) + b"\n" + " ".join(signatures).encode()


def _entries(signatures: Mapping[str, Signature]) -> str:
    return "\n".join([entry.HEAD, *(entry.entry(name, signature) for name, signature in signatures.items())])


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
    machine = machine or llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine()
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, _builder(machine))


def _optimize(module: llvm.ModuleRef, machine: llvm.TargetMachine) -> None:
    """All that LLVM knows."""
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    builder = _builder(machine)
    builder.getModulePassManager().run(module, builder)


def _builder(machine: llvm.TargetMachine) -> llvm.PassBuilder:
    return llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
