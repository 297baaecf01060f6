"""Viper as syntax trees, and as Python that checks itself. Nothing is run here.

Viper, as far as the firmware uses it: whole numbers of 32 bits, `ptr8`, `ptr16`, `ptr32`, a pointer further on as
`ptr32(uint(pointer) + bytes)`, calls of other viper functions, constants of the module.
"""

import ast
import inspect
import textwrap
from types import CodeType, FunctionType

POINTERS = {"ptr8": 8, "ptr16": 16, "ptr32": 32}


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
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and cast(node.value):
            found[node.targets[0].id] = cast(node.value)
    return found


def cast(node: ast.expr) -> int:
    """The bits of `ptrN(…)`; 0 where the expression is none."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return POINTERS.get(node.func.id, 0)
    return 0


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
