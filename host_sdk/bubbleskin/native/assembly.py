"""What is compiled, as LLVM's text."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class Signature(NamedTuple):
    """How a function is called: its symbol, which takes places for result and exception, then `kinds`.

    `kinds` and `returns` are LLVM's types i64, double and ptr; `returns` may be empty. It returns 0, or 1 where a
    number was divided by zero.
    """

    symbol: str
    kinds: Sequence[str]
    returns: str


class Assembly(NamedTuple):
    """A module of functions, and those of them that Python is to call, by name."""

    text: str
    functions: Mapping[str, Signature]
