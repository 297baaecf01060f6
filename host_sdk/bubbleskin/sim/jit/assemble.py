"""Viper to LLVM's text. Syntax trees in, text out; nothing is run here.

Every value is a whole number of 64 bits, a truth 0 or 1. A pointer is its address. Every sum, difference, product and left
shift is wrapped to 32 bits, as the chip's registers do it; `//` is MicroPython's. Each local has a place on the stack, which
LLVM turns into registers. A function gets, as `bubbleskin.native.entry` calls it, places for its result and for an exception
before its parameters, and returns 1 where it divided by zero.
"""

import ast
from collections.abc import Mapping
from types import FunctionType

from bubbleskin.native import Assembly, Signature
from bubbleskin.sim.jit.translate import POINTERS, NotViperError, cast, parsed, pointers

_WRAPPED = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.LShift: "shl"}
_WHOLE = {ast.BitAnd: "and", ast.BitOr: "or", ast.BitXor: "xor", ast.RShift: "ashr"}
_DIVIDED = {ast.FloorDiv: "floor_divide", ast.Mod: "modulo"}
_COMPARED = {ast.Lt: "slt", ast.LtE: "sle", ast.Gt: "sgt", ast.GtE: "sge", ast.Eq: "eq", ast.NotEq: "ne"}

_HEAD = """\
define internal i64 @wrap(i64 %value) alwaysinline {
  %word = trunc i64 %value to i32
  %whole = sext i32 %word to i64
  ret i64 %whole
}
; The quotient rounded down, as MicroPython's `mp_small_int_floor_divide` finds it: near the ends of 32 bits it wraps.
define internal i64 @floor_divide(i64 %numerator, i64 %denominator) alwaysinline {
  %positive = icmp sge i64 %numerator, 0
  %turned = icmp slt i64 %denominator, 0
  %apart = sub i64 %numerator, %denominator
  %below = sub i64 %apart, 1
  %above = add i64 %apart, 1
  %low = call i64 @wrap(i64 %below)
  %high = call i64 @wrap(i64 %above)
  %up = select i1 %turned, i64 %low, i64 %numerator
  %down = select i1 %turned, i64 %numerator, i64 %high
  %dividend = select i1 %positive, i64 %up, i64 %down
  %quotient = sdiv i64 %dividend, %denominator
  ret i64 %quotient
}
; What is left, with the sign of the denominator.
define internal i64 @modulo(i64 %numerator, i64 %denominator) alwaysinline {
  %rest = srem i64 %numerator, %denominator
  %signs = xor i64 %rest, %denominator
  %apart = icmp slt i64 %signs, 0
  %some = icmp ne i64 %rest, 0
  %other = and i1 %apart, %some
  %moved = add i64 %rest, %denominator
  %result = select i1 %other, i64 %moved, i64 %rest
  ret i64 %result
}
"""


def assembly(functions: Mapping[str, FunctionType], names: Mapping[str, object]) -> Assembly:
    """All viper functions of one module, by name; `names` is the module's namespace."""
    trees = {name: parsed(function) for name, function in functions.items()}
    signatures = {
        name: Signature(_symbol(name), ["i64"] * len(tree.args.args), "i64" if _returns(tree) else "")
        for name, tree in trees.items()
    }
    return Assembly(_HEAD + "".join(_Body(tree, names, signatures).text() for tree in trees.values()), signatures)


def _symbol(name: str) -> str:
    return f"viper_{name}"


def _returns(tree: ast.FunctionDef) -> bool:
    return any(isinstance(node, ast.Return) and node.value is not None for node in ast.walk(tree))


class _Body:
    """One function. Each method for a kind of expression returns the number that it leads to, as LLVM names it."""

    def __init__(self, tree: ast.FunctionDef, names: Mapping[str, object], signatures: Mapping[str, Signature]):
        self._tree = tree
        self._names = names
        self._signatures = signatures
        self._pointers = pointers(tree)
        self._parameters = [argument.arg for argument in tree.args.args]
        stored = [n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
        self._locals = dict.fromkeys([*self._parameters, *stored])
        self._lines: list[str] = []
        self._places: list[str] = []  # on the stack, beside the locals
        self._ends: list[tuple[str, str]] = []  # of the loops around: where `continue` goes, where `break` goes
        self._count = 0

    def text(self) -> str:
        """The function in LLVM's text."""
        self._do(self._tree.body)
        self._put("br label %done")
        parameters = "".join(f", i64 %given_{name}" for name in self._parameters)
        head = [f"  %local_{name} = alloca i64" for name in self._locals]
        head += [f"  {place} = alloca i64" for place in self._places]
        head += [f"  store i64 0, ptr %local_{name}" for name in self._locals if name not in self._parameters]
        head += [f"  store i64 %given_{name}, ptr %local_{name}" for name in self._parameters]
        return "\n".join(
            [
                f"define i32 @{_symbol(self._tree.name)}(ptr %result, ptr %reason{parameters}) {{",
                *head,
                *self._lines,
                "done:",
                "  ret i32 0",
                "divided_by_zero:",
                "  ret i32 1",
                "}",
                "",
            ]
        )

    # The text.

    def _put(self, line: str) -> None:
        self._lines.append(f"  {line}")

    def _new(self, line: str) -> str:
        """A number made by `line`."""
        self._count += 1
        self._put(f"%n{self._count} = {line}")
        return f"%n{self._count}"

    def _labels(self, *names: str) -> list[str]:
        self._count += 1
        return [f"{name}{self._count}" for name in names]

    def _place(self) -> str:
        self._count += 1
        self._places.append(f"%place{self._count}")
        return self._places[-1]

    def _begin(self, label: str) -> None:
        """From here on is what `label` names; whatever stands before goes on with it too."""
        self._put(f"br label %{label}")
        self._lines.append(f"{label}:")

    def _leave(self, line: str) -> None:
        """Go elsewhere; what follows is reached by nobody, and needs a name."""
        self._put(line)
        self._lines.extend(f"{label}:" for label in self._labels("unreached"))

    # Statements.

    def _do(self, body: list[ast.stmt]) -> None:
        for statement in body:
            kind = type(statement).__name__
            act = getattr(self, f"_do_{kind}", None)
            if act is None:
                raise NotViperError(f"the statement {ast.unparse(statement).splitlines()[0]}")
            act(statement)

    def _do_Pass(self, node: ast.Pass) -> None:
        pass

    def _do_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._called(node.value)
        else:
            self._of(node.value)

    def _do_Assign(self, node: ast.Assign) -> None:
        if len(node.targets) != 1:
            raise NotViperError("two targets of one assignment")
        self._assign(node.targets[0], self._of(node.value))

    def _do_AugAssign(self, node: ast.AugAssign) -> None:
        load = ast.parse(ast.unparse(node.target), mode="eval").body
        self._assign(node.target, self._of(ast.BinOp(load, node.op, node.value)))

    def _assign(self, target: ast.expr, value: str) -> None:
        if isinstance(target, ast.Name):
            self._put(f"store i64 {value}, ptr %local_{target.id}")
        elif isinstance(target, ast.Subscript):
            bits, place = self._element(target)
            word = self._new(f"trunc i64 {value} to i{bits}")
            self._put(f"store i{bits} {word}, ptr {place}, align 1")
        else:
            raise NotViperError(f"an assignment to {ast.unparse(target)}")

    def _do_If(self, node: ast.If) -> None:
        then, other, after = self._labels("then", "else", "after")
        self._branch(node.test, then, other)
        self._lines.append(f"{then}:")
        self._do(node.body)
        self._put(f"br label %{after}")
        self._lines.append(f"{other}:")
        self._do(node.orelse)
        self._begin(after)

    def _do_While(self, node: ast.While) -> None:
        if node.orelse:
            raise NotViperError("an else of a while")
        test, body, after = self._labels("while", "do", "after")
        self._begin(test)
        self._branch(node.test, body, after)
        self._lines.append(f"{body}:")
        self._ends.append((test, after))
        self._do(node.body)
        self._ends.pop()
        self._put(f"br label %{test}")
        self._lines.append(f"{after}:")

    def _do_Break(self, node: ast.Break) -> None:
        self._leave(f"br label %{self._ends[-1][1]}")

    def _do_Continue(self, node: ast.Continue) -> None:
        self._leave(f"br label %{self._ends[-1][0]}")

    def _do_Return(self, node: ast.Return) -> None:
        if node.value is not None:
            self._put(f"store i64 {self._of(node.value)}, ptr %result")
        self._leave("br label %done")

    def _branch(self, test: ast.expr, then: str, other: str) -> None:
        truth = self._new(f"icmp ne i64 {self._of(test)}, 0")
        self._put(f"br i1 {truth}, label %{then}, label %{other}")

    # Expressions.

    def _of(self, node: ast.expr) -> str:
        act = getattr(self, f"_of_{type(node).__name__}", None)
        if act is None:
            raise NotViperError(f"the expression {ast.unparse(node)}")
        return str(act(node))

    def _of_Constant(self, node: ast.Constant) -> str:
        if not isinstance(node.value, int):
            raise NotViperError(f"{ast.unparse(node)} is no whole number")
        return str(int(node.value))

    def _of_Name(self, node: ast.Name) -> str:
        """A local, or a constant of the module."""
        if node.id in self._locals:
            return self._new(f"load i64, ptr %local_{node.id}")
        value = self._names.get(node.id)
        if type(value) is not int:
            raise NotViperError(f"{node.id} is no whole number")
        return str(value)

    def _of_BinOp(self, node: ast.BinOp) -> str:
        """Wrapped where it can leave 32 bits; an address is none of the chip's numbers here."""
        kind = type(node.op)
        left, right = self._of(node.left), self._of(node.right)
        if kind in _WHOLE:
            return self._new(f"{_WHOLE[kind]} i64 {left}, {right}")
        if kind in _WRAPPED:
            made = self._new(f"{_WRAPPED[kind]} i64 {left}, {right}")
            return made if self._is_address(node) else self._new(f"call i64 @wrap(i64 {made})")
        if kind not in _DIVIDED:
            raise NotViperError(f"the operator of {ast.unparse(node)}")
        zero = self._new(f"icmp eq i64 {right}, 0")
        (go,) = self._labels("divide")
        self._put(f"br i1 {zero}, label %divided_by_zero, label %{go}")
        self._lines.append(f"{go}:")
        return self._new(f"call i64 @{_DIVIDED[kind]}(i64 {left}, i64 {right})")

    def _of_UnaryOp(self, node: ast.UnaryOp) -> str:
        """The negative of the least number is itself."""
        value = self._of(node.operand)
        if isinstance(node.op, ast.USub):
            turned = self._new(f"sub i64 0, {value}")
            return self._new(f"call i64 @wrap(i64 {turned})")
        if isinstance(node.op, ast.Invert):
            return self._new(f"xor i64 {value}, -1")
        if isinstance(node.op, ast.Not):
            return self._truth(f"icmp eq i64 {value}, 0")
        return value

    def _of_Compare(self, node: ast.Compare) -> str:
        kind = type(node.ops[0])
        if len(node.ops) != 1 or kind not in _COMPARED:
            raise NotViperError(f"the comparison {ast.unparse(node)}")
        left, right = self._of(node.left), self._of(node.comparators[0])
        return self._truth(f"icmp {_COMPARED[kind]} i64 {left}, {right}")

    def _truth(self, test: str) -> str:
        return self._new(f"zext i1 {self._new(test)} to i64")

    def _of_BoolOp(self, node: ast.BoolOp) -> str:
        """The first that decides, or the last; what stands after it is not looked at."""
        place = self._place()
        (after,) = self._labels("decided")
        for last, each in zip([*[False] * (len(node.values) - 1), True], node.values, strict=True):
            value = self._of(each)
            self._put(f"store i64 {value}, ptr {place}")
            if not last:
                (more,) = self._labels("more")
                truth = self._new(f"icmp ne i64 {value}, 0")
                ways = (more, after) if isinstance(node.op, ast.And) else (after, more)
                self._put(f"br i1 {truth}, label %{ways[0]}, label %{ways[1]}")
                self._lines.append(f"{more}:")
        self._begin(after)
        return self._new(f"load i64, ptr {place}")

    def _of_IfExp(self, node: ast.IfExp) -> str:
        place = self._place()
        then, other, after = self._labels("then", "else", "after")
        self._branch(node.test, then, other)
        self._lines.append(f"{then}:")
        self._put(f"store i64 {self._of(node.body)}, ptr {place}")
        self._put(f"br label %{after}")
        self._lines.append(f"{other}:")
        self._put(f"store i64 {self._of(node.orelse)}, ptr {place}")
        self._begin(after)
        return self._new(f"load i64, ptr {place}")

    def _of_Subscript(self, node: ast.Subscript) -> str:
        """A load: words of 32 bits have a sign."""
        bits, place = self._element(node)
        word = self._new(f"load i{bits}, ptr {place}, align 1")  # a view may begin anywhere
        return self._new(f"{'sext' if bits == 32 else 'zext'} i{bits} {word} to i64")

    def _element(self, node: ast.Subscript) -> tuple[int, str]:
        """The bits of an element that a pointer points at, and where it is."""
        bits = self._pointers.get(node.value.id, 0) if isinstance(node.value, ast.Name) else cast(node.value)
        if not bits:
            raise NotViperError(f"{ast.unparse(node.value)} is no pointer")
        begin = self._new(f"inttoptr i64 {self._of(node.value)} to ptr")
        return bits, self._new(f"getelementptr i{bits}, ptr {begin}, i64 {self._of(node.slice)}")

    def _of_Call(self, node: ast.Call) -> str:
        """Casts vanish, calls of viper functions stay."""
        result = self._called(node)
        if not result:
            raise NotViperError(f"a value of {ast.unparse(node.func)}, which returns none")
        return result

    def _called(self, node: ast.Call) -> str:
        """What a call returns; nothing where it returns nothing."""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if (name in POINTERS or name in ("uint", "int")) and len(node.args) == 1:
            return self._of(node.args[0])
        signature = self._signatures.get(name)
        if signature is None or node.keywords or len(node.args) != len(signature.kinds):
            raise NotViperError(f"a call of {ast.unparse(node.func)}")
        given = "".join(f", i64 {self._of(argument)}" for argument in node.args)
        place = self._place()
        status = self._new(f"call i32 @{signature.symbol}(ptr {place}, ptr %reason{given})")
        zero = self._new(f"icmp ne i32 {status}, 0")
        (go,) = self._labels("go")
        self._put(f"br i1 {zero}, label %divided_by_zero, label %{go}")
        self._lines.append(f"{go}:")
        return self._new(f"load i64, ptr {place}") if signature.returns else ""

    def _is_address(self, node: ast.expr) -> bool:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            return node.func.id == "uint" or bool(cast(node))
        if isinstance(node, ast.BinOp):
            return self._is_address(node.left) or self._is_address(node.right)
        return isinstance(node, ast.Name) and node.id in self._pointers
