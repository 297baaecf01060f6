"""What is said on standard error, once each in a process."""

import sys

_said: set[str] = set()

COMPILING = "Compiling for this computer, once: some ten seconds. `bubbleskin doctor --warm` does it ahead."
UNKEPT: list[str] = []
"""Why compiled code could not be kept, as often as that happened."""


def say_once(sentence: str) -> None:
    """One line, the first time."""
    if sentence not in _said:
        _said.add(sentence)
        print(sentence, file=sys.stderr, flush=True)


def say_compiling() -> None:
    """That what follows takes a while, this time."""
    say_once(COMPILING)


def expect_compiling() -> None:
    """Whoever compiles on purpose says so in a way of its own."""
    _said.add(COMPILING)


def say_unkept(where: str, error: Exception) -> None:
    """That what follows takes a while every time."""
    reason = getattr(error, "strerror", None) or "no folder can be written to"
    UNKEPT.append(f"{where}: {reason}")
    say_once(f"Compiled code cannot be kept in {where}, so every start compiles: {reason}.")
