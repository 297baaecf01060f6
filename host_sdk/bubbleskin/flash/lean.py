"""The firmware's data without what only people read: on a stock MicroPython our code and its strings are on the heap.

A UF2 has them in flash, where they cost no memory. As files the schema's texts, and names that nothing on the board
asks for, take as much heap as the state of nineteen bubbles: where a number stands in a row is a name for every number,
and the functions that use it have its value.
"""

import ast
from collections.abc import Iterator


def lean(sources: dict[str, bytes]) -> dict[str, bytes]:
    """All `sources`, by path; modules that are nothing but data without texts and unused names.

    A text is a string with a space: names of messages and fields, of which the schema's CRC is taken, have none. A
    name is used where it occurs in any of the sources, whatever module it is meant to be from.
    """
    trees = {path: ast.parse(source) for path, source in sources.items()}
    data = {path: tree for path, tree in trees.items() if _is_data(tree)}
    code = [tree for path, tree in trees.items() if path not in data]
    for tree in data.values():
        tree.body = [part for statement in tree.body for part in _apart(statement)]
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                node.value = ""
    asked = {name for tree in code for name in [*_loads(tree), *_imports(tree)]}
    while True:
        used = asked | {name for tree in data.values() for name in _loads(tree)}
        before = sum(len(tree.body) for tree in data.values())
        for tree in data.values():
            tree.body = [statement for statement in tree.body if _is_used(statement, used)]
        if sum(len(tree.body) for tree in data.values()) == before:
            break
    return {path: ast.unparse(data[path]).encode() if path in data else source for path, source in sources.items()}


def _is_data(tree: ast.Module) -> bool:
    return all(isinstance(node, ast.Assign | ast.ImportFrom) or _is_text(node) for node in tree.body)


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _apart(node: ast.stmt) -> Iterator[ast.stmt]:
    """A statement as several of one name each: `A, B = 1, 2`, `A, B = range(2)`, `from x import A, B`."""
    if isinstance(node, ast.ImportFrom):
        for alias in node.names:
            yield ast.ImportFrom(node.module, [alias], node.level)
    elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple):
        for target, value in zip(node.targets[0].elts, _values(node.value), strict=True):
            yield ast.Assign([target], value, lineno=node.lineno)
    elif not _is_text(node):
        yield node


def _values(node: ast.expr) -> list[ast.expr]:
    if isinstance(node, ast.Tuple):
        return node.elts
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    assert node.func.id == "range"
    return [ast.Constant(number) for number in range(*map(ast.literal_eval, node.args))]


def _loads(tree: ast.Module) -> Iterator[str]:
    """Every name that is read, and every attribute."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            yield node.id


def _imports(tree: ast.Module) -> Iterator[str]:
    """Every name that is imported from a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from (alias.name for alias in node.names)


def _is_used(node: ast.stmt, used: set[str]) -> bool:
    if isinstance(node, ast.ImportFrom):
        return any(name in used | {"*"} for alias in node.names for name in (alias.name, alias.asname))
    assert isinstance(node, ast.Assign)
    return any(isinstance(target, ast.Name) and target.id in used for target in node.targets)
