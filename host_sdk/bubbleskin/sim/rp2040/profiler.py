"""Where an emulated chip spends its cycles: every instruction is counted for the function that runs it and for its callers.

Callers are those in bytecode, which MicroPython runs one inside the other, each in a call of `mp_execute_bytecode`. Below the
innermost stands whatever it has called: viper, C, or the interpreter itself. An interrupt stands alone.
"""

import ast
from bisect import bisect_right
from collections import Counter
from pathlib import Path
from types import TracebackType
from typing import Self

from bubbleskin.sim.rp2040.chip import CLOCK_HZ, Chip
from bubbleskin.toolchain.frozen import device_files

INTERRUPT = "interrupts"
_CYCLE_NS = 1e9 / CLOCK_HZ
_INTERPRETER = "mp_execute_bytecode"
_BYTECODE_AT = 12  # of a bytecode function: base, context and children stand before it (py/objfun.h)
_R0, _SP, _LR = 0, 13, 14
_FROZEN = "fun_data_"
"""How `mpy-tool.py` begins the name of a frozen function: then come its module, and its name or, in viper, its file's."""

Stack = tuple[str, ...]
"""Functions, the outermost first."""


class Profiler:
    """Counts the cycles of `chip` for as long as the `with` lasts; `symbols` is the file of names beside its UF2.

    `cycles`: by stack. `calls`: of functions in bytecode. `seconds`: of emulated time, asleep or not.
    """

    def __init__(self, chip: Chip, symbols: Path, board: str):
        self.cycles: Counter[Stack] = Counter()
        self.calls: Counter[str] = Counter()
        self.seconds = 0.0
        self._chip = chip
        self._places, self._names = _symbols(symbols, board)
        self._interpreter = self._places[self._names.index(_INTERPRETER)]
        self._by_address: dict[int, str] = {}
        self._stack: list[tuple[int, int, str]] = []  # stack pointer, where it returns to, name

    def __enter__(self) -> Self:
        self._execute = self._chip.execute
        self._chip.execute = self._count
        self._begun = self._chip.time
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._chip.execute = self._execute
        self.seconds += self._chip.time - self._begun

    def _name(self, address: int) -> str:
        name = self._by_address.get(address)
        if name is None:
            name = self._by_address[address] = self._names[bisect_right(self._places, address) - 1]
        return name

    def _entered(self) -> str:
        """The function in bytecode that begins here: of the code state that `mp_execute_bytecode` is given."""
        read = self._chip.mcu.read_uint32
        return self._name(read(read(self._chip.mcu.core.registers[_R0]) + _BYTECODE_AT))

    def _count(self, simulator: object) -> None:
        """What `execute_batch` does, instruction by instruction."""
        mcu = self._chip.mcu
        core, clock, machines = mcu.core, mcu.clock, mcu.pio
        registers = core.registers
        execute = core.execute_instruction
        stack = self._stack
        names = tuple(name for *_, name in stack)
        while not simulator.stopped:  # type: ignore[attr-defined]
            if core.waiting:
                asleep = clock.nanos_to_next_alarm
                clock.tick(asleep)
                cycles = int(asleep / _CYCLE_NS) or 1
            else:
                address = core.pc
                interrupted = core.ipsr != 0
                if not interrupted:
                    depth = registers[_SP]
                    # Returned: an exception, too, leaves a stack that is less deep.
                    while stack and (stack[-1][0] < depth or (stack[-1][1] == address and stack[-1][0] == depth)):
                        stack.pop()
                        names = names[:-1]
                    if address == self._interpreter:
                        name = self._entered()
                        stack.append((depth, registers[_LR] & ~1, name))
                        names = (*names, name)
                        self.calls[name] += 1
                cycles = execute()
                clock.tick(cycles * _CYCLE_NS)
                self.cycles[(INTERRUPT,) if interrupted else (*names, self._name(address))] += cycles
            for machine in machines:
                if not machine.stopped:
                    machine.advance(cycles)


def _symbols(path: Path, board: str) -> tuple[list[int], list[str]]:
    """Addresses and names of functions, in order; frozen ones by their module and their name there."""
    frozen = _frozen(board)
    places, names = [], []
    for line in path.read_text(encoding="utf-8").splitlines():
        place, _, name = line.split()
        if name.startswith(_FROZEN):
            name = frozen.get(name.removeprefix(_FROZEN), name.removeprefix(_FROZEN))
        places.append(int(place, 16) & ~1)  # the lowest bit says Thumb
        names.append(name)
    return places, names


def _frozen(board: str) -> dict[str, str]:
    """`module: function` by what the function is called in the UF2."""
    found = {}
    for name, source in device_files(board).items():
        module = name.removesuffix(".py").removesuffix("/__init__").replace("/", "_")
        file = name.replace("/", "_slash_").replace(".", "_dot_")
        short = name.removesuffix(".py").split("/", 1)[1]
        tree = ast.parse(source)
        found[f"{module}__lt_module_gt_"] = f"{short}: <module>"
        vipers = 0
        for qualified, viper in _functions(tree, ""):
            if viper:
                vipers += 1
                found[f"{module}_{file}{vipers if vipers > 1 else ''}"] = f"{short}: {qualified}"
            else:
                found[f"{module}_{qualified.replace('.', '_')}"] = f"{short}: {qualified}"
    return found


def _functions(node: ast.AST, within: str) -> list[tuple[str, bool]]:
    """Every function below `node`, in order: its qualified name, and whether it is viper."""
    found = []
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            name = f"{within}{child.name}"
            if isinstance(child, ast.FunctionDef):
                viper = any(isinstance(mark, ast.Attribute) and mark.attr == "viper" for mark in child.decorator_list)
                found.append((name, viper))
            found += _functions(child, f"{name}.")
        else:
            found += _functions(child, within)
    return found
