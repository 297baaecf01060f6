"""Viper to what numba compiles, and to Python that checks itself. Source in, source out; nothing is run here.

Viper, as far as the firmware uses it: whole numbers of 32 bits, `ptr8`, `ptr16`, `ptr32`, a pointer further on as
`ptr32(uint(pointer) + bytes)`, calls of other viper functions, constants of the module. In the compiled form a pointer is
its address, and every sum, difference, product and left shift is wrapped to 32 bits, as the chip's registers
do it; `//` is MicroPython's.
"""

import ast
import inspect
import textwrap
from collections.abc import Mapping
from types import CodeType, FunctionType

POINTERS = {"ptr8": 8, "ptr16": 16, "ptr32": 32}
_WRAPPED = (ast.Add, ast.Sub, ast.Mult, ast.LShift)


class NotViperError(Exception):
    """A function uses what viper, or this translation, does not know."""


def parsed(function: FunctionType) -> ast.FunctionDef:
    """The function's syntax tree, without decorators and docstring."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise NotViperError(f"{function.__name__} is no function")
    tree.decorator_list = []
    if ast.get_docstring(tree, clean=False) is not None:
        tree.body = tree.body[1:] or [ast.Pass()]
    return tree


def pointers(tree: ast.FunctionDef) -> dict[str, int]:
    """Bits of what each pointer points at, by its name; 0 for a parameter that is cast before it is used."""
    found: dict[str, int] = {}
    for argument in tree.args.args:
        kind = argument.annotation.id if isinstance(argument.annotation, ast.Name) else ""
        if kind in POINTERS:
            found[argument.arg] = POINTERS[kind]
        elif kind != "int":
            found[argument.arg] = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and _cast(node.value):
            found[node.targets[0].id] = _cast(node.value)
    return found


def _cast(node: ast.expr) -> int:
    """The bits of `ptrN(…)`; 0 where the expression is none."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return POINTERS.get(node.func.id, 0)
    return 0


class Compiled(ast.NodeTransformer):
    """One function for numba. `names` is its module's namespace, `functions` the viper functions in it."""

    def __init__(self, tree: ast.FunctionDef, names: Mapping[str, object], functions: Mapping[str, str]):
        self._names = names
        self._functions = functions
        self._pointers = pointers(tree)
        self._locals = {argument.arg for argument in tree.args.args}
        self._locals |= {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """The body; parameters without their annotations."""
        node.args = ast.arguments([], [ast.arg(a.arg) for a in node.args.args], None, [], [], None, [])
        node.returns = None
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """A constant of the module as a number."""
        if isinstance(node.ctx, ast.Store) or node.id in self._locals:
            return node
        value = self._names.get(node.id)
        if type(value) is not int:
            raise NotViperError(f"{node.id} is no whole number")
        return ast.Constant(value)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Casts vanish, calls of viper functions stay."""
        if not isinstance(node.func, ast.Name):
            raise NotViperError(f"a call of {ast.unparse(node.func)}")
        arguments = [self.visit(argument) for argument in node.args]
        if node.func.id in POINTERS or node.func.id in ("uint", "int"):
            return arguments[0]
        if node.func.id in self._functions:
            return ast.Call(ast.Name(self._functions[node.func.id], ast.Load()), arguments, [])
        raise NotViperError(f"a call of {node.func.id}")

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Wrapped where it can leave 32 bits; an address is none of the chip's numbers here."""
        address = any(self._is_address(side) for side in (node.left, node.right))
        if isinstance(node.op, ast.FloorDiv):
            return _call("floor_divide", self.visit(node.left), self.visit(node.right))
        if isinstance(node.op, ast.Div | ast.Pow | ast.MatMult):
            raise NotViperError(f"the operator of {ast.unparse(node)}")
        made = ast.BinOp(self.visit(node.left), node.op, self.visit(node.right))
        return made if address or not isinstance(node.op, _WRAPPED) else _call("wrap", made)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        """The negative of the least number is itself."""
        made = ast.UnaryOp(node.op, self.visit(node.operand))
        return _call("wrap", made) if isinstance(node.op, ast.USub) else made

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """A load."""
        return _call(f"load{self._bits(node)}", self.visit(node.value), self.visit(node.slice))

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        """A store, or a local; of a comparison a local is 0 or 1."""
        if len(node.targets) != 1:
            raise NotViperError("two targets of one assignment")
        value = self.visit(node.value)
        if isinstance(node.value, ast.Compare | ast.BoolOp) or (
            isinstance(node.value, ast.UnaryOp) and isinstance(node.value.op, ast.Not)
        ):
            value = _call("int", value)
        return self._assign(node.targets[0], value)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """As `target = target op value`."""
        load = ast.parse(ast.unparse(node.target), mode="eval").body
        return self._assign(node.target, self.visit(ast.BinOp(load, node.op, node.value)))

    def _assign(self, target: ast.expr, value: ast.expr) -> ast.AST:
        if isinstance(target, ast.Subscript):
            at = self.visit(target.slice)
            return ast.Expr(_call(f"store{self._bits(target)}", self.visit(target.value), at, value))
        if not isinstance(target, ast.Name):
            raise NotViperError(f"an assignment to {ast.unparse(target)}")
        return ast.Assign([target], value)

    def _bits(self, node: ast.Subscript) -> int:
        bits = self._pointers.get(node.value.id, 0) if isinstance(node.value, ast.Name) else _cast(node.value)
        if not bits:
            raise NotViperError(f"{ast.unparse(node.value)} is no pointer")
        return bits

    def _is_address(self, node: ast.expr) -> bool:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            return node.func.id == "uint" or bool(_cast(node))
        if isinstance(node, ast.BinOp):
            return self._is_address(node.left) or self._is_address(node.right)
        return isinstance(node, ast.Name) and node.id in self._pointers


class Checked(ast.NodeTransformer):
    """One function as Python in which every result goes through `_whole`."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Checked, operands first."""
        return _call("_whole", ast.BinOp(self.visit(node.left), node.op, self.visit(node.right)))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        """Likewise."""
        return _call("_whole", ast.UnaryOp(node.op, self.visit(node.operand)))

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """As `target = target op value`."""
        load = ast.parse(ast.unparse(node.target), mode="eval").body
        return ast.Assign([node.target], self.visit(ast.BinOp(load, node.op, node.value)))


def compiled_source(functions: Mapping[str, FunctionType], names: Mapping[str, object]) -> str:
    """A module for numba of all viper functions of one module, callees first: `NAME` is compiled under `_NAME`."""
    inner = {name: f"compiled_{name}" for name in functions}
    parts = {name: _one(function, names, inner) for name, function in functions.items()}
    head = "from numba import int64, njit, void\n\nfrom bubbleskin.sim.jit.memory import *\n"
    head = head.replace("*", "floor_divide, load8, load16, load32, store8, store16, store32, wrap")
    done: list[str] = []

    def put(name: str) -> None:
        for callee in parts[name][1]:
            if callee not in done and callee != name:
                put(callee)
        if name not in done:
            done.append(name)

    for name in parts:
        put(name)
    return head + "".join(f"\n\n{parts[name][0]}" for name in done)


def _one(function: FunctionType, names: Mapping[str, object], inner: Mapping[str, str]) -> tuple[str, list[str]]:
    tree = parsed(function)
    calls = [
        n.func.id
        for n in ast.walk(tree)
        if isinstance(n, ast.Call) and isinstance(n.func, ast.Name) and n.func.id in inner
    ]
    returns = any(isinstance(n, ast.Return) and n.value is not None for n in ast.walk(tree))
    kinds = ", ".join(["int64"] * len(tree.args.args))
    name = tree.name
    made = ast.fix_missing_locations(Compiled(tree, names, inner).visit(tree))
    made.name = inner[name]
    signature = f"{'int64' if returns else 'void'}({kinds})"
    return f"@njit({signature})\n{ast.unparse(made)}\n", calls


def checked_code(function: FunctionType) -> CodeType:
    """The function as code that passes every result through its keyword-only parameter `_whole`."""
    tree = Checked().visit(parsed(function))
    tree.args.kwonlyargs, tree.args.kw_defaults = [ast.arg("_whole")], [None]
    for argument in tree.args.args:
        argument.annotation = None
    tree.returns = None
    module = ast.fix_missing_locations(ast.Module([tree], []))
    ast.increment_lineno(module, function.__code__.co_firstlineno - 1)  # tracebacks and coverage see the source
    names: dict[str, FunctionType] = {}
    exec(compile(module, function.__code__.co_filename, "exec"), names)
    return names[function.__name__].__code__


def _call(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])
