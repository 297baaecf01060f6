"""What is said on standard error, once each in a process."""

import sys

_said: set[str] = set()


def say_once(sentence: str) -> None:
    """One line, the first time."""
    if sentence not in _said:
        _said.add(sentence)
        print(sentence, file=sys.stderr, flush=True)


def say_compiling() -> None:
    """That what follows takes a while, this time."""
    say_once("Compiling the simulation for this computer, once: up to 20 s.")
