"""Patterns as people type them: `ripple.slow(2).rotate(30) * 0.5`. Only what is listed here is understood; nothing is run."""

import ast
import difflib
import inspect
import warnings
from collections.abc import Callable
from typing import Any

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.patterns.pattern import Pattern, as_pattern
from bubbleskin.patterns.words import WORDS

METHODS = ("slow", "fast", "rotate", "mirror", "shift")
"""What can be done to a pattern."""
TYPED_MAX = 500
"""Characters of a typed pattern."""
_HOW = "Write for example ripple.slow(2).rotate(30), or seq(wave, 0.5, noise(seed=3), each=2)."


def parse(text: str) -> Pattern:
    """The pattern that a text means.

    Words are `ripple`, `wave`, `pulse`, `noise` and `seq`, with or without arguments; they take `.slow(…)`, `.fast(…)`,
    `.rotate(…)`, `.mirror()`, `.shift(…)`, and can be added and multiplied, also with numbers from 0 to 1. Raises
    `InvalidInput` with what was not understood and which words there are.
    """
    checks.text("The pattern", text)
    if len(text) > TYPED_MAX:
        raise InvalidInput(f"A pattern of {len(text)} characters; {TYPED_MAX} at most can be typed.")
    try:
        with warnings.catch_warnings():  # of what is no Python we say more below than it does
            warnings.simplefilter("ignore")
            tree = ast.parse(text.strip(), mode="eval")
        return as_pattern(_value(tree.body))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, InvalidInput):
            raise
        raise InvalidInput(f"{checks.shown(text)} is no pattern: {_why(error)}. {_HOW}") from None


def _why(error: Exception) -> str:
    if isinstance(error, SyntaxError) and error.offset:
        return f"{error.msg} at character {error.offset}"
    return "it is nested too deep" if isinstance(error, RecursionError | MemoryError) else str(error).rstrip(".")


def _value(node: ast.expr) -> Pattern | float:
    """What one part of the text means: a pattern, or a number."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return number
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            number = _number(operand)
            return -number if isinstance(sign, ast.USub) else number
        case ast.Name(id=word):
            return _made(word, _word(word), [], [])
        case ast.Call(func=ast.Name(id=word), args=args, keywords=keywords):
            return _made(word, _word(word), args, keywords)
        case ast.Call(func=ast.Attribute(value=of, attr=method), args=args, keywords=keywords):
            return _made(f".{method}", _method(of, method), args, keywords)
        case ast.Attribute(value=of, attr=method):
            return _made(f".{method}", _method(of, method), [], [])
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return as_pattern(_value(left)) + as_pattern(_value(right))
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return as_pattern(_value(left)) * as_pattern(_value(right))
    raise InvalidInput(
        f"{checks.shown(ast.unparse(node))} means nothing in a pattern; it is made of {_listed(WORDS)}, numbers, + and *. {_HOW}"
    )


def _number(node: ast.expr) -> float:
    number = _value(node)
    if isinstance(number, Pattern):
        raise InvalidInput(f"A sign stands before {number}, which is a pattern; signs stand before numbers.")
    return number


def _word(word: str) -> Callable[..., Pattern]:
    if word not in WORDS:
        hint = f" {word} is done to a pattern: write ripple.{word}(…)." if word in METHODS else _nearest(word, WORDS)
        raise InvalidInput(f"There is no pattern {word!r}; there are {_listed(WORDS)}.{hint}")
    return WORDS[word]


def _method(of: ast.expr, method: str) -> Callable[..., Pattern]:
    if method not in METHODS:
        there = _listed(f".{name}()" for name in METHODS)
        raise InvalidInput(f"Nothing is called .{method}() of a pattern; there are {there}.{_nearest(method, METHODS)}")
    found: Callable[..., Pattern] = getattr(as_pattern(_value(of)), method)
    return found


def _made(name: str, make: Callable[..., Pattern], args: list[ast.expr], keywords: list[ast.keyword]) -> Pattern:
    """A word or a method with its arguments."""
    if any(keyword.arg is None for keyword in keywords):
        raise InvalidInput(f"{name}(…) is given something with **, which means nothing in a pattern. {_HOW}")
    parts = [_value(arg) for arg in args]
    named: dict[str, Any] = {str(keyword.arg): _value(keyword.value) for keyword in keywords}
    signature = inspect.signature(make)
    try:
        signature.bind(*parts, **named)
    except TypeError as error:
        takes = ", ".join(_argument(parameter) for parameter in signature.parameters.values()) or "nothing"
        raise InvalidInput(f"{name} takes {takes}; this is given {len(parts) + len(named)}: {error}.") from None
    return make(*parts, **named)


def _argument(parameter: inspect.Parameter) -> str:
    """How an argument is typed: its name, with what it is where nobody says."""
    if parameter.kind is parameter.VAR_POSITIONAL:
        return "patterns"
    return parameter.name if parameter.default is parameter.empty else f"{parameter.name}={parameter.default:g}"


def _listed(names: Any) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}"


def _nearest(name: str, names: Any) -> str:
    near = difflib.get_close_matches(name, list(names), 1)
    return f" Is {near[0]} meant?" if near else ""
